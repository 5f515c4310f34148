"""One bring-up, two engines: nothing above the plant can tell which one it is."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
from bags import control_log, gaps_and_repeats, topics
from live_system import LiveSystem

Start = Callable[..., LiveSystem]
OPENSIM_ONLY = {"/sim/joint_reactions"}


def services(system: LiveSystem) -> set[str]:
    """Services that the bring-up's robot offers; nodes whose names are random, such as rostopic's, come and go."""
    listed = system.run("rosservice", "list").stdout.split()
    return {name for name in listed if "anonymous" not in name and not name.startswith(("/rostopic", "/rosservice", "/play_", "/record_"))}


def test_pd_step_runs_on_opensim_with_the_topics_and_services_of_pybullet(start: Start) -> None:
    offered, heard = {}, {}
    for simulator in ("pybullet", "opensim"):
        system = start("env:=sim", f"simulator:={simulator}", "rviz:=false", "experiment:=pd_step")
        system.wait_output("set points")
        offered[simulator] = services(system)
        assert system.wait(timeout=150.0) == 0, system.output
        assert system.processes() == {}
        heard[simulator] = topics(next(system.run_folder.glob("*.bag")))
    assert offered["opensim"] == offered["pybullet"]
    assert heard["opensim"] - OPENSIM_ONLY == heard["pybullet"]
    cycles, times = control_log(next(system.run_folder.glob("*.bag")))
    assert gaps_and_repeats(cycles) == (0, 0) and len(cycles) >= 6000
    assert np.all(np.diff(times) > 0.0)
    metrics = json.loads((system.run_folder / "metrics.json").read_text())
    assert metrics["setpoints"][0]["final_error_max"] < 1e-3
    assert (system.run_folder / "model.osim").is_file() and (system.run_folder / "states.sto").is_file()
