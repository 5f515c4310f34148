"""Sweeps survive kill -9 of a worker or of themselves, Ctrl-C, and runs that end their worker or take all memory."""

import multiprocessing
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import cast

import bad_controller
import pytest
import sweep_folder
import test_sweep as sweeps
import test_sweep_adaptive as adaptive
from in_process import Here, carried_out
from pebble import ProcessExpired

from hric_core.errors import FailureError
from hric_sweep import definition, execution, table
from hric_sweep.engines import pebble_engine
from hric_sweep.engines.engine import Lost
from hric_sweep.engines.pebble_engine import PebbleEngine
from hric_sweep.records import RunTask

ENOUGH = 580.0
"""Timeout of all waits in the tests, long enough for a busy machine [s]."""
SAMPLERS = {"random": {"runs": 12}, **adaptive.SAMPLERS}
PATIENCE = 45.0
"""Timeout of a run that takes a second, including the start of its worker [s]."""
SHORT, HEALTHY = 4.0, 24
"""Timeout of a run that takes a twentieth of a second [s]; number of such runs before one that hangs."""


def begun(folder: Path, *arguments: str | Path, before: Sequence[str] = ()) -> "subprocess.Popen[str]":
    """Start a sweep in a new process group; `before`: prefix of its command."""
    return subprocess.Popen(
        [*before, "rosrun", "hric_experiments", "sweep", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "HRIC_RUNS": str(folder / "runs")},
    )


def until(reached: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    deadline = time.monotonic() + ENOUGH
    while not reached():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.05)


def ended(folder: Path) -> int:
    """Return the number of runs in the journal."""
    path = folder / "runs.jsonl"
    return path.read_bytes().count(b"\n") if path.is_file() else 0


def folder_in(runs: Path) -> Path:
    return next(iter(runs.glob("gains_*")), runs / "none")


