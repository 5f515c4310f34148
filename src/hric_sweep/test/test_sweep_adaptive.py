"""Adaptive samplers give the same table for any order in which runs end, and after any interruptions."""

import random
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import sweep_folder
import test_sweep as sweeps

from hric_sweep import definition, table
from hric_sweep.definition import SweepPlan
from hric_sweep.journal import Journal
from hric_sweep.records import ReferenceRun, RunResponse, RunTask
from hric_sweep.supervisor import SweepSupervisor

KP = "parameters.joint_pd_controller.kp"
RARE = {"exceedance": {"output": "speed", "above": 0.763}, "keep": {"worst": 0}}
"""Sections for a rare exceedance: in `answer` kp, between 40 and 80, must be above 78."""
SAMPLERS: dict[str, dict[str, Any]] = {
    "cross_entropy": {"sampler": {"kind": "cross_entropy", "batch": 20}, "runs": 120, **RARE},
    "subset": {"sampler": {"kind": "subset", "smallest": 0.01}, "runs": 190, **RARE},
    "tpe": {"sampler": {"kind": "tpe"}, "runs": 50, "objective": {"maximise": "speed"}, "keep": {"worst": 0}},
}


class AnyOrder:
    """Engine whose tasks end in random order, and which can be interrupted.

    Args:
        seed: seed of the durations of tasks.
        after: number of tasks before Ctrl-C; None: no Ctrl-C.
    """

    window = workers = 7

    def __init__(self, seed: int, after: int | None = None) -> None:
        self._random, self._after = random.Random(seed), after
        self._threads = ThreadPoolExecutor(self.workers)

    def submit(self, task: RunTask) -> "Future[RunResponse]":
        if self._after == 0:
            raise KeyboardInterrupt
        self._after = None if self._after is None else self._after - 1
        return self._threads.submit(answer, task, self._random.uniform(0.0, 0.004))

    def flush(self) -> None:
        pass

    def check(self, reference: RunTask) -> ReferenceRun:
        raise NotImplementedError

    def close(self, *, now: bool) -> None:
        self._threads.shutdown()


def answer(task: RunTask, duration: float) -> RunResponse:
    """Return a made-up response; runs with a low kp always fail."""
    time.sleep(duration)
    kp = task.changes[KP]
    failed = kp < 45.0
    outputs = {"speed": None if failed else kp / 100.0 - 0.017, "error": 0.0}
    failure = "HricError: no" if failed else ""
    return RunResponse(task.id, task.index, outputs, failure, f"{kp}", 0.0, 0.0, "here")


def results(folder: Path, plan: SweepPlan, *engines: AnyOrder) -> tuple[str, Any]:
    """Return hash and estimate of a sweep that all engines but the last interrupt within a line of the journal."""
    folder.mkdir()
    for number, engine in enumerate(engines):
        with Journal(folder) as journal:
            supervisor = SweepSupervisor(plan, folder, journal, engine, "code")
            if number == len(engines) - 1:
                supervisor.run()
            else:
                with pytest.raises(KeyboardInterrupt):
                    supervisor.run()
        engine.close(now=False)
        with (folder / "runs.jsonl").open("a") as file:
            file.write('{"id": "')
    return sweep_folder.results_sha256(table.read(folder)), supervisor.estimate


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_the_points_of_a_sampler_that_learns_do_not_depend_on_order_or_interruptions(
    tmp_path: Path, sampler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table, "find", Path)
    plan = definition.load(str(sweeps.written(tmp_path, **SAMPLERS[sampler])))
    expected = results(tmp_path / "whole", plan, AnyOrder(0))
    drawn = random.Random(sampler)
    for case in range(3):
        cuts = [AnyOrder(case, after=drawn.randrange(1, SAMPLERS[sampler]["runs"] // 4)) for _ in range(3)]
        assert results(tmp_path / str(case), plan, *cuts, AnyOrder(9 + case)) == expected
    frame = table.read(tmp_path / "whole").to_pandas()
    assert frame["batch"].nunique() > 2 and (frame["failure"] != "").any()
    assert (expected[1] is None) == (sampler == "tpe")
