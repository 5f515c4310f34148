"""`Simulation`: an experiment in this process, run, reset and run again with the bits of a process of its own."""

import os
import random
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from hric_core.errors import HricError
from hric_run.simulation import Simulation

MIXED: list[tuple[str, dict[str, object]]] = [
    (name, {"duration": 0.4, "simulator": simulator, **changes})
    for simulator in ("pybullet", "mujoco")
    for name, changes in (
        ("pd_step", {}),
        ("pd_step", {"kp": 200, "kd": 20}),
        ("pd_step", {"friction": "identified", "rotor_inertia": 0.1}),
        ("pd_step", {"realism": "measured"}),
        ("pd_step", {"world": "package://pybullet_ros_control/worlds/table.yaml"}),
        ("thesis_step", {}),
        ("thesis_step", {"hw": "hric_control/RobotHWSim"}),
        ("marker_tracking", {"mocap.human.begin": 0.1}),
        ("marker_tracking", {"mode": "thesis"}),
        ("none", {}),
    )
]


def fresh(name: str, seed: int, overrides: dict[str, object], folder: Path) -> str:
    """Return state_sha256 of a run in a separate process, by the command `hric run`."""
    given = [f"{key}:={value}" for key, value in overrides.items()]
    command = ["rosrun", "hric_experiments", "run", name, *given, "--seed", str(seed), "--quiet", "--no-figures"]
    done = subprocess.run(
        [*command, "--runs", str(folder)], capture_output=True, text=True, timeout=120, check=True, env=os.environ
    )
    match = re.search(r"state_sha256: (\w+)", done.stdout)
    assert match is not None
    return match[1]


def test_a_run_gives_every_cycle_with_the_bits_of_a_process_of_its_own(tmp_path: Path) -> None:
    with Simulation("pd_step", duration=0.3, kp=200) as simulation:
        simulation.run()
    signals = simulation.signals
    assert signals.cycles == 300 and signals.position.shape == (300, 7) and not signals.gaps
    assert simulation.state_sha256 == fresh("pd_step", 0, {"duration": 0.3, "kp": 200}, tmp_path)


def test_a_run_in_parts_is_the_same_as_a_run_in_one() -> None:
    with Simulation("pd_step", duration=0.3) as simulation:
        simulation.run(0.1)
        assert simulation.signals.cycles == 100 and simulation.time == pytest.approx(0.1)
        simulation.run()
        in_parts = simulation.state_sha256
        simulation.reset()
        assert simulation.time == 0.0
        simulation.run()
        assert simulation.state_sha256 == in_parts


def test_a_reset_takes_another_seed_and_further_overrides() -> None:
    with Simulation("pd_step", duration=0.1, realism="measured") as simulation:
        hashes = []
        for seed in (1, 2, 1):
            simulation.reset(seed=seed)
            simulation.run()
            hashes.append(simulation.state_sha256)
        assert hashes[0] == hashes[2] != hashes[1]
        simulation.reset(kp=np.full(7, 80.0))
        simulation.run()
        assert simulation.state_sha256 != hashes[0] and simulation.definition.duration == 0.1


@pytest.mark.slow  # forty processes
def test_a_simulation_that_is_used_again_gives_the_bits_of_a_fresh_process_in_any_order(tmp_path: Path) -> None:
    wanted = [fresh(name, 3, overrides, tmp_path) for name, overrides in MIXED]
    numbers = random.Random(1).sample(range(len(MIXED)), len(MIXED))
    for number in numbers + numbers[::-1]:
        name, overrides = MIXED[number]
        with Simulation(name, seed=3, **overrides) as simulation:
            for _ in range(2):
                simulation.reset()
                simulation.run()
                assert simulation.state_sha256 == wanted[number], MIXED[number]


def test_the_robot_and_its_controllers_are_within_reach() -> None:
    heard = []
    with Simulation("pd_step", duration=0.2) as simulation:
        simulation.node.tap(lambda topic, message, time: heard.append(topic))
        simulation.run()
    assert {"/joint_states", "/franka_state_controller/franka_states"} <= set(heard)


def test_ctrl_c_ends_a_run_after_a_whole_cycle() -> None:
    with Simulation("pd_step", duration=600.0) as simulation:
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            simulation.run()
        assert 0 < simulation.signals.cycles == simulation.app.cycles < 600_000


def test_a_mistake_is_told_before_anything_runs() -> None:
    with pytest.raises(HricError, match="no override 'kpp'"):
        Simulation("pd_step", kpp=3)
    with pytest.raises(HricError, match=r"setpoint at .* is outside"):
        Simulation("pd_step", **{"setpoints.0.positions": [9, 0, 0, -2, 0, 2, 0]})


def modules_of(name: str, at_end: bool) -> set[str]:
    """Return the modules that a fresh process has loaded before a run of 20 ms, or those that the run adds to them."""
    program = (
        "import sys\nfrom hric_run.simulation import Simulation\n"
        f"with Simulation({name!r}, duration=0.02) as simulation:\n"
        "    before = set(sys.modules)\n    simulation.run()\n"
        f"    print(*(set(sys.modules) - before if {at_end} else before))"
    )
    return set(subprocess.check_output([sys.executable, "-c", program], text=True, timeout=120).split())


@pytest.mark.parametrize("name", ["pd_step", "marker_tracking", "hand_guidance"])
def test_the_loop_imports_nothing(name: str) -> None:
    """An import in a cycle would be a missed deadline."""
    assert modules_of(name, at_end=True) == set()


def test_a_simple_run_starts_without_slow_libraries() -> None:
    slow = {"scipy.optimize", "scipy.spatial", "matplotlib", "pyarrow", "pandas", "mocap_natnet", "hric_assessment"}
    assert modules_of("pd_step", at_end=False) & slow == set()
