"""Actions within one process, without a ROS master: goal states, messages and topics are those of actionlib."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from hric_core import names
from hric_core.errors import HricError
from hric_core.node import GoalHandle

if TYPE_CHECKING:
    from hric_core.local.node import LocalNode

TRANSITIONS: dict[str, dict[str, str]] = {
    "accept": {"PENDING": "ACTIVE", "RECALLING": "PREEMPTING"},
    "reject": {"PENDING": "REJECTED", "RECALLING": "REJECTED"},
    "request_cancel": {"PENDING": "RECALLING", "ACTIVE": "PREEMPTING"},
    "succeed": {"ACTIVE": "SUCCEEDED", "PREEMPTING": "SUCCEEDED"},
    "abort": {"ACTIVE": "ABORTED", "PREEMPTING": "ABORTED"},
    "cancel": {"PENDING": "RECALLED", "RECALLING": "RECALLED", "ACTIVE": "PREEMPTED", "PREEMPTING": "PREEMPTED"},
}
"""Transitions of a goal's state: event -> state before -> state after; all other events are refused."""

FINAL = frozenset({"REJECTED", "SUCCEEDED", "ABORTED", "RECALLED", "PREEMPTED"})


@dataclass(eq=False)
class LocalGoal:
    """Client side of an action goal; the attributes are updated while the goal runs.

    Attributes:
        status: state, by actionlib's name, e.g. "ACTIVE" or "SUCCEEDED".
        text: server's text for the last change of state.
        result: result message; None until the goal has ended.
        feedback: all feedback messages so far.
    """

    goal_id: str
    _request_cancel: Callable[[GoalID], None]
    status: str = "PENDING"
    text: str = ""
    result: Any = None
    feedback: list[Any] = field(default_factory=list)

    @property
    def done(self) -> bool:
        """True if the goal has ended, in any state."""
        return self.status in FINAL

    def cancel(self) -> None:
        """Request the server to cancel the goal."""
        self._request_cancel(GoalID(id=self.goal_id))


class LocalGoalHandle(GoalHandle):
    """Server side of an action goal."""

    def __init__(self, server: LocalActionServer, action_goal: Any) -> None:
        self._server = server
        self._goal_id: GoalID = action_goal.goal_id
        self.goal_id, self.goal = str(self._goal_id.id), action_goal.goal
        self.client = LocalGoal(self.goal_id, server.on_cancel_message)

    @property
    def status(self) -> str:
        """State of the goal, by actionlib's name, e.g. "ACTIVE"."""
        return self.client.status

    def accept(self) -> None:
        """Accept the goal: set its state to ACTIVE."""
        self._move("accept", "")

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""
        self.client.feedback.append(feedback)
        self._server.send_feedback(self, feedback)

    def request_cancel(self) -> bool:
        """Set the state that follows a client's cancel request; return False if the present state does not allow it."""
        return self.status in TRANSITIONS["request_cancel"] and self._move("request_cancel", "")

    def message(self) -> GoalStatus:
        """Return the state of the goal as an actionlib_msgs/GoalStatus."""
        return GoalStatus(goal_id=self._goal_id, status=getattr(GoalStatus, self.status), text=self.client.text)

    def _move(self, event: str, text: str) -> bool:
        after = TRANSITIONS[event].get(self.status)
        if after is None:
            valid = ", ".join(TRANSITIONS[event])
            self._server.refuse(
                f"goal {self.goal_id} cannot {event.replace('_', ' ')} while {self.status}; only while {valid}"
            )
            return False
        self.client.status, self.client.text = after, text
        self._server.send_status()
        return True

    def _finish(self, event: str, result: Any, text: str) -> None:
        if self._move(event, text):
            self.client.result = self._server.default_result() if result is None else result
            self._server.send_result(self)


class LocalActionServer:
    """Server of one action. It uses the topics of actionlib, so that a recorder gets the same messages as with ROS."""

    def __init__(
        self,
        node: LocalNode,
        name: str,
        action_type: Any,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
    ) -> None:
        action = action_type()
        self._node, self._name = node, name
        self._on_goal, self._on_cancel = on_goal, on_cancel
        self._goal_type, self._result_type, self._feedback_type = (
            type(part) for part in (action.action_goal, action.action_result, action.action_feedback)
        )
        self._handles: dict[str, LocalGoalHandle] = {}
        self._sender = node.advertise(f"{name}/goal", self._goal_type)
        self._status = node.advertise(f"{name}/status", GoalStatusArray, latch=True)
        self._feedback = node.advertise(f"{name}/feedback", self._feedback_type)
        self._result = node.advertise(f"{name}/result", self._result_type)
        self._subscriptions = [
            node.subscribe(f"{name}/goal", self._goal_type, self._on_goal_message),
            node.subscribe(f"{name}/cancel", GoalID, self.on_cancel_message),
        ]
        self.send_status()

    def close(self) -> None:
        """Unregister the topics of the action."""
        for subscription in self._subscriptions:
            subscription.unregister()
        for publisher in (self._sender, self._status, self._feedback, self._result):
            publisher.unregister()

    def send(self, goal: Any, goal_id: str) -> LocalGoal:
        """Send a goal, as a client does, and return its client side."""
        message = self._goal_type()
        names.check_message(f"action {self._name}", type(message.goal), goal)
        message.goal, message.goal_id = goal, GoalID(id=goal_id, stamp=self._node.now())
        message.header.stamp = message.goal_id.stamp
        handle = self._handles[goal_id] = LocalGoalHandle(self, message)
        self._sender.publish(message)
        return handle.client

    def default_result(self) -> Any:
        """Return a result message with default values."""
        return self._result_type().result

    def refuse(self, text: str) -> None:
        """Log an error about a goal, e.g. a change of state that is not allowed."""
        self._node.log_error(f"action {self._name}: {text}")

    def send_status(self) -> None:
        """Publish the states of all goals that have not ended, or have ended since the last call."""
        message = GoalStatusArray(status_list=[handle.message() for handle in self._handles.values()])
        message.header.stamp = self._node.now()
        self._handles = {key: handle for key, handle in self._handles.items() if handle.status not in FINAL}
        self._status.publish(message)

    def send_feedback(self, handle: LocalGoalHandle, feedback: Any) -> None:
        """Publish feedback about a goal on the action's feedback topic."""
        message = self._feedback_type(status=handle.message(), feedback=feedback)
        message.header.stamp = self._node.now()
        self._feedback.publish(message)

    def send_result(self, handle: LocalGoalHandle) -> None:
        """Publish the result of a goal on the action's result topic."""
        message = self._result_type(status=handle.message(), result=handle.client.result)
        message.header.stamp = self._node.now()
        self._result.publish(message)

    def _on_goal_message(self, message: Any) -> None:
        handle = self._handles.setdefault(message.goal_id.id, LocalGoalHandle(self, message))
        try:
            self._on_goal(handle)
        except HricError as error:
            self.refuse(str(error))
            handle.fail(str(error))

    def on_cancel_message(self, message: GoalID) -> None:
        """Handle a cancel request: for the goal with the id of the message, or for all goals if the id is empty."""
        for handle in list(self._handles.values()):
            if message.id in ("", handle.goal_id) and handle.request_cancel():
                self._on_cancel(handle)
