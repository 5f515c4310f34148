"""Sweeps on a Dask cluster: same table as on one machine, also if processes end meanwhile; messages on mistakes."""

import os
import random
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import bad_controller
import distributed
import pytest
import sweep_folder
import test_sweep as sweeps
import test_sweep_survives as survives
from dask_cluster import ENOUGH, ROOT, Cluster, below, started, until

from hric_core.errors import HricError
from hric_sweep import table
from hric_sweep.engines import dask_engine
from hric_sweep.engines.dask_engine import CHUNK, DaskEngine
from hric_sweep.engines.engine import Lost

pytestmark = pytest.mark.alone
RUNS = 5 * CHUNK + 7
TPE = {"sampler": {"kind": "tpe", "batch": 5}, "objective": {"maximise": "speed"}}


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    yield from started(tmp_path / "cluster")


def sha256(folder: Path) -> str:
    return sweep_folder.results_sha256(table.read(folder))


def test_the_table_of_a_cluster_is_that_of_one_machine_also_after_kill_9_of_a_worker(
    tmp_path: Path, cluster: Cluster
) -> None:
    for _ in range(2):
        cluster.start_worker()
    path = sweeps.written(tmp_path, runs=2 * CHUNK + 3)
    alone = sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "2"))
    printed = sweeps.sweep(tmp_path, path, "--dask", cluster.address)
    of_cluster = sweeps.folder_of(printed)
    assert sha256(of_cluster) == sha256(alone)
    assert "distributed" not in printed and "Warning" not in printed
    kept = sorted(one.name for one in (alone / "columns").iterdir())
    assert kept and sorted(one.name for one in (of_cluster / "columns").iterdir()) == kept
    killed = killed_at_its_chunk(tmp_path / "killed", path, cluster)
    assert sha256(killed) == sha256(alone)


def killed_at_its_chunk(folder: Path, path: Path, cluster: Cluster) -> Path:
    """Return the folder of a sweep in which one of two workers was killed while it executed a chunk."""
    process = survives.begun(folder, path, "--dask", cluster.address)
    with distributed.Client(cluster.address) as client:
        survives.until(
            lambda: survives.folder_in(folder / "runs").exists() and all(client.processing().values()), process
        )
        os.kill(cluster.worker_pid(cluster.workers[0]), signal.SIGKILL)
    printed, _ = process.communicate(timeout=ENOUGH)
    assert process.returncode == 0, printed
    return survives.folder_in(folder / "runs")


@pytest.mark.slow  # three sweeps, two clusters
@pytest.mark.parametrize("sampler", [{}, TPE], ids=["random", "tpe"])
def test_the_table_of_a_local_cluster_is_the_same_with_one_worker_and_two(
    tmp_path: Path, sampler: dict[str, Any]
) -> None:
    path = sweeps.written(tmp_path, runs=2 * CHUNK + 3, **sampler)
    ways = [("--jobs", "2"), ("--dask", "local", "--jobs", "1"), ("--dask", "local", "--jobs", "2")]
    assert len({sha256(sweeps.folder_of(sweeps.sweep(tmp_path, path, *way))) for way in ways}) == 1


# -- what ends meanwhile -----------------------------------------------------------------------------------------------


@pytest.mark.slow  # seven sweeps with pauses
@pytest.mark.parametrize("sampler", [{}, TPE], ids=["random", "tpe"])
@pytest.mark.parametrize("what", ["worker", "supervisor", "scheduler"])
def test_the_table_is_the_same_after_kill_9_at_random_moments(
    what: str, sampler: dict[str, Any], tmp_path: Path, cluster: Cluster
) -> None:
    for _ in range(2):
        cluster.start_worker()
    path = sweeps.written(tmp_path, runs=RUNS, **sampler)
    expected = sha256(sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "2")))
    drawn = random.Random(what)
    for number in range(3):
        own = tmp_path / f"killed_{number}"
        process = survives.begun(own, path, "--dask", cluster.address)
        moment = drawn.randrange(1, RUNS - 2 * CHUNK)
        survives.until(lambda: survives.ended(survives.folder_in(own / "runs")) >= moment, process)  # noqa: B023
        folder = survives.folder_in(own / "runs")
        if what == "worker":
            os.kill(cluster.worker_pid(drawn.choice(cluster.workers)), signal.SIGKILL)
            printed, _ = process.communicate(timeout=ENOUGH)
            assert process.returncode == 0, printed
        elif what == "supervisor":
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate(timeout=ENOUGH)
            assert survives.ended(folder) < RUNS
            sweeps.sweep(own, "--resume", folder, "--dask", cluster.address)
        else:
            cluster.scheduler.kill()
            printed, _ = process.communicate(timeout=ENOUGH)
            assert process.returncode == 3, printed
            assert (
                f"scheduler at {cluster.address} lost" in printed
                and f"sweep --resume {folder}" in printed
                and "Traceback" not in printed
            )
            assert table.read(folder).num_rows == survives.ended(folder) < RUNS
            cluster.close()
            cluster.start_scheduler()
            cluster.workers = [cluster.start_worker(), cluster.start_worker()]
            sweeps.sweep(own, "--resume", folder, "--dask", cluster.address)
        assert sha256(folder) == expected


