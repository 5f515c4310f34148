"""Bad streams of targets on every backend: no reflex, limits kept, the last target reached."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import genpy
import numpy as np
import pytest
import yaml
from contract_robots import BACKENDS, Boxes, connected
from driven_robot import Robot
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from franka_hw_interface.limits import FrankaLimits, fr3_limits, franka_limits
from hric_core.geometry import Pose, quaternions, stamped

pytestmark = pytest.mark.alone

YAML = Path(__file__).parents[2] / "src" / "hric_bringup" / "config" / "controllers.yaml"
JOINT, CARTESIAN = "joint_streaming_controller", "cartesian_streaming_controller"
LOST, JITTER, TWICE = 0.3, 0.02, 0.1
"""Shares of lost and doubled targets, and largest delay of a target [s]."""


class Streamed:
    """Run of a robot that follows a stream.

    Attributes:
        error: error of the robot; empty without an error.
        desired: desired joint positions of each cycle, shape (n, 7) [rad].
        last: difference from the last target at the end, largest axis [rad or m].
        rms: error against the ideal motion, less the lag, of the first joint or of y [rad or m].
        lag: lag behind the ideal motion [s].
    """

    def __init__(self, robot: Robot, controller: str, rate: float, seconds: float) -> None:
        self._robot, self._controller = robot, controller
        parameters = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[controller]
        robot.load(controller, **parameters)
        robot.switch([controller], [])
        robot.run(0.05)
        state = robot.hw.robot_state
        self._q, self._pose = list(state.q_d), Pose.of_column_major(state.O_T_EE_c)
        random = np.random.default_rng(0)
        kept = [k / rate for k in range(1, int(seconds * rate)) if random.random() >= LOST]
        kept += [stamp for stamp in kept if random.random() < TWICE]
        waiting = sorted((stamp + JITTER * random.random(), stamp) for stamp in kept)
        topic, kind = ("trajectory", JointTrajectory) if controller == JOINT else ("command", PoseStamped)
        publisher = robot.node.advertise(f"{controller}/{topic}", kind)
        begun: list[float] = []
        rows: list[tuple[float, list[float], list[float]]] = []

        def cycle(time: float) -> None:
            begun[:] = begun or [time]
            while waiting and waiting[0][0] <= time - begun[0]:
                publisher.publish(self._message(waiting.pop(0)[1]))
            rows.append((time - begun[0], list(robot.hw.robot_state.q_d), list(robot.hw.robot_state.O_T_EE_c[12:15])))

        robot.run(seconds + 1.5, cycle)
        self.error = robot.hw.error
        times, joints, positions = (np.array(column) for column in zip(*rows, strict=True))
        self.desired = joints
        seen = joints[:, 0] - self._q[0] if controller == JOINT else positions[:, 1] - self._pose.position[1]
        self.last = abs(float(seen[-1]) - self.offset(max(kept)))
        steady = (times > 1.0) & (times < max(kept))
        errors = [
            float(
                np.sqrt(
                    np.mean([(s - self.offset(t - lag)) ** 2 for t, s in zip(times[steady], seen[steady], strict=True)])
                )
            )
            for lag in np.arange(0.0, 0.4, 0.01)
        ]
        self.lag, self.rms = 0.01 * int(np.argmin(errors)), min(errors)

    def offset(self, time: float) -> float:
        """Return the displacement of the first joint [rad] or along y [m] at a time of the stream [s]."""
        share = min(1.0, time) * math.sin(2.0 * math.pi * 0.3 * time)
        return (0.25 if self._controller == JOINT else 0.08) * share

    def _message(self, stamp: float) -> Any:
        """Return the target of an instant of the stream [s]."""
        header, offset = Header(stamp=genpy.Time.from_sec(1000.0 + stamp)), self.offset(stamp)
        if self._controller == JOINT:
            names = [f"panda_joint{number}" for number in range(1, 8)]
            point = JointTrajectoryPoint(positions=[self._q[0] + offset, *self._q[1:]])
            return JointTrajectory(header=header, joint_names=names, points=[point])
        x, y, z = self._pose.position
        return stamped.pose_stamped(header, Pose((x, y + offset, z), self._pose.orientation))


def rates(joints: np.ndarray) -> list[float]:
    """Return the largest velocity, acceleration and jerk of positions of each millisecond."""
    return [float(np.abs(np.diff(joints, order, axis=0)).max()) * 1e3**order for order in (1, 2, 3)]


def cases() -> Iterator[Any]:
    """Yield controller, backend, rate [Hz] and seconds; a minute through each box at every rate is slow."""
    for controller in (JOINT, CARTESIAN):
        for backend in BACKENDS:
            marks = [pytest.mark.slow] if backend == "fr3" else []
            yield pytest.param(controller, backend, 20.0, 4.0, marks=marks, id=f"{controller}-{backend}")
        for backend in ("panda", "fr3"):
            for rate in (10.0, 20.0, 50.0):
                name = f"{controller}-{backend}-{rate:g}Hz-minute"
                yield pytest.param(controller, backend, rate, 60.0, marks=pytest.mark.slow, id=name)


@pytest.mark.parametrize(("controller", "backend", "rate", "seconds"), list(cases()))
def test_a_bad_stream_is_followed_without_a_reflex_and_within_the_limits(
    controller: str,
    connect: Callable[..., Robot],
    backend: str,
    rate: float,
    seconds: float,
    figure: Callable[[str, float, str], None],
) -> None:
    run = Streamed(connect(), controller, rate, seconds)
    for name, value, unit in (("lag", 1e3 * run.lag, "ms"), ("rms", 1e3 * run.rms, "mrad or mm")):
        figure(f"{controller}, {backend}, {rate:g} Hz, 30 % lost, {seconds:g} s: {name}", value, unit)
    assert run.error == ""
    assert run.last <= 1e-3
    assert run.lag <= 2.0 / rate + 0.08 and run.rms <= (0.02 if controller == JOINT else 0.01)
    if controller == JOINT:
        rounding = float(8.0 * np.spacing(np.float32(0.25)) / 2.0) if backend == "fr3" else 0.0  # of its 32-bit state
        largest = 1.01 * np.array([1.5, 7.0, 500.0]) + rounding * np.array([0.0, 0.5e6, 1e9])
        assert np.all(rates(run.desired) <= largest)


def test_a_hand_on_the_topic_of_the_leader_is_no_target(caplog: pytest.LogCaptureFixture) -> None:
    with connected("mujoco", None) as robot:
        settings = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[JOINT]
        robot.load(JOINT, **settings, leader="left/joint_states")
        robot.switch([JOINT], [])
        robot.run(0.05)
        publisher = robot.node.advertise(robot.node.beside("left/joint_states"), JointState)
        arm, hand = [f"left_joint{k}" for k in range(1, 8)], [f"left_finger_joint{k}" for k in (1, 2)]
        goal = [q + 0.1 for q in robot.hw.robot_state.q_d]

        def cycle(time: float) -> None:
            stamp = Header(stamp=genpy.Time.from_sec(time))
            publisher.publish(JointState(header=stamp, name=arm + hand, position=[*goal, 0.04, 0.04]))
            publisher.publish(JointState(header=stamp, name=hand, position=[0.04, 0.04]))

        robot.run(2.0, cycle)
        np.testing.assert_allclose(robot.hw.robot_state.q_d, goal, atol=1e-4)
    assert [record.getMessage() for record in caplog.records if "leader" in record.getMessage()] == []


def outstretched(time: float) -> tuple[list[float], list[float]]:
    """Return the displacement [m] and rotation [rad] of a path of 8 s, out of reach and back."""
    return [0.22 * (1.0 - math.cos(math.pi * time / 4.0)), 0.1 * math.sin(math.pi * time / 4.0), 0.0], [0.0] * 3


def base_axis(time: float) -> tuple[list[float], list[float]]:
    """Return a path past the axis of joint 1 at 10 mm to the other side, and back."""
    return [-0.18 * (1.0 - math.cos(math.pi * time / 4.0)), 0.01, 0.0], [0.0] * 3


def behind(time: float) -> tuple[list[float], list[float]]:
    """Return a path behind the base, and back."""
    return [-0.45 * (1.0 - math.cos(math.pi * time / 4.0)), 0.02, -0.1], [0.0] * 3


def tumbling(time: float) -> tuple[list[float], list[float]]:
    """Return a path with an orientation that turns by more than the wrist can."""
    turn = 0.5 * (1.0 - math.cos(math.pi * time / 4.0))
    return [0.1 * turn, 0.0, 0.0], [1.0 * turn, 2.2 * math.sin(math.pi * time / 4.0), 0.0]


PATHS = {path.__name__: path for path in (outstretched, base_axis, behind, tumbling)}


def path_cases() -> Iterator[Any]:
    """Yield path and backend; through the FR3, only the two singular paths by default."""
    for name in PATHS:
        for backend in BACKENDS:
            fast = backend != "fr3" or name in ("outstretched", "base_axis")
            yield pytest.param(name, backend, marks=[] if fast else [pytest.mark.slow], id=f"{name}-{backend}")


@pytest.mark.parametrize(("path", "backend"), list(path_cases()))
def test_a_path_that_the_joints_cannot_follow_slows_the_arm_down_without_a_reflex(
    connect: Callable[..., Robot], path: str, backend: str, figure: Callable[[str, float, str], None]
) -> None:
    joints = _driven(connect(), path)
    _within(np.array(joints), fr3_limits() if backend == "fr3" else franka_limits(), backend == "fr3")
    figure(f"{path}, {backend}: largest share of a joint's velocity limit", 100.0 * _fastest(joints, backend), "%")


def test_lost_packets_near_a_singular_pose_cause_no_reflex() -> None:
    boxes = Boxes("--no-collision", "--loss", "0.005", "--seed", "1")
    try:
        with connected("panda", boxes) as robot:
            _driven(robot, "outstretched")
            assert robot.hw.lost_states > 10
    finally:
        boxes.close()


def _driven(robot: Robot, path: str) -> list[list[float]]:
    """Send a path at 20 Hz, assert its end without an error; return the desired joints of each cycle [rad]."""
    name = CARTESIAN
    settings = yaml.safe_load(YAML.read_text().replace("$(arg arm_id)", "panda"))[name]
    robot.load(name, **{**settings, "workspace": {"lower": [-2.0] * 3, "upper": [2.0] * 3}})
    robot.switch([name], [])
    robot.run(0.05)
    start = Pose.of_column_major(robot.hw.robot_state.O_T_EE_c)
    publisher = robot.node.advertise(f"{name}/command", PoseStamped)
    joints: list[list[float]] = []
    begun: list[float] = []
    sent: list[float] = []

    def cycle(time: float) -> None:
        begun[:] = begun or [time]
        stamp = 0.05 * len(sent)
        if stamp <= min(8.0, time - begun[0]):
            sent.append(stamp)
            offset, rotation = PATHS[path](stamp)
            x, y, z = np.add(start.position, offset).tolist()
            turned = quaternions.product(quaternions.from_rotation_vector(rotation), start.orientation)
            header = Header(stamp=genpy.Time.from_sec(1000.0 + stamp))
            publisher.publish(stamped.pose_stamped(header, Pose((x, y, z), turned)))
        joints.append(list(robot.hw.robot_state.q_d))

    robot.run(10.0, cycle)
    assert robot.hw.error == ""
    if path == "behind":  # the arm may stop where the way back leads through itself
        return joints
    end, goal = Pose.of_column_major(robot.hw.robot_state.O_T_EE_c), np.add(start.position, PATHS[path](8.0)[0])
    assert math.dist(end.position, goal) <= 1e-3
    assert math.hypot(*quaternions.difference(end.orientation, start.orientation)) <= 5e-3
    return joints


def _fastest(joints: list[list[float]], backend: str) -> float:
    limits = fr3_limits() if backend == "fr3" else franka_limits()
    return float((np.abs(np.diff(joints, axis=0)).max(axis=0) * 1e3 / limits.velocity).max())


def _within(joints: np.ndarray, limits: FrankaLimits, single_precision: bool) -> None:
    """Assert that a desired motion of each millisecond is within the limits of position, velocity, acceleration."""
    rounding = float(8.0 * np.spacing(np.float32(2.0)) / 2.0) if single_precision else 0.0
    assert np.all(joints >= limits.lower) and np.all(joints <= limits.upper)
    velocities, accelerations = (np.abs(np.diff(joints, order, axis=0)).max(axis=0) for order in (1, 2))
    assert np.all(velocities * 1e3 <= limits.velocity)
    assert np.all(accelerations * 1e6 <= np.array(limits.acceleration) + rounding * 1e6)
