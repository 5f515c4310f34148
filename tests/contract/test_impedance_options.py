"""Options of the Cartesian impedance controller and the wrench of the arm as a sensor, on every backend."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from contract_robots import PLANTS, Boxes
from driven_robot import Robot
from geometry_msgs.msg import PoseStamped, WrenchStamped

import panda_description
from franka_hw_interface.interfaces import FrankaModelInterface
from franka_hw_interface.model import FrankaFrame
from hric_control.hardware_interface import ForceTorqueSensorInterface
from hric_core.geometry import Pose, stamped

pytestmark = pytest.mark.alone

YAML = Path(__file__).parents[2] / "src" / "hric_bringup" / "config" / "controllers.yaml"
NAME = "cartesian_impedance_controller"
INITIAL = 0.3
"""Energy of the tank at the start [J]."""
SETTLED = 38
"""Cycle at which torques are judged, 18 ms after a step: rate limit and filter have settled, the arm hardly moves."""
UNDAMPED = {"translational_damping_ratio": 0.0, "rotational_damping_ratio": 0.0}


class Bench:
    """Robot with the controller, which runs once and does `actions[cycle]` before that cycle.

    Attributes:
        torque, position, energy: command [N m], end effector [m] and kinetic energy of the arm [J] of each cycle.
    """

    def __init__(self, robot: Robot, **changes: Any) -> None:
        self.robot = robot
        parameters = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[NAME]
        robot.load(NAME, **parameters | changes)
        robot.switch([NAME], [])
        self.torque: list[list[float]] = []
        self.position: list[list[float]] = []
        self.q: list[list[float]] = []
        self.energy: list[float] = []
        self.levels: list[float] = []
        robot.node.tap(lambda topic, message, _: topic.endswith("tank_energy") and self.levels.append(message.data))
        self.model = robot.hw.get(FrankaModelInterface).handle("panda_model")

    def run(self, seconds: float, actions: dict[int, Callable[[], None]]) -> None:
        """Run and record."""

        def cycle(_: float) -> None:
            state = self.robot.hw.robot_state
            actions.get(len(self.torque), lambda: None)()
            self.torque.append(list(state.tau_J_d))
            self.position.append(list(state.O_T_EE[12:15]))
            self.q.append(list(state.q))
            dq = np.array(state.dq)
            self.energy.append(0.5 * float(dq @ self.model.mass() @ dq))

        self.robot.run(seconds, cycle)
        assert self.robot.hw.error == ""

    def move(self, *offset: float) -> None:
        """Publish an equilibrium pose at this distance from the present pose [m]."""
        pose = Pose.of_column_major(self.robot.hw.robot_state.O_T_EE)
        x, y, z = (a + b for a, b in zip(pose.position, offset, strict=True))
        message = stamped.pose_stamped(stamped.header(self.robot.node.now(), ""), Pose((x, y, z), pose.orientation))
        self.robot.node.advertise(f"{NAME}/equilibrium_pose", PoseStamped).publish(message)

    def wrench(self, *values: float) -> None:
        """Publish a feed-forward wrench in axes of the base."""
        message = stamped.wrench_stamped(stamped.header(self.robot.node.now(), "panda_link0"), values)
        self.robot.node.advertise(f"{NAME}/feedforward_wrench", WrenchStamped).publish(message)

    def damp(self) -> None:
        """Set the damping ratios to 1."""
        self.robot.node.set_live(f"/{NAME}", dict.fromkeys(UNDAMPED, 1.0))

    def torque_of(self, wrench: list[float]) -> np.ndarray:
        """Return the torques of a wrench at the end effector [N m]."""
        jacobian: np.ndarray = self.model.zero_jacobian(FrankaFrame.END_EFFECTOR)
        return jacobian.T @ np.array(wrench)


def test_a_bounded_error_bounds_the_force(connect: Callable[..., Robot]) -> None:
    bench = Bench(connect(), error_limit={"translation": 0.02}, filter_time=0.0, **UNDAMPED)
    expected: list[np.ndarray] = []
    bench.run(
        1.0,
        {
            20: lambda: bench.move(0.1, 0.0, 0.0),
            SETTLED: lambda: expected.append(bench.torque_of([4.0, 0.0, 0.0, 0.0, 0.0, 0.0])),
            SETTLED + 1: bench.damp,
        },
    )
    np.testing.assert_allclose(bench.torque[SETTLED], expected[0], atol=0.2)  # 200 N/m * 0.02 m, and not 20 N


def test_a_wrench_is_added_and_ends_when_its_topic_is_silent(connect: Callable[..., Robot]) -> None:
    bench = Bench(connect(), feedforward={"timeout": 0.05}, **UNDAMPED)
    expected: list[np.ndarray] = []
    bench.run(
        2.0,
        {
            20: lambda: bench.wrench(3.0, 0.0, 4.0, 0.0, 0.2, 0.0),
            SETTLED: lambda: expected.append(bench.torque_of([3.0, 0.0, 4.0, 0.0, 0.2, 0.0])),
            SETTLED + 1: bench.damp,
        },
    )
    np.testing.assert_allclose(bench.torque[SETTLED], expected[0], atol=0.2)
    assert np.abs(bench.torque[-1]).max() < 0.1


def test_the_tank_bounds_the_energy_of_a_jump_of_the_equilibrium(
    connect: Callable[..., Robot], backend: str, figure: Callable[[str, float, str], None]
) -> None:
    bench = Bench(connect(), energy_tank={"initial": INITIAL, "largest": 2.0}, filter_time=0.0)
    bench.run(8.0, {20: lambda: bench.move(0.12, 0.0, 0.0)})  # 1.44 J at 200 N/m
    figure(f"energy tank of {INITIAL} J, {backend}: largest kinetic energy of the arm", max(bench.energy), "J")
    assert 0.3 * INITIAL < max(bench.energy) < INITIAL
    assert bench.position[-1][0] - bench.position[0][0] == pytest.approx(0.12, abs=3e-3)
    assert 0.0 <= min(bench.levels) < 0.1 * INITIAL and bench.levels[-1] <= 1.1 * INITIAL


def test_the_wrench_of_the_arm_is_a_force_torque_sensor(
    connect: Callable[..., Robot], backend: str, boxes: Boxes
) -> None:
    bench = Bench(connect())
    interface = bench.robot.hw.get(ForceTorqueSensorInterface)
    assert interface.names == ("panda_K",) and not interface.claims
    sensor, felt = interface.handle("panda_K"), []
    bench.robot.load("ft", type="force_torque_sensor_controller/ForceTorqueSensorController", publish_rate=100.0)
    bench.robot.switch(["ft"], [])
    bench.robot.node.tap(lambda topic, message, _: topic == "/panda_K" and felt.append(message))

    def push() -> None:
        if backend in PLANTS:
            still = (0.0, 0.0, 0.0)
            bench.robot.hw.plant.apply_wrench("panda_link7", (10.0, 0.0, 0.0), still, still, 2.0)
        else:
            boxes.order(backend, f"push {backend}_link7 10 0 0 2")

    turns: list[np.ndarray] = []
    bench.run(
        3.5, {20: push, 1500: lambda: turns.append(bench.model.pose(FrankaFrame.STIFFNESS)[:3, :3] @ sensor.force)}
    )
    np.testing.assert_allclose(turns[0], [-10.0, 0.0, 0.0], atol=1.5)  # the arm on its environment
    middle = felt[len(felt) * 3 // 7]
    force = middle.wrench.force
    assert middle.header.frame_id == "panda_K"
    assert np.linalg.norm([force.x, force.y, force.z]) == pytest.approx(10.0, abs=1.5)


def test_a_joint_stays_away_from_the_end_of_its_range(connect: Callable[..., Robot], backend: str) -> None:
    limit = list(panda_description.joint_limits(limits="fr3" if backend == "fr3" else "panda").values())[5]
    repulsion = {"margin": 0.6, "torque": 20.0}
    bench = Bench(connect(), joint_repulsion=repulsion, filter_time=1.0, largest_step=1.0, nullspace_stiffness=0.0)
    goal = (0.007, 0.0, 0.787)  # without the repulsion, joint 6 comes within 0.3 rad of its end

    def pull() -> None:
        bench.move(*(a - b for a, b in zip(goal, bench.robot.hw.robot_state.O_T_EE[12:15], strict=True)))

    bench.run(6.0, {20: pull})
    room = np.array([min(q[5] - limit.lower, limit.upper - q[5]) for q in bench.q])
    assert room.min() > 0.4
    assert room[-1] < 0.6