def test_a_client_that_gave_the_scheduler_up_says_that_it_is_lost_whatever_it_fails_by(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_engine, "CONNECT", 3.0)  # after that long it gives up
    cluster.start_worker()
    engine = DaskEngine(cluster.address, 4e9)
    try:
        chunk = engine._client.submit(len, "abc")
        chunk.result()
        cluster.scheduler.kill()
        until(lambda: engine._client.status == "closed")
        (carried,) = engine._fetched([chunk])
        with pytest.raises(Lost, match=r"connection to the Dask scheduler at tcp://.* lost"):
            engine._outcomes(chunk, carried, 1)
        with pytest.raises(HricError, match=r"at tcp://.* was lost during the handshake; valid: restart it"):
            engine.check({})
    finally:
        engine.close(now=True)


@pytest.mark.slow  # a run hangs three times
def test_runs_that_end_their_process_or_hang_cost_themselves_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = ["not", "ends", "hangs", "not"]
    path = bad_controller.sweep(tmp_path, monkeypatch, ways, timeout=30.0)
    printed = sweeps.sweep(tmp_path, path, "--dask", "local", "--jobs", "1", code=3)
    frame = table.load_sweep(sweeps.folder_of(printed)).set_index("index")
    assert (frame["failure"][[0, 3]] == "").all() and frame["speed"][[0, 3]].notna().all()
    assert "ended its worker (exit code 7)" in frame["failure"][1] and "longer than 30 s" in frame["failure"][2]
    assert "4 runs, 2 failed" in printed and "Traceback" not in printed


@pytest.mark.slow  # a hundred runs
def test_workers_are_free_again_after_ctrl_c(tmp_path: Path, cluster: Cluster) -> None:
    worker = cluster.start_worker()
    path = sweeps.written(tmp_path, runs=4000)
    path.write_text(path.read_text().replace("duration:=0.3", "duration:=20.0"))  # no chunk ends by itself meanwhile
    process = survives.begun(tmp_path, path, "--dask", cluster.address)
    survives.until(lambda: survives.ended(survives.folder_in(tmp_path / "runs")) >= 1, process)
    os.killpg(process.pid, signal.SIGINT)
    printed, _ = process.communicate(timeout=ENOUGH)
    folder = survives.folder_in(tmp_path / "runs")
    assert process.returncode == 130, printed
    assert f"sweep --resume {folder}" in printed and "Traceback" not in printed and "distributed" not in printed
    until(lambda: not below(cluster.worker_pid(worker)))  # nobody waits for the runs, so their process has ended


# -- workers that differ -----------------------------------------------------------------------------------------------


def other_code(folder: Path) -> dict[str, str]:
    """Return the environment of a worker in which one file of a package differs."""
    shutil.copytree(ROOT / "src" / "hric_controllers", folder / "other" / "hric_controllers")
    changed = next((folder / "other" / "hric_controllers").rglob("*.yaml"))
    changed.write_text(changed.read_text() + "# changed\n")
    return {"ROS_PACKAGE_PATH": f"{folder / 'other'}:{os.environ['ROS_PACKAGE_PATH']}"}


@pytest.mark.slow  # workers begin three times
def test_a_worker_with_other_code_is_refused_by_name_at_the_beginning_and_later(
    tmp_path: Path, cluster: Cluster
) -> None:
    cluster.start_worker()
    process = survives.begun(tmp_path, sweeps.written(tmp_path, runs=4000), "--dask", cluster.address)
    survives.until(lambda: survives.ended(survives.folder_in(tmp_path / "runs")) >= 1, process)
    cluster.start_worker(other_code(tmp_path))
    printed, _ = process.communicate(timeout=ENOUGH)
    folder = survives.folder_in(tmp_path / "runs")
    assert process.returncode == 3, printed
    assert "joined later" in printed and "code version" in printed and f"sweep --resume {folder}" in printed
    assert table.read(folder).num_rows == survives.ended(folder) > 0
    again = tmp_path / "again"
    told = sweeps.sweep(again, sweeps.written(tmp_path), "--dask", cluster.address, code=2)
    assert "workers differ" in told and f"({socket.gethostname()})" in told and "code version" in told
    assert not (again / "runs").exists()  # nothing was begun