def children(pid: int) -> list[int]:
    """Return the workers of a supervisor: its descendants that lead a process group."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it ended meanwhile
            continue
        child, parent, group = int(stat.parent.name), int(fields[1]), int(fields[2])
        if parent == pid and group == child:
            found.append(child)
    return found


def supervisor_of(process: "subprocess.Popen[str]") -> int:
    """Return the process id of the supervisor; rosrun replaces itself by the program or starts it."""
    return (
        process.pid
        if children(process.pid)
        else int(next(s.parent.name for s in Path("/proc").glob("[0-9]*/stat") if _parent(s) == process.pid))
    )


def _parent(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except OSError:
        return 0


@pytest.mark.slow  # four sweeps with pauses each
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_table_is_the_same_after_kill_9_of_a_worker_and_of_the_sweep_at_random_moments(
    tmp_path: Path, sampler: str
) -> None:
    path = sweeps.written(tmp_path, **SAMPLERS[sampler])
    whole = sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "1"))
    runs, expected = ended(whole), sweep_folder.results_sha256(table.read(whole))
    drawn = random.Random(sampler)
    for number in range(3):
        own = tmp_path / f"killed_{number}"
        process = begun(own, path, "--jobs", "2")
        first, then = sorted(drawn.sample(range(1, runs - 2), 2))
        until(lambda: ended(folder_in(own / "runs")) >= first, process)  # noqa: B023
        workers = children(supervisor_of(process))
        if workers:
            os.kill(drawn.choice(workers), signal.SIGKILL)
        until(lambda: ended(folder_in(own / "runs")) >= then, process)  # noqa: B023
        supervisor = supervisor_of(process)
        left = children(supervisor)
        os.kill(supervisor, signal.SIGKILL)
        process.wait(ENOUGH)
        deadline = time.monotonic() + ENOUGH
        while any(Path(f"/proc/{pid}").exists() for pid in left):  # none goes on without its supervisor
            assert time.monotonic() < deadline
            time.sleep(0.05)
        folder = folder_in(own / "runs")
        assert ended(folder) < runs
        sweeps.sweep(own, "--resume", folder, "--jobs", str(1 + number % 2))
        assert sweep_folder.results_sha256(table.read(folder)) == expected


def test_ctrl_c_keeps_what_ended_and_says_how_to_go_on(tmp_path: Path) -> None:
    process = begun(tmp_path, sweeps.written(tmp_path, runs=400), "--jobs", "2")
    until(lambda: ended(folder_in(tmp_path / "runs")) >= 2, process)
    os.killpg(process.pid, signal.SIGINT)
    printed, _ = process.communicate(timeout=ENOUGH)
    folder = folder_in(tmp_path / "runs")
    assert process.returncode == 130, printed
    assert f"sweep --resume {folder}" in printed and "Traceback" not in printed
    assert table.read(folder).num_rows == ended(folder) < 400


def test_ctrl_c_does_not_reach_a_worker_that_is_starting() -> None:
    mask = "next(line.split()[1] for line in open('/proc/self/status') if line.startswith('SigBlk'))"
    engine = PebbleEngine(1, 4e9)
    try:
        blocked = engine._pool.schedule(eval, args=(mask,), timeout=ENOUGH).result(ENOUGH)
    finally:
        engine.close(now=True)
    assert int(blocked, 16) & 1 << (signal.SIGINT - 1)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_without_semaphores_the_error_names_what_the_workers_need() -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, before[1]))
    try:
        with pytest.raises(FailureError, match="semaphores, in /dev/shm, and pipes: Too many open files"):
            PebbleEngine(1, 4e9)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.slow  # a worker begins four times
def test_runs_that_end_their_worker_or_take_all_memory_cost_themselves_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = ["not", "ends", "takes all memory", "not"]
    printed = sweeps.sweep(tmp_path, bad_controller.sweep(tmp_path, monkeypatch, ways), "--jobs", "2", code=3)
    frame = table.load_sweep(sweeps.folder_of(printed)).set_index("index")
    assert frame["how"].tolist() == ways
    assert (frame["failure"][[0, 3]] == "").all() and frame["speed"][[0, 3]].notna().all()
    assert frame["failure"][1] == "failed in each of 3 attempts: ended its worker (exit code 7)"
    assert frame["failure"][2]
    assert "4 runs, 2 failed" in printed and "Traceback" not in printed


def test_a_run_whose_controller_raises_is_told_with_what_it_raised_and_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = ["raises", "raises in starting", "raises in init", "not", "raises"]
    path = bad_controller.sweep(tmp_path, monkeypatch, ways)
    printed = sweeps.sweep(tmp_path, path, "--jobs", "1", code=3)
    frame = table.load_sweep(sweeps.folder_of(printed)).set_index("index")
    about = r"ValueError: <bad_module.Bad object> has no force \(bad_module.py:\d+\)"
    for index, where in enumerate(("was stopped, it failed in update", "failed in starting", "cannot be loaded")):
        told = frame["failure"][index]
        assert re.search(rf"bad {where}: {about}$", told), told
    assert frame["failure"][3] == "" and frame["failure"][4] == frame["failure"][0]
    assert "failed 2 times: " in printed and "Traceback" not in printed


@pytest.mark.slow  # three times the patience
def test_a_run_that_hangs_is_killed_tried_again_and_marked_and_its_neighbours_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = ["not", "hangs", "not", "not"]
    path = bad_controller.sweep(tmp_path, monkeypatch, ways, timeout=PATIENCE)
    frame = table.load_sweep(sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "2", code=3))).set_index("index")
    assert frame["failure"][1] == (
        f"failed in each of 3 attempts: took more than {PATIENCE:g} s of processor time, or made no progress for as "
        "long"
    )
    others = frame.drop(1)
    assert (others["failure"] == "").all() and (others["attempt"] == 1).all() and others["speed"].notna().all()


def stop_within_a_run(engine: PebbleEngine, worker: int) -> None:
    """Stop (SIGSTOP) a worker during a run."""
    while True:
        os.kill(worker, signal.SIGSTOP)
        time.sleep(0.5)  # the pool takes what the worker has sent
        if any(task.worker_id == worker for task in list(engine._manager.task_manager.tasks.values())):
            return
        os.kill(worker, signal.SIGCONT)
        time.sleep(0.01)


def test_worker_killed_between_two_runs_is_replaced() -> None:
    engine = PebbleEngine(1, 4e9)
    try:
        worker = engine._pool.schedule(os.getpid, timeout=ENOUGH).result(ENOUGH)
        os.kill(worker, signal.SIGKILL)
        while worker in children(os.getpid()):  # the pool has not noticed it
            time.sleep(0.01)
        assert engine._pool.schedule(os.getpid, timeout=ENOUGH).result(ENOUGH) != worker
    finally:
        engine.close(now=True)


def test_ctrl_c_does_not_reach_a_worker_that_starts(capfd: pytest.CaptureFixture[str]) -> None:
    engine = PebbleEngine(1, 4e9)
    try:
        response, interrupted = engine._pool.schedule(os.getpid, timeout=ENOUGH), 0
        while not response.done():
            for worker in multiprocessing.active_children():
                if worker.pid is not None:
                    os.kill(worker.pid, signal.SIGINT)
                    interrupted += 1
            time.sleep(0.05)
        assert response.result() in children(os.getpid()) and interrupted > 1
    finally:
        engine.close(now=True)
    assert "KeyboardInterrupt" not in capfd.readouterr().err


def die_with_the_lock() -> None:
    """Kill this worker while it holds the lock of the channel by which workers get tasks."""
    frame = sys._getframe()
    while "channel" not in frame.f_locals:
        frame = cast(FrameType, frame.f_back)
    frame.f_locals["channel"].mutex.acquire()
    os.kill(os.getpid(), signal.SIGKILL)


def test_worker_killed_with_the_lock_of_the_channel_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pebble_engine, "LOCKED", 0.5)
    engine = PebbleEngine(2, 4e9)
    try:
        with pytest.raises(ProcessExpired):
            engine._pool.schedule(die_with_the_lock, timeout=ENOUGH).result()
        assert engine._pool.schedule(os.getpid, timeout=ENOUGH).result(ENOUGH) != os.getpid()
    finally:
        engine.close(now=True)


def test_workers_that_end_before_they_run_anything_end_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pebble_engine, "IDLE_DEATHS", 1)
    monkeypatch.setattr(pebble_engine, "begin_worker", os.abort)
    engine = PebbleEngine(1, 4e9)
    try:
        response = engine.submit(RunTask(0, "none", {}, {}, 0, {}, ENOUGH, ""))
        with pytest.raises(Lost, match="the workers of this machine end before they run anything"):
            response.result(ENOUGH)
    finally:
        engine.close(now=True)


def test_a_worker_that_is_killed_costs_no_run_and_a_run_that_hangs_costs_itself_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(execution, "TRIES", 2)  # a worker begins anew for each
    ways = ["not"] * HEALTHY
    healthy = definition.load(str(bad_controller.sweep(tmp_path / "healthy", monkeypatch, ways)))
    expected = carried_out(tmp_path / "healthy", healthy, Here())
    path = bad_controller.sweep(tmp_path / "hangs", monkeypatch, [*ways, "hangs"], timeout=SHORT)
    others = set(children(os.getpid()))  # of tests before this one
    engine, folder = PebbleEngine(1, 4e9), tmp_path / "hangs"
    try:
        with ThreadPoolExecutor() as beside:
            sweep = beside.submit(carried_out, folder, definition.load(str(path)), engine)
            while not ended(folder):
                assert not sweep.done()
                time.sleep(0.005)
            (worker,) = set(children(os.getpid())) - others
            stop_within_a_run(engine, worker)
            os.kill(worker, signal.SIGKILL)
            *rows, hung = sweep.result(ENOUGH)
    finally:
        engine.close(now=True)
    told = "took more than 4 s of processor time, or made no progress for as long"
    assert hung.failure == f"failed in each of 2 attempts: {told}"
    assert [row.attempt for row in rows].count(2) == 1 and {row.failure for row in rows} == {""}
    same = ("id", "seed", "outputs", "state_sha256")
    assert [[getattr(row, name) for name in same] for row in rows] == [
        [getattr(row, name) for name in same] for row in expected
    ]
