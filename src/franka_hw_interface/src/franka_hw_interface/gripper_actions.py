"""ROS actions, joint states and parameters of franka_ros's franka_gripper, for an emulated or a real hand."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from sensor_msgs.msg import JointState

from control_msgs.msg import GripperCommandAction, GripperCommandResult
from franka_gripper.msg import (
    GraspAction,
    GraspResult,
    HomingAction,
    HomingResult,
    MoveAction,
    MoveResult,
    StopAction,
    StopResult,
)
from franka_hw_interface.arm_parameters import ARM_ID
from franka_hw_interface.hand import FrankaHand, HandMotion, HandOutcome
from hric_core.node import GoalHandle, Node, Registration
from hric_core.parameters import Settings, names, number, text

SAME_WIDTH = 1e-4
"""Maximum distance between opening and request at which gripper_action succeeds at once [m] (franka_gripper 0.10.1)."""


@dataclass(frozen=True)
class GripperSettings(Settings):
    """Parameters of the gripper's node, with the names and defaults of franka_ros's franka_gripper 0.10.1."""

    arm_id: str = ARM_ID
    joint_names: tuple[str, ...] | None = names(
        2, None, default_text="`[<arm_id>_finger_joint1, <arm_id>_finger_joint2]`", text="of the two fingers"
    )
    publish_rate: float = number(30.0, above=0.0, unit="Hz", text="of the joint states")
    robot_joint_states: str = text(
        "",
        valid="a topic, or an empty text",
        text="topic that gets the fingers' joint states as well, beside the gripper's namespace, or absolute; "
        "`bringup.launch` gives the robot's `joint_states`, where they come in messages of their own",
    )
    default_speed: float = number(0.1, above=0.0, unit="m/s", text="of `gripper_action`")
    epsilon_inner: float = number(
        0.005, minimum=0.0, unit="m", name="default_grasp_epsilon/inner", text="of `gripper_action`: how much narrower"
    )
    epsilon_outer: float = number(
        0.005, minimum=0.0, unit="m", name="default_grasp_epsilon/outer", text="of `gripper_action`: how much wider"
    )

    @property
    def fingers(self) -> list[str]:
        """Names of the finger joints."""
        return list(self.joint_names or (f"{self.arm_id}_finger_joint{i}" for i in (1, 2)))


@dataclass
class _Kind:
    """Action types of one gripper action, and the function that passes its goal to the hand."""

    action: type
    result: Callable[..., Any]
    begin: Callable[[Any], HandMotion]


@dataclass
class _Running:
    """Goal of a gripper action that is being executed.

    Attributes:
        preempted: reason if a client cancelled or replaced the goal; otherwise empty.
    """

    name: str
    goal: GoalHandle
    motion: HandMotion
    preempted: str = field(default="")


class GripperActions:
    """ROS actions `homing`, `move`, `grasp`, `stop`, `gripper_action` and topic `joint_states` of a Franka hand.

    Goals and cancel requests are processed in `update`, on one thread. A goal ends as in franka_ros: if it is executed
    without success, it succeeds with `success: false`; if the hand refuses it, or the action `stop` ends it, it is
    aborted; if it is cancelled, or replaced by a goal of any action, it is preempted. A cancel request stops the
    fingers.

    Args:
        node: namespace of the gripper.
        hand: hand that executes the goals; used by `update` alone.
        settings: parameters of the node.
    """

    def __init__(self, node: Node, hand: FrankaHand, settings: GripperSettings) -> None:
        self._node, self._hand, self._settings = node, hand, settings
        self._inbox: deque[Callable[[], None]] = deque()
        self._running: list[_Running] = []
        self._next_publish = float("-inf")
        topics = ["joint_states"]
        if robot := settings.robot_joint_states:  # relative to the parent of the gripper's namespace
            topics.append(robot if robot.startswith("/") else f"{node.namespace.rpartition('/')[0]}/{robot}")
        self._joint_states = [node.advertise(topic, JointState, queue_size=1) for topic in topics]
        self._kinds = {
            "homing": _Kind(HomingAction, HomingResult, lambda goal: hand.homing()),
            "move": _Kind(MoveAction, MoveResult, lambda goal: hand.move(goal.width, goal.speed)),
            "grasp": _Kind(GraspAction, GraspResult, self._grasp),
            "stop": _Kind(StopAction, StopResult, lambda goal: hand.stop()),
            "gripper_action": _Kind(GripperCommandAction, self._command_result, self._command),
        }
        self._servers = [self._serve(name, kind) for name, kind in self._kinds.items()]

    def _serve(self, name: str, kind: _Kind) -> Registration:
        def on_goal(goal: GoalHandle) -> None:
            self._inbox.append(lambda: self._begin(name, goal))

        def on_cancel(goal: GoalHandle) -> None:
            self._inbox.append(lambda: self._cancel(goal))

        return self._node.action_server(name, kind.action, on_goal, on_cancel)

    def update(self) -> None:
        """Process goals and cancel requests, advance the hand, finish ended goals, publish if due; never blocks."""
        while self._inbox:
            self._inbox.popleft()()
        time = self._node.now().to_sec()
        self._hand.advance(time)
        for running in [item for item in self._running if item.motion.outcome is not None]:
            self._running.remove(running)
            self._finish(running)
        self._publish_when_due(time)

    def _publish_when_due(self, time: float) -> None:
        period = 1.0 / self._settings.publish_rate
        if self._next_publish - period <= time < self._next_publish:
            return
        self._next_publish += period
        if not time < self._next_publish <= time + period:  # the first call, a long pause, or a jump back in time
            self._next_publish = time + period
        self._publish()

    def shutdown(self) -> None:
        """Stop the fingers if they move, cancel open goals, and unregister actions and topics."""
        if self._running:
            self._hand.stop()
        for running in self._running:
            running.goal.cancel(self._result(running, "the gripper was shut down"), "the gripper was shut down")
        self._running.clear()
        for registration in (*self._servers, *self._joint_states):
            registration.unregister()

    def _begin(self, name: str, goal: GoalHandle) -> None:
        goal.accept()
        motion = self._kinds[name].begin(goal.goal)
        if name != "stop" and motion.outcome is None:  # the hand has accepted it and ends the previous motion
            for running in self._running:
                running.preempted = running.preempted or f"replaced by a goal of {name}"
        self._running.append(_Running(name, goal, motion))

    def _cancel(self, goal: GoalHandle) -> None:
        running = next((item for item in self._running if item.goal is goal), None)
        if running is not None and running.motion.outcome is None and not running.preempted:
            running.preempted = "cancelled"
            self._hand.stop()

    def _finish(self, running: _Running) -> None:
        outcome, reason = running.motion.outcome, running.motion.reason
        if outcome is HandOutcome.SUCCESS:
            running.goal.succeed(self._result(running, ""))
        elif running.preempted:
            running.goal.cancel(self._result(running, running.preempted), running.preempted)
        elif outcome is HandOutcome.UNSUCCESSFUL and running.name != "gripper_action":
            running.goal.succeed(self._result(running, reason), reason)
        else:
            what = f"{running.name}: {reason}" if reason else running.name
            self._node.log_error(f"{what} ({outcome.value if outcome else ''})")
            running.goal.abort(self._result(running, reason), reason)

    def _result(self, running: _Running, error: str) -> Any:
        return self._kinds[running.name].result(
            success=not error and running.motion.outcome is HandOutcome.SUCCESS, error=error
        )

    def _grasp(self, goal: Any) -> HandMotion:
        return self._hand.grasp(goal.width, goal.epsilon.inner, goal.epsilon.outer, goal.speed, goal.force)

    def _command(self, goal: Any) -> HandMotion:
        """Pass a goal of gripper_action to the hand: a wider opening as a move, a narrower one as a grasp.

        `position` in the goal is that of one finger: half the opening (franka_gripper 0.10.1).
        """
        width, settings, hand = 2.0 * goal.command.position, self._settings, self._hand
        if not 0.0 <= width <= hand.max_width:
            return HandMotion(
                "gripper_action",
                HandOutcome.FAIL,
                f"position {goal.command.position} m; valid: 0 to {0.5 * hand.max_width:g} m",
            )
        if abs(width - hand.width) < SAME_WIDTH:
            return HandMotion("gripper_action", HandOutcome.SUCCESS)
        if width >= hand.width:
            return hand.move(width, settings.default_speed)
        return hand.grasp(
            width, settings.epsilon_inner, settings.epsilon_outer, settings.default_speed, goal.command.max_effort
        )

    def _command_result(self, success: bool, error: str) -> Any:
        """Return the result of gripper_action; `position` is the opening, not one finger's (franka_gripper 0.10.1)."""
        return GripperCommandResult(position=self._hand.width, effort=0.0, stalled=False, reached_goal=success)

    def _publish(self) -> None:
        message = JointState()
        message.header.stamp = self._node.now()
        message.name = self._settings.fingers
        message.position = [0.5 * self._hand.width] * 2
        message.velocity, message.effort = [0.0, 0.0], [0.0, 0.0]
        for publisher in self._joint_states:
            publisher.publish(message)
