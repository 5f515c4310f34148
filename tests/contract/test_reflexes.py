"""Reflexes of every arm: each one stops the motion, and motions are refused until the recovery action.

The error, FrankaState and the log contain the name of the reflex in libfranka.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from contract_robots import Boxes
from driven_robot import INTERFACES, JOINTS, Robot

from franka_hw_interface.interfaces import FrankaVelocityCartesianInterface
from franka_hw_interface.robot_state import RobotMode, RobotState
from franka_msgs.msg import ErrorRecoveryGoal, FrankaState
from hric_control.controller import Controller
from hric_core.errors import HricError

PLAIN = {"enforce_limits": False, "rate_limiting": False, "cutoff_frequency": 1000.0}
"""Parameters without limits and filters, so that the arm receives unchanged commands."""
ARMS = ["pybullet", "panda", "fr3"]
BOXES = ARMS[1:]
ZERO = [0.0] * 7
LIMIT = 10.0
"""Largest time until any reflex [s of robot time]."""

Law = Callable[[int, RobotState], list[float]]
"""Function of the cycle since the start of the motion and the state that returns the command."""


class Course(Controller):
    """Controller that sends the commands of `law`, or zero while it is None."""

    def init(self, robot_hw: Any, root_node: Any, controller_node: Any) -> None:
        interface = controller_node.param("interface")
        self.law: Law | None = None
        self._state = robot_hw.robot_state
        if interface == "twist":
            self._size, self._command = 6, robot_hw.get(FrankaVelocityCartesianInterface).handle("panda_robot")
        else:
            self._size, self._command = 7, robot_hw.get(INTERFACES[interface]).group(list(JOINTS))
        self._hw = robot_hw

    def starting(self, time: float) -> None:
        self.cycles = 0

    def update(self, time: float, period: float) -> None:
        if self._hw.mode.commanded:
            self._command.set_command([0.0] * self._size if self.law is None else self.law(self.cycles, self._state))
            self.cycles += 1


def last_only(value: float, n: int = 7) -> list[float]:
    return [0.0] * (n - 1) + [value]


def turned(n: int, state: RobotState) -> list[float]:
    """Return torques that turn joint 7 at 2 rad/s, changing by less than 1 N m per millisecond."""
    wanted = 2.0 * (2.0 - state.dq[6])
    return last_only(min(max(wanted, state.tau_J_d[6] - 0.9), state.tau_J_d[6] + 0.9))


def late(n: int, state: RobotState) -> list[float]:
    if n == 50:
        time.sleep(2.0)  # the first command counts as lost after 0.5 s, each that follows after 50 ms more
    return ZERO


@dataclass(frozen=True)
class Case:
    """Motion that causes a reflex.

    Attributes:
        interface: hardware interface of the commands.
        law: function that returns the commands.
        names: errors in libfranka, at least one of which must be set.
        arms: arms on which the reflex can be caused.
    """

    interface: str
    law: Law
    names: tuple[str, ...]
    arms: tuple[str, ...] = tuple(ARMS)


CASES = {
    "torque jump": Case(
        "effort", lambda n, _: last_only(8.0 if n >= 20 else 0.0), ("controller_torque_discontinuity",)
    ),
    "joint too fast": Case("effort", lambda n, _: last_only(min(0.5 * n, 6.0)), ("joint_velocity_violation",)),
    "joint at its limit": Case("effort", turned, ("joint_position_limits_violation",)),
    "joint velocity jump": Case(
        "velocity", lambda n, _: last_only(0.5 if n >= 20 else 0.0), ("joint_motion_generator_velocity_discontinuity",)
    ),
    "Cartesian velocity jump": Case(
        "twist",
        lambda n, _: [0.0, 0.0, 0.5 if n >= 20 else 0.0, 0.0, 0.0, 0.0],
        ("cartesian_motion_generator_velocity_discontinuity",),
    ),
    "Cartesian acceleration jump": Case(
        "twist",
        lambda n, _: [0.0, 0.0, 0.0085 * max(n - 20, 0), 0.0, 0.0, 0.0],
        ("cartesian_motion_generator_acceleration_discontinuity",),
    ),
    "Cartesian velocity limit": Case(
        "twist", lambda n, _: last_only(0.005 * n, 6), ("cartesian_motion_generator_velocity_limits_violation",)
    ),
    "20 lost packets": Case("effort", late, ("communication_constraints_violation",), tuple(BOXES)),
    "collision": Case("effort", lambda n, _: ZERO, ("joint_reflex", "cartesian_reflex")),
}


QUICK = {"torque jump", "Cartesian velocity jump", "20 lost packets", "collision"}
"""Cases that are always tested on the FR3; the others are slow tests, as it differs from the Panda in numbers only."""


def cases() -> Iterator[Any]:
    """Yield pairs of case and arm for the test of all reflexes."""
    for name, case in CASES.items():
        for arm in case.arms:
            yield pytest.param(
                name, arm, marks=[pytest.mark.slow] if arm == "fr3" and name not in QUICK else [], id=f"{name}-{arm}"
            )


class Watched:
    """Robot with a `Course` controller, and the messages of the franka_state_controller."""

    def __init__(self, robot: Robot, interface: str) -> None:
        self.robot, self.states = robot, []  # type: Robot, list[FrankaState]
        robot.manager._classes["test/Course"] = Course
        robot.node.set_param("course", {"type": "test/Course", "interface": interface})
        states = {
            "type": "franka_control/FrankaStateController",
            "arm_id": "panda",
            "joint_names": list(JOINTS),
            "publish_rate": 100,
        }
        robot.node.set_param("franka_state_controller", states)
        robot.node.subscribe("franka_state_controller/franka_states", FrankaState, self.states.append)
        robot.manager.load("course")
        robot.manager.load("franka_state_controller")
        self.course: Course = robot.manager._loaded["course"].controller
        robot.switch(["course", "franka_state_controller"], [])

    def until_error(self, hook: Callable[[], None] = lambda: None) -> None:
        def watch(_: float) -> None:
            hook()
            if self.robot.hw.error:
                self.robot.hw.stop()

        self.robot.run(LIMIT, watch)

    def named(self) -> set[str]:
        """Return the names of the errors in the newest message."""
        errors = self.states[-1].current_errors
        return {name for name in errors.__slots__ if getattr(errors, name)}


@pytest.fixture
def watched(connect: Callable[..., Robot], boxes: Boxes, backend: str) -> Iterator[Callable[[str], Watched]]:
    yield lambda interface: Watched(connect(**PLAIN), interface)
    if backend in BOXES:
        boxes.order(backend, "reset")


def push(robot: Robot, boxes: Boxes, backend: str, seconds: float) -> None:
    """Push the wrist hard."""
    if backend in BOXES:
        boxes.order(backend, f"push {backend}_link7 0 0 -60 {seconds}")
    else:
        robot.hw.plant.apply_wrench("panda_link7", (0.0, 0.0, -60.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), seconds)


def user_stop(robot: Robot, boxes: Boxes, backend: str, on: bool) -> None:
    if backend in BOXES:
        boxes.order(backend, f"user_stop {'on' if on else 'off'}")
    else:
        robot.hw.box.set_user_stop(on)


def recover(robot: Robot) -> Any:
    return robot.node.send_goal("franka_control/error_recovery", ErrorRecoveryGoal())


@pytest.mark.parametrize(("case", "backend"), list(cases()))
def test_a_reflex_stops_is_named_everywhere_refuses_motion_and_is_recovered_from(
    case, backend, watched, boxes, caplog
) -> None:
    names = CASES[case].names
    arm: Watched = watched(CASES[case].interface)
    robot, hw, course = arm.robot, arm.robot.hw, arm.course
    robot.run(0.02)
    course.law, course.cycles = CASES[case].law, 0
    pushes = [lambda: push(robot, boxes, backend, 0.3)] if case == "collision" else []
    arm.until_error(lambda: pushes.pop()() if pushes and course.cycles > 50 else None)
    is_named(arm, names, hw.error, caplog.text)
    stands(robot, arm)
    robot.switch([], ["course"])
    with pytest.raises(HricError, match=r"error state.*error_recovery"):
        robot.manager.switch(["course"], [])
    goes_on_after_recovery(robot, arm)


def is_named(arm: Watched, names: tuple[str, ...], *texts: str) -> None:
    """Check that one of the names is in the texts and set in FrankaState."""
    arm.robot.run(0.1)
    for text in texts:
        assert any(name in text for name in names), text
    assert any(name in names for name in arm.named()), arm.named()
    assert arm.states[-1].robot_mode == FrankaState.ROBOT_MODE_REFLEX


@pytest.mark.parametrize("backend", ARMS)
def test_a_collision_that_is_there_when_the_motion_begins_is_named_too(backend, watched, boxes, caplog) -> None:
    # libfranka then says no more than "motion aborted by reflex!".
    arm: Watched = watched("effort")
    arm.robot.switch([], ["course"])
    arm.robot.run(0.02)
    push(arm.robot, boxes, backend, 2.0)
    arm.robot.run(0.3)
    arm.robot.switch(["course"], [])
    arm.until_error()
    is_named(arm, CASES["collision"].names, arm.robot.hw.error, caplog.text)


def stands(robot: Robot, arm: Watched) -> None:
    """Check that the arm comes to rest although its controller keeps sending commands."""
    robot.run(0.8)
    before = robot.positions
    robot.run(0.2)
    assert robot.positions == pytest.approx(before, abs=1e-3)
    assert max(map(abs, arm.states[-1].dq)) < 0.01


def goes_on_after_recovery(robot: Robot, arm: Watched) -> None:
    arm.course.law = None
    goal = recover(robot)
    assert (goal.status, goal.text) == ("SUCCEEDED", "")
    assert robot.hw.error == ""
    robot.switch(
        ["course"],
        ["course"] if "running" in {status.state for status in robot.manager.list() if status.name == "course"} else [],
    )
    robot.run(0.2)
    assert robot.hw.robot_state.robot_mode is RobotMode.MOVE
    assert arm.named() == set() and arm.states[-1].robot_mode == FrankaState.ROBOT_MODE_MOVE


@pytest.mark.parametrize("backend", ARMS)
def test_the_user_stop_stops_is_seen_everywhere_and_recovery_waits_for_its_release(
    backend, watched, boxes, caplog
) -> None:
    arm: Watched = watched("effort")
    robot, hw = arm.robot, arm.robot.hw
    robot.run(0.05)
    assert hw.robot_state.robot_mode is RobotMode.MOVE
    user_stop(robot, boxes, backend, True)
    arm.until_error()
    robot.run(0.1)
    assert arm.states[-1].robot_mode == FrankaState.ROBOT_MODE_USER_STOPPED
    assert "error state" in caplog.text and ("stop" in hw.error.lower() or "emergency" in hw.error.lower()), hw.error
    stands(robot, arm)
    robot.switch([], ["course"])
    with pytest.raises(HricError, match="error state"):
        robot.manager.switch(["course"], [])
    assert recover(robot).status == "ABORTED"
    user_stop(robot, boxes, backend, False)
    robot.run(LIMIT, lambda _: hw.stop() if hw.robot_state.robot_mode is not RobotMode.USER_STOPPED else None)
    goes_on_after_recovery(robot, arm)


@pytest.mark.parametrize("backend", ARMS)
@pytest.mark.parametrize("interface", ["effort", "velocity", "twist"])
def test_a_command_that_is_no_number_ends_its_controller_by_name_and_never_reaches_the_arm(
    backend, interface, watched, caplog
) -> None:
    arm: Watched = watched(interface)
    robot, hw = arm.robot, arm.robot.hw
    robot.run(0.05)
    before = robot.positions
    arm.course.law = lambda n, _: last_only(float("nan"), 6 if interface == "twist" else 7)
    robot.run(0.2)
    assert {status.name: status.state for status in robot.manager.list()}["course"] == "aborted"
    assert "course" in caplog.text and "finite" in caplog.text
    assert hw.error == "" and robot.positions == pytest.approx(before, abs=1e-3)
