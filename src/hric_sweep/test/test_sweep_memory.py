"""The memory of a sweep's worker does not grow with the number of runs."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import test_sweep as sweeps
import test_sweep_survives as survives

from hric_sweep import definition
from hric_sweep.engines.pebble_engine import PebbleEngine

EARLY, LATE = 50, 500
"""Numbers of runs after which the memory is compared."""
MORE = 1.10
MEMORY = 4e9
"""Memory limit of the worker [bytes]."""
PERSON = "human.subject:={code: S00, mass: 78.2, height: 1.759, sex: male, parts: right_arm}"
CASES: dict[str, dict[str, Any]] = {
    "mujoco": {"extends": "pd_step", "changes": ["simulator:=mujoco", "duration:=0.2"]},
    "pybullet": {"extends": "pd_step", "changes": ["simulator:=pybullet", "duration:=0.2"]},
    "human": {"extends": "contact", "changes": ["simulator:=mujoco", "duration:=0.6", PERSON]},
}


def resident(pid: int) -> int:
    """Return the resident memory of a process [kB]."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("VmRSS")))


@pytest.mark.slow  # hundreds of runs
@pytest.mark.parametrize("case", CASES)
def test_a_worker_has_hardly_more_memory_after_500_runs_than_after_50(case: str) -> None:
    plan = definition.plan(case, {**sweeps.SWEEP, **CASES[case]})
    engine, sizes = PebbleEngine(1, MEMORY), dict[int, int]()
    try:
        for index in range(LATE):
            task = plan.task(index, {"kp": 40.0 + 40.0 * index / LATE}, "code")
            assert engine.submit(replace(task, timeout=survives.ENOUGH)).result().failure == ""
            if index + 1 in (EARLY, LATE):
                (worker,) = survives.children(os.getpid())
                sizes[index + 1] = resident(worker)
    finally:
        engine.close(now=True)
    print(f"\n{case}: {sizes[EARLY] / 1024:.0f} MB after {EARLY} runs, {sizes[LATE] / 1024:.0f} MB after {LATE}")
    assert sizes[LATE] <= MORE * sizes[EARLY]
