"""Check before a sweep: variables without effect or with invalid values are reported."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

import pytest
import test_sweep as sweeps
from in_process import Here

from hric_core.errors import HricError
from hric_sweep import definition, probe
from hric_sweep.engines.pebble_engine import Patience

KP = "parameters.joint_pd_controller.kp"


def probed(path: str, distribution: dict[str, Any], **section: Any) -> list[str]:
    vary = {"x": {"paths": [path], "distribution": distribution}}
    content = {**sweeps.SWEEP, "changes": ["simulator:=mujoco", "duration:=0.05", "setpoints.0.time:=0.01"]}
    plan = definition.plan("own", {**content, "sweep": {**sweeps.SWEEP["sweep"], "vary": vary, **section}})
    assert probe.runs_of(plan) == 3
    return probe.probe(plan, Here(), "code")  # type: ignore[arg-type]


def uniform(low: float, high: float) -> dict[str, Any]:
    return {"kind": "uniform", "low": low, "high": high}


def test_a_variable_that_changes_an_output_is_accepted() -> None:
    assert probed(KP, uniform(40, 80)) == []


@pytest.mark.parametrize(
    ("path", "distribution", "message"),
    [
        (
            "robot.plant.seed",
            {"kind": "choice", "values": [1, 2, 3]},
            r"vary\.x \(robot\.plant\.seed\) changes none of",
        ),
        (f"{KP}p", uniform(40, 80), r"vary\.x at 40\.4: .*no parameter 'kpp' .*did you mean kp\?"),
        (
            "robot.q_start",
            {"kind": "choice", "values": [[0, -45, 0, -135, 0, 90, 45]] * 2 + [[0] * 7]},
            "-45 deg would be",
        ),
        ("robot.load.mass", uniform(500, 2000), r"at their medians: .*1250 g would be 1\.25 kg"),
    ],
)
def test_a_variable_without_effect_or_with_values_that_cannot_be_ends_the_sweep(path, distribution, message) -> None:
    with pytest.raises(HricError, match=message):
        probed(path, distribution)


def test_a_variable_that_a_rare_event_may_depend_on_is_warned_of_where_the_motion_changes() -> None:
    outputs = {"count": {"path": "contacts.episodes.*", "reduce": "count"}}
    section = {"outputs": outputs, "exceedance": {"output": "count", "above": 0.5}}
    (warning,) = probed(KP, uniform(40, 80), **section)
    assert "changes none of the outputs count" in warning


@dataclass
class Work:
    """Task of a process pool, with the attributes that pebble gives it."""

    worker_id: int
    timeout: float
    id: int = 1
    started: bool = True
    future: "Future[Any]" = field(default_factory=Future)


def judged(code: str, timeout: float, until: float, duty: float = 1.0) -> tuple[bool, float]:
    """Return whether a process that runs for a share of the time counts as hanging, and after how long [s]."""
    process, patience = subprocess.Popen([sys.executable, "-c", code]), Patience()
    work, begun = Work(process.pid, timeout), time.monotonic()
    try:
        while (passed := time.monotonic() - begun) < until:
            if patience.exhausted(work):
                return True, passed
            if duty < 1.0:
                os.kill(process.pid, signal.SIGSTOP)
                time.sleep(0.1 * (1.0 - duty))
                os.kill(process.pid, signal.SIGCONT)
            time.sleep(0.1 * duty)
        return False, passed
    finally:
        process.kill()
        process.wait()


def test_a_run_that_sleeps_and_one_that_computes_for_ever_hang() -> None:
    assert judged("import time; time.sleep(1000)", 2.0, 300.0)[0]
    assert judged("while True: pass", 0.5, 300.0)[0]


def test_a_healthy_run_on_a_machine_that_gives_it_little_time_does_not_hang() -> None:
    hung, passed = judged("while True: pass", 4.0, 5.0, duty=0.2)
    assert not hung and passed > 4.0
