"""UrHW with a controller of the workspace, through ur_rtde, on the emulated controller."""

import math
import os
import signal
from collections.abc import Callable, Iterator

import pytest
from std_msgs.msg import Float64MultiArray

import panda_description
from hric_control.hardware_interface import PositionJointInterface
from hric_control.robot_app import RobotApp
from hric_control.robot_hw import ControllerInfo
from hric_control.transmission import parse_transmissions
from hric_core.errors import HricError
from hric_core.local.node import LocalNode
from ur_robot.connection import UrLostError, UrStoppedError
from ur_robot.emulated.command import UR5E
from ur_robot.ur_hw import UrHW

pytest.importorskip("rtde_control", reason="scripts/setup --with ur")
pytestmark = pytest.mark.alone

STREAM = "joint_streaming_controller"


class Arm:
    """The robot on the emulated controller, with a streaming controller that is loaded."""

    def __init__(self, ip: str, **parameters: object) -> None:
        urdf = panda_description.load_file(UR5E)
        joints = [transmission.joint for transmission in parse_transmissions(urdf)]
        stream = {
            "type": "hric_controllers/JointStreamingController",
            "joints": joints,
            "velocity": 1.5,
            "acceleration": 7.0,
            "jerk": 500.0,
            "state_publish_rate": 100,
        }
        robot = {"robot_ip": ip, **parameters}
        self.node = LocalNode({"robot_description": urdf, "robot": robot, STREAM: stream})
        self.app = RobotApp(self.node, self.node.child("robot"), hw=UrHW())
        self.hw = self.app.hw
        self.app.manager.load(STREAM)
        self.topic = self.node.advertise(f"{STREAM}/command", Float64MultiArray)

    def stream(self, goal: list[float], duration: float) -> None:
        """Send the goal at 50 Hz while the robot runs."""
        sent = [-1.0]

        def send(time: float) -> None:
            if time > sent[0] + 0.02:
                sent[0] = time
                self.topic.publish(Float64MultiArray(data=goal))

        self.app.run(duration, send)


def at(moment: float, call: Callable[[], object]) -> Callable[[float], None]:
    """Return a hook that makes a call once, at a robot time [s]."""
    waiting = [call]

    def hook(time: float) -> None:
        if time > moment and waiting:
            waiting.pop()()

    return hook


@pytest.fixture
def arm(box) -> Iterator[Arm]:
    made = Arm(box.ip)
    yield made
    made.app.shutdown()


def test_a_controller_moves_the_arm_to_its_goal(arm) -> None:
    arm.app.run(0.1)
    goal = [q + 0.2 for q in arm.hw.states.position]
    arm.app.manager.switch([STREAM], [])
    arm.stream(goal, 3.0)
    assert arm.hw.states.position == pytest.approx(goal, abs=1e-3)
    assert arm.hw.limiter_counts().total == 0
    assert all(map(math.isnan, arm.hw.states.effort))


def test_joints_that_lose_their_controller_hold_the_last_command(arm) -> None:
    hw, group = arm.hw, arm.hw.get(PositionJointInterface).group()
    owner = ControllerInfo("owner", "", {PositionJointInterface.cpp_name: frozenset(hw.states.names)})
    start = list(hw.states.position)
    hw.do_switch([owner], [])

    def ramp(time: float, period: float, reset: bool) -> bool:
        if time < 0.5:
            group.set_command([q + 0.2 * time for q in start])
        elif hw.log_row()[0][0] == "position":
            hw.do_switch([], [owner])
        elif time > 1.5:
            hw.stop()
        return True

    hw.run(ramp)
    assert hw.states.position == pytest.approx([q + 0.1 for q in start], abs=2e-3)


def test_a_second_run_starts_where_the_arm_is(arm) -> None:
    arm.app.manager.switch([STREAM], [])
    goal = [q + 0.3 for q in arm.hw.states.position]
    arm.stream(goal, 0.3)
    arm.stream(goal, 2.0)
    assert arm.hw.states.position == pytest.approx(goal, abs=1e-3)


def test_a_protective_stop_ends_the_run_by_its_name(box, arm) -> None:
    import rtde_receive

    arm.app.run(0.1)

    def jump(time: float) -> None:
        arm.hw._moved = True
        arm.hw._commands.value[0] = 4.8

    with pytest.raises(UrStoppedError, match="the arm reports: protective stop, stopped for safety"):
        arm.app.run(2.0, jump)
    states = rtde_receive.RTDEReceiveInterface(box.ip)
    assert states.isProtectiveStopped()
    states.disconnect()
    with pytest.raises(UrStoppedError, match="protective stop"):
        Arm(box.ip)


def test_a_dead_controller_ends_the_run(box, arm) -> None:
    with pytest.raises(UrLostError, match="is lost: no"):
        arm.app.run(2.0, at(0.2, box.process.kill))


def test_a_frozen_controller_ends_the_run(box, arm) -> None:
    with pytest.raises(UrLostError, match=r"is lost: no new state for 0\.5 s"):
        arm.app.run(2.0, at(0.2, lambda: os.kill(box.process.pid, signal.SIGSTOP)))
    box.process.kill()


def test_a_run_on_a_controller_that_has_died_does_not_begin(box, arm) -> None:
    arm.app.run(0.1)
    box.process.kill()
    with pytest.raises(UrLostError, match="is lost: no new state"):
        arm.app.run(2.0)


def test_an_absent_controller_is_named_before_ur_rtde_waits_for_it() -> None:
    with pytest.raises(UrLostError, match=r"no UR controller at 127\.0\.0\.32: TCP port 30004: Connection refused"):
        Arm("127.0.0.32")


def test_a_robot_that_is_not_of_ur_is_refused() -> None:
    urdf = panda_description.load()
    with pytest.raises(HricError, match="7 joints with a transmission; an arm of UR has 6"):
        node = LocalNode({"robot_description": urdf, "robot": {"robot_ip": "127.0.0.32"}})
        RobotApp(node, node.child("robot"), hw=UrHW())


def test_joints_in_another_order_than_that_of_the_controller_are_refused() -> None:
    urdf = panda_description.load_file(UR5E)
    names = [transmission.joint for transmission in parse_transmissions(urdf)]
    first, second = (f'<joint name="{name}"><hardware' for name in names[:2])  # in the transmissions only
    swapped = urdf.replace(first, "first").replace(second, first).replace("first", second)
    node = LocalNode({"robot_description": swapped, "robot": {"robot_ip": "127.0.0.32"}})
    with pytest.raises(HricError, match=f"in the order {names[1]}, {names[0]}, .*; valid: .* {names[0]}, {names[1]}"):
        RobotApp(node, node.child("robot"), hw=UrHW())
