"""Running goal of FollowJointTrajectory. Several threads may end it; only the first of them has an effect."""

import threading
from typing import Any

from control_msgs.msg import FollowJointTrajectoryResult
from hric_controllers.trajectory.message import SUCCESSFUL
from hric_core.node import GoalHandle


def result(code: int, text: str) -> FollowJointTrajectoryResult:
    """Return a FollowJointTrajectoryResult with this error code and text."""
    return FollowJointTrajectoryResult(error_code=code, error_string=text)


class RunningGoal:
    """Accepted goal that has not ended yet.

    Args:
        handle: goal handle of the action server.

    Attributes:
        goal_id: unique id of the goal.
        ended: True if the goal has ended, for any reason.
    """

    def __init__(self, handle: GoalHandle) -> None:
        self._handle = handle
        self._lock = threading.Lock()
        self.goal_id, self.ended = handle.goal_id, False

    def finish(self, code: int, text: str) -> None:
        """End the goal as succeeded if `code` is SUCCESSFUL, else as aborted. Must not be called in the loop."""
        if self._ends_now():
            outcome = result(code, text)
            if code == SUCCESSFUL:
                self._handle.succeed(outcome, text)
            else:
                self._handle.abort(outcome, text)

    def cancel(self, text: str) -> None:
        """End the goal as cancelled; `text`: the reason, for the client. Must not be called in the loop."""
        if self._ends_now():
            self._handle.cancel(result(SUCCESSFUL, text), text)

    def feedback(self, message: Any) -> None:
        """Send a FollowJointTrajectoryFeedback to the client unless the goal has ended. Do not call it in the loop."""
        if not self.ended:
            self._handle.publish_feedback(message)

    def _ends_now(self) -> bool:
        # The handle is called outside the lock, since a subscriber of its messages may call this object again.
        with self._lock:
            first, self.ended = not self.ended, True
        return first
