"""One bring-up, three engines: nothing above the plant can tell which one it is."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from bags import control_log, gaps_and_repeats, topics
from live_system import LiveSystem

pytestmark = pytest.mark.alone

Start = Callable[..., LiveSystem]
NOT_OF_PYBULLET = {"/sim/joint_reactions"}
BEFORE_OR_AFTER = {"/sim/contacts"}
"""One message says at the start that nothing touches: the recorder is there by then, or not yet."""


@pytest.mark.parametrize("engine", ["opensim", "mujoco"])
def test_pd_step_runs_on_each_engine_with_the_topics_and_services_of_pybullet(
    engine: str, start: Start, pd_step: Any
) -> None:
    system = start("env:=sim", f"simulator:={engine}", "rviz:=false", "experiment:=pd_step")
    offered = system.services_of_a_run()
    assert system.wait(timeout=150.0) == 0, system.output
    assert system.processes() == {}
    assert offered == pd_step.services
    bags = [next(one.run_folder.glob("*.bag")) for one in (system, pd_step.system)]
    assert topics(bags[0]) - NOT_OF_PYBULLET - BEFORE_OR_AFTER == topics(bags[1]) - BEFORE_OR_AFTER
    cycles, times = control_log(bags[0])
    assert gaps_and_repeats(cycles) == (0, 0) and len(cycles) >= 6000
    assert np.all(np.diff(times) > 0.0)
    metrics = json.loads((system.run_folder / "metrics.json").read_text())
    assert metrics["setpoints"][0]["final_error_max"] < 1e-3
    for name in ("model.osim", "states.sto"):
        assert (system.run_folder / name).is_file() == (engine == "opensim")