# -- who may connect ---------------------------------------------------------------------------------------------------


@pytest.mark.slow  # a cluster of its own
def test_a_cluster_with_certificates_carries_a_sweep_out_for_those_alone_who_have_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = sweeps.written(tmp_path, runs=CHUNK)
    (tmp_path / "cluster").mkdir()
    with closing(Cluster(tmp_path / "cluster", certified=True)) as cluster:
        cluster.start_worker()
        assert cluster.address.startswith("tls://")
        without = sweeps.sweep(tmp_path / "without", path, "--dask", cluster.address, code=2)
        plain = sweeps.sweep(tmp_path / "plain", path, "--dask", cluster.address.replace("tls", "tcp"), code=2)
        for key, value in {"CA_FILE": cluster.certificate, "CLIENT__CERT": cluster.certificate}.items():
            monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{key}", str(value))
        monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY", str(cluster.key))
        folder = sweeps.folder_of(sweeps.sweep(tmp_path, path, "--dask", cluster.address))
    assert "no Dask scheduler responds" in without and "TLS" in without and len(without.splitlines()) == 1
    assert "no Dask scheduler responds" in plain and len(plain.splitlines()) == 1
    assert table.read(folder).num_rows == CHUNK


# -- mistakes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("10.0.0.1:8786", r"no address; valid: local, tcp://HOST:PORT"),
        ("tcp://10.0.0.1", r"no address; valid: tcp://HOST:PORT"),
        ("tcp://127.0.0.1:{closed}", r"no Dask scheduler responds at .*refused; valid: start one"),
        ("tcp://127.0.0.1:{silent}", r"no Dask scheduler responds at .*(does not answer|imed out).*; valid: start one"),
        ("tls://127.0.0.1:{silent}", r"no Dask scheduler responds at .*TLS"),
    ],
)
def test_an_address_without_a_scheduler_is_told_in_bounded_time(
    address: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_engine, "CONNECT", 2.0)
    with socket.create_server(("127.0.0.1", 0)) as silent, socket.create_server(("127.0.0.1", 0)) as closed:
        ports = {"silent": silent.getsockname()[1], "closed": closed.getsockname()[1]}
        closed.close()
        with pytest.raises(HricError, match=reason) as caught:
            DaskEngine(address.format(**ports), 1e9)
    assert caught.value.exit_code == 2


def test_a_scheduler_without_workers_is_told_with_the_command_that_starts_some(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dask_engine, "WORKERS", 0.5)
    with pytest.raises(HricError, match=f"no workers.*scripts/worker {cluster.address}"):
        DaskEngine(cluster.address, 1e9)


def test_an_unreachable_cluster_begins_no_folder(tmp_path: Path) -> None:
    told = sweeps.sweep(tmp_path, sweeps.written(tmp_path), "--dask", "nonsense", code=2)
    assert len(told.splitlines()) == 1 and not (tmp_path / "runs").exists()


def test_jobs_say_nothing_about_a_cluster_elsewhere(tmp_path: Path) -> None:
    told = sweeps.sweep(tmp_path, sweeps.written(tmp_path), "--dask", "tcp://127.0.0.1:9", "--jobs", "2", code=2)
    assert "--jobs has no effect on the cluster tcp://127.0.0.1:9" in told


def test_without_dask_the_error_names_the_command_that_installs_it() -> None:
    lines = (
        "import sys; sys.modules['distributed'] = None",
        "from hric_sweep.engines.dask_engine import DaskEngine",
        "DaskEngine('tcp://127.0.0.1:9', 1e9)",
    )
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, timeout=ENOUGH)
    assert done.returncode == 1 and "scripts/setup --with cluster" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((), "nothing is not the address of a scheduler"),
        (("10.0.0.1",), "10.0.0.1 is not the address of a scheduler"),
        (("tcp://10.0.0.1:8786", "--workers", "0"), "--workers 0 is not possible; valid: 1 or more"),
    ],
)
def test_the_command_for_workers_tells_what_is_wrong(given: tuple[str, ...], told: str) -> None:
    done = subprocess.run([ROOT / "scripts/worker", *given], capture_output=True, text=True, timeout=ENOUGH)
    assert done.returncode == 2 and told in done.stderr and len(done.stderr.splitlines()) == 1
