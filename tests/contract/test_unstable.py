"""Stability verdict on every backend: an unstable control loop is never a success.

A loop with half of the largest stable gains is never reported as unstable.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from contract_robots import BACKENDS, PLANTS
from fci_peer import control_box, log_of

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from hric_bags import reader as bag_reader
from hric_bags.run_folder import RunFolder
from hric_controllers.dynamics import largest_kd
from hric_core.errors import HricError
from hric_report import headless
from hric_run.definition import experiment

START = (0.0, 0.0, 0.0, -0.08, 0.0, 0.0, 0.0)
SET_POINT = (0.0, -np.pi / 4, 0.0, -3.0 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
"""Set point of pd_step [rad]."""
FAR_BEYOND = ("rotor_inertia:=0", "kp:=200", "kd:=100", "limits:=false", "rotatum_limit:=0", "duration:=1")
"""Arguments for an unstable loop: Kd is 100 N m s/rad without rotor inertia, but joint 7 is stable up to 11 only."""


def outcome(folder: Path, name: str, *arguments: str) -> str:
    """Run an experiment; return "diverged" or the stability verdict, after checking that the bag is complete."""
    try:
        run = headless.run(experiment.load(name, arguments), arguments, root=folder, progress=False, figures=False)
        verdict = run.metrics["stability"]["verdict"]
    except HricError as error:
        assert "diverged at" in str(error) and "joint" in str(error) and "\n" not in str(error), error
        verdict = "diverged"
    left = RunFolder.open("latest", folder)
    assert left.read()["status"] == ("failed" if verdict == "diverged" else "completed")
    assert bag_reader.read(left.bag_path).log.cycles > 0
    return str(verdict)


@contextmanager
def emulated_box(robot: str) -> Iterator[tuple[tuple[str, ...], object]]:
    """Yield the arguments for an experiment through libfranka with an emulated control box, and its process."""
    words = (
        "--robot",
        robot,
        "--no-hand",
        "--no-collision",
        "--real-time-factor",
        "0",
        "--console",
        "--q-start",
        *map(str, START),
    )
    with control_box(*words) as (address, process):
        own = {
            "robot_ip": address,
            "robot": robot,
            "realtime_priority": 0,
            "lock_memory": False,
            "rate_limiting": False,
            "cutoff_frequency": 1000,
        }
        yield (
            (
                "hw:=franka_real/FrankaHW",
                *(f"robot.parameters.{key}:={str(value).lower()}" for key, value in own.items()),
            ),
            process,
        )


def half_of_the_bound(rotor_inertia: float) -> str:
    """Return half of the largest stable derivative gain of each joint during pd_step, as text [N m s/rad]."""
    model = KdlFrankaModel(panda_description.load(hand=False, meshes=False), "panda")
    bounds = []
    for part in np.linspace(0.0, 1.0, 11):
        mass = np.array(model.mass((1.0 - part) * np.array(START) + part * np.array(SET_POINT))).reshape(7, 7)
        bounds.append(largest_kd(mass, [rotor_inertia] * 7, 1e-3))
    return str([round(0.5 * float(value), 3) for value in np.min(bounds, axis=0)]).replace(" ", "")


@pytest.mark.parametrize("engine", PLANTS)
def test_a_loop_far_beyond_its_bound_has_diverged_or_is_called_unstable(engine: str, tmp_path: Path) -> None:
    assert (
        outcome(tmp_path, "thesis_step", *FAR_BEYOND, f"simulator:={engine}")
        == {"pybullet": "diverged", "mujoco": "diverged", "opensim": "unstable"}[engine]
    )


@pytest.mark.parametrize("robot", [name for name in BACKENDS if name not in PLANTS])
def test_a_plant_that_diverges_behind_the_box_ends_the_motion_in_one_line_and_the_run_is_called_unstable(
    robot: str, tmp_path: Path
) -> None:
    ended = threading.Event()
    with emulated_box(robot) as (arguments, process):

        def push() -> None:
            while not ended.wait(0.02):  # at rest the box forgets it: one of them comes during the motion
                process.stdin.write(f"push {robot}_link7 0 0 1e7 0.01\n")
                process.stdin.flush()

        thread = threading.Thread(target=push)
        thread.start()
        try:
            assert outcome(tmp_path, "pd_step", *arguments, "duration:=2") == "unstable"
        finally:
            ended.set()
            thread.join()
        said = log_of(process)
    assert "instability_detected" in RunFolder.open("latest", tmp_path).read()["arm_error"]
    told = [line for line in said.splitlines() if "diverged" in line]
    assert told and all("the simulation diverged at" in line and "rad/s, beyond" in line for line in told)
    assert "Traceback" not in said


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_loop_at_half_its_bound_is_stable(backend: str, tmp_path: Path) -> None:
    gains = ("kp:=100", f"kd:={half_of_the_bound(0.1)}", "duration:=1")
    if backend in PLANTS:
        assert outcome(tmp_path, "pd_step", *gains, f"simulator:={backend}") == "stable"
    else:
        with emulated_box(backend) as (arguments, _):
            assert outcome(tmp_path, "pd_step", *arguments, *gains) == "stable"


@pytest.mark.parametrize("engine", PLANTS)
def test_without_rotors_and_limits_half_the_bound_is_stable_too(engine: str, tmp_path: Path) -> None:
    hw = ("hw:=pybullet_ros_control/RobotHWSim", "controllers:=[joint_state_controller, joint_pd_controller]")
    raw = (*hw, "gravity:=true", "limits:=false", "rotatum_limit:=0", "rotor_inertia:=0")
    gains = ("kp:=20", f"kd:={half_of_the_bound(0.0)}", "duration:=1")
    assert outcome(tmp_path, "pd_step", *raw, *gains, f"simulator:={engine}") == "stable"
