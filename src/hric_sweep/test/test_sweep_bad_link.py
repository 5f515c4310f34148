"""Dask workers behind a link that delays and loses packets, and is down for some time."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import bad_link
import pytest
import test_sweep as sweeps
import test_sweep_dask
import test_sweep_survives as survives
from bad_link import ADDRESSES, BadLink
from dask_cluster import ENOUGH, Cluster

from hric_sweep.engines.dask_engine import CHUNK

pytestmark = [pytest.mark.alone, pytest.mark.slow]  # four sweeps
Figure = Callable[[str, float, str], None]


@pytest.fixture
def link() -> Iterator[BadLink]:
    if not bad_link.possible():
        pytest.skip("network namespaces and TUN devices need root")
    found = BadLink()
    yield found
    found.close()


def test_workers_behind_a_bad_link_give_the_same_table(tmp_path: Path, link: BadLink, figure: Figure) -> None:
    """Sweep with 50 ms of delay in each direction and 1 % loss, then with a link that is down for five seconds."""
    path = sweeps.written(tmp_path, runs=4 * CHUNK)
    expected = test_sweep_dask.sha256(sweeps.folder_of(sweeps.sweep(tmp_path, path, "--jobs", "2")))
    folder = tmp_path / "cluster"
    folder.mkdir()
    cluster = Cluster(folder, sides=(link.command(0), link.command(1)), hosts=ADDRESSES)
    try:
        for _ in range(2):
            cluster.start_worker()
        seconds = {}
        for name, delay, loss, down in (("good", 0.0, 0.0, 0.0), ("bad", 0.05, 0.01, 0.0), ("broken", 0.05, 0.01, 5.0)):
            link.delay, link.loss = delay, loss
            own = tmp_path / name
            process = survives.begun(own, path, "--dask", cluster.address, before=link.command(0))
            runs = own / "runs"
            survives.until(lambda: survives.folder_in(runs).exists(), process)  # noqa: B023
            began = time.monotonic()
            survives.until(lambda: survives.ended(survives.folder_in(runs)) >= 1, process)  # noqa: B023
            link.up = down == 0.0
            time.sleep(down)
            link.up = True
            printed, _ = process.communicate(timeout=ENOUGH)
            seconds[name] = time.monotonic() - began
            assert process.returncode == 0, printed
            assert test_sweep_dask.sha256(survives.folder_in(runs)) == expected
        assert link.lost > 0
        figure("link with 50 ms and 1 % loss, time of a sweep over that without", seconds["bad"] / seconds["good"], "1")
        figure("and down for 5 s", seconds["broken"] / seconds["good"], "1")
    finally:
        cluster.close()
