"""Action server on actionlib, with its topics unchanged and goal handles of type `GoalHandle`."""

from collections.abc import Callable
from typing import Any

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from hric_core.errors import HricError
from hric_core.node import GoalHandle

_STATES: dict[int, str] = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}
"""Names of the goal states by number; actionlib's own `to_string` has another name for PENDING."""
_ENDS = {"reject": "set_rejected", "succeed": "set_succeeded", "abort": "set_aborted", "cancel": "set_canceled"}


class RosGoalHandle(GoalHandle):
    """Server side of an actionlib goal."""

    def __init__(self, handle: Any, forget: Callable[[str], None]) -> None:
        self._handle, self._forget = handle, forget
        self.goal_id, self.goal = str(handle.get_goal_id().id), handle.get_goal()

    @property
    def status(self) -> str:
        """State of the goal, by actionlib's name, e.g. "ACTIVE"."""
        return _STATES[self._handle.get_goal_status().status]

    def accept(self) -> None:
        """Accept the goal: set its state to ACTIVE."""
        self._handle.set_accepted()

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback to the client."""
        self._handle.publish_feedback(feedback)

    def _finish(self, event: str, result: Any, text: str) -> None:
        getattr(self._handle, _ENDS[event])(result, text)
        self._forget(self.goal_id)


class RosActionServer:
    """Server of one action on actionlib.

    Args:
        name: absolute name of the action.
        action_type: action class.
        on_goal: callback for a new goal; called in rospy's thread, under actionlib's lock; must not wait.
        on_cancel: callback for a cancel request; called in rospy's thread, under actionlib's lock; must not wait.
        report: function that logs a line of error text.
    """

    def __init__(
        self,
        name: str,
        action_type: type,
        on_goal: Callable[[GoalHandle], None],
        on_cancel: Callable[[GoalHandle], None],
        report: Callable[[str], None],
    ) -> None:
        self._name, self._report = name, report
        self._on_goal, self._on_cancel = on_goal, on_cancel
        self._handles: dict[str, RosGoalHandle] = {}
        self._server = actionlib.ActionServer(name, action_type, self._receive_goal, self._receive_cancel, False)
        self._server.start()

    def close(self) -> None:
        """Unregister the topics of the action; goals that have not ended are aborted or rejected."""
        for handle in list(self._handles.values()):
            handle.fail("the action server was shut down")
        self._server.stop()

    def _forget(self, goal_id: str) -> None:
        self._handles.pop(goal_id, None)

    def _receive_goal(self, server_handle: Any) -> None:
        handle = RosGoalHandle(server_handle, self._forget)
        self._handles[handle.goal_id] = handle
        try:
            self._on_goal(handle)
        except HricError as error:
            self._report(f"action {self._name}: {error}")
            handle.fail(str(error))

    def _receive_cancel(self, server_handle: Any) -> None:
        # actionlib creates a new handle for each cancel; the owner gets the handle of the goal.
        handle = self._handles.get(str(server_handle.get_goal_id().id))
        if handle is None:
            rospy.logdebug("action %s: cancel of a goal that has ended", self._name)
            return
        try:
            self._on_cancel(handle)
        except HricError as error:
            self._report(f"action {self._name}: {error}")
