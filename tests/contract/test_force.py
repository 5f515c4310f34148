"""Force control on every backend: a force is held on a moving contact, a lost surface is sought, a release leads away.

In process, the contacts of the engine judge the force, not the estimate of the arm. An emulated control box does not
report its contacts; there the estimate judges.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from contract_robots import BACKENDS, PLANTS, Boxes, connected
from driven_robot import Robot
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped

import panda_description
from franka_sim.franka_hw_sim import FrankaHWSim

pytestmark = pytest.mark.alone

SRC = Path(__file__).parents[2] / "src"
WORLDS = SRC / "hric_experiments" / "worlds"
NAME = "force_controller"
FORCE, SPEED, APPROACH = 10.0, 0.05, 0.02
"""Desired force [N], speed along the surface and to it [m/s]."""
SETTLED = 2200
"""Cycles after which the force is judged."""


class Pressing:
    """Robot with a force controller over a workpiece.

    Attributes:
        force: force on the workpiece along z of each cycle [N].
        position: position of the end effector of each cycle, 3 floats [m].
    """

    def __init__(self, robot: Robot, in_process: bool, **changes: Any) -> None:
        self.robot, self._in_process = robot, in_process
        yaml_file = SRC / "hric_bringup" / "config" / "controllers.yaml"
        parameters = yaml.safe_load(yaml_file.read_text().replace("$(arg arm_id)", "panda"))[NAME]
        robot.load(NAME, **parameters | changes)
        robot.switch([NAME], [])
        self.force: list[float] = []
        self.position: list[list[float]] = []

    def run(self, seconds: float) -> None:
        """Run and record each cycle."""

        def cycle(time: float) -> None:
            state = self.robot.hw.robot_state
            self.position.append(list(state.O_T_EE[12:15]))
            if self._in_process:
                contacts = self.robot.hw.plant.contacts()
                assert all("workpiece" in f"{contact.body_a} {contact.body_b}" for contact in contacts)
                signs = [1.0 if contact.body_a.startswith("panda") else -1.0 for contact in contacts]
                normal = sum(
                    (s * c.force * np.array(c.normal) for s, c in zip(signs, contacts, strict=True)), np.zeros(3)
                )
                self.force.append(float(np.linalg.norm(normal)))
            else:
                self.force.append(-state.O_F_ext_hat_K[2])

        self.robot.run(seconds, cycle)
        assert self.robot.hw.error == ""

    def publish(self, z: float) -> None:
        """Publish a desired force along the z axis of the hand [N]."""
        message = WrenchStamped(wrench=Wrench(force=Vector3(0.0, 0.0, z)))
        self.robot.node.advertise(f"{NAME}/desired_force", WrenchStamped).publish(message)


@contextmanager
def pressing(backend: str, world: str, **changes: Any) -> Iterator[Pressing]:
    """Yield a robot of this backend with a workpiece under its hand."""
    path = str(WORLDS / f"workpiece_{world}.yaml")
    if backend not in PLANTS:
        boxes = Boxes("--world", path)
        with connected(backend, boxes) as robot:
            yield Pressing(robot, False, **changes)
        boxes.close()
        return
    own = {"real_time_factor": 0.0, "plant_type": PLANTS[backend], "plant": {"world": path}}
    arm = panda_description.load(arm_id="panda", inertials="barycentric")
    robot = Robot(FrankaHWSim(), {"robot": own, "robot_description": arm})
    try:
        yield Pressing(robot, True, **changes)
    finally:
        robot.close()


def cases() -> Iterator[Any]:
    for backend in BACKENDS:
        for world in ("flat", "round"):
            marks = (
                [] if backend in ("mujoco", "pybullet") or (backend, world) == ("panda", "flat") else [pytest.mark.slow]
            )
            yield pytest.param(backend, world, marks=marks, id=f"{backend}-{world}")


@pytest.mark.parametrize(("backend", "world"), list(cases()))
def test_a_force_is_held_while_the_end_effector_moves_along_a_surface(
    backend: str, world: str, figure: Callable[[str, float, str], None]
) -> None:
    with pressing(backend, world, stroke={"axis": "y", "length": 0.08, "speed": SPEED}) as run:
        run.run(7.0)
    force = np.array(run.force[SETTLED:])
    position = np.array(run.position[SETTLED:])
    speed = np.linalg.norm(np.gradient(position[:, :2], 1e-3, axis=0), axis=1)
    rms = float(np.sqrt(np.mean((force - FORCE) ** 2)))
    figure(f"force of 10 N, {backend}, {world}: rms error", rms, "N")
    figure(f"force of 10 N, {backend}, {world}: largest error", float(np.abs(force - FORCE).max()), "N")
    assert rms < 0.5
    assert float(np.median(speed)) == pytest.approx(SPEED, rel=0.05)
    assert np.ptp(position[:, 1]) > 0.07
    assert max(run.force) < 15.0


@pytest.fixture(params=["mujoco", "pybullet"])
def on_engine(request: pytest.FixtureRequest) -> Iterator[Pressing]:
    with pressing(request.param, "flat") as run:
        run.run(2.0)
        assert run.force[-1] == pytest.approx(FORCE, abs=0.5)
        yield run


def test_the_arm_does_not_shoot_when_the_surface_disappears(on_engine: Pressing) -> None:
    on_engine.robot.hw.plant.delete("workpiece")
    before = len(on_engine.position)
    on_engine.run(0.5)
    velocity = -np.gradient(np.array(on_engine.position[before:])[:, 2], 1e-3)
    assert velocity.max() < 2.0 * APPROACH
    assert velocity[-100:] == pytest.approx(np.full(100, APPROACH), rel=0.1)


def test_a_force_of_zero_releases_the_surface_and_another_force_presses_again(on_engine: Pressing) -> None:
    lowest = on_engine.position[-1][2]
    for _ in range(15):  # as by rostopic pub -r 10
        on_engine.publish(0.0)
        on_engine.run(0.1)
    assert on_engine.force[-1] == 0.0
    assert on_engine.position[-1][2] - lowest == pytest.approx(0.03, abs=2e-3)
    on_engine.publish(6.0)
    on_engine.run(3.0)
    assert on_engine.force[-1] == pytest.approx(6.0, abs=0.3)


@pytest.mark.parametrize("z", [40.0, 1.0, float("nan")])
def test_a_bad_force_is_refused_in_one_sentence_and_the_present_one_is_held(
    on_engine: Pressing, z: float, caplog: pytest.LogCaptureFixture
) -> None:
    on_engine.publish(z)
    on_engine.run(0.5)
    assert on_engine.force[-1] == pytest.approx(FORCE, abs=0.5)
    assert [record for record in caplog.records if "desired_force" in record.getMessage()]
