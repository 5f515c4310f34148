"""Running goal of FollowJointTrajectory; it ends once, by the first thread that ends it."""

import threading
from typing import Any

from control_msgs.msg import FollowJointTrajectoryResult
from hric_controllers.trajectory.message import SUCCESSFUL
from hric_core.node import GoalHandle


def result(code: int, text: str) -> FollowJointTrajectoryResult:
    """Return a result message; code: an error code of FollowJointTrajectoryResult."""
    return FollowJointTrajectoryResult(error_code=code, error_string=text)


class RunningGoal:
    """Accepted goal.

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
        """Succeed or abort, depending on the code. Not in the loop."""
        if self._ends_now():
            outcome = result(code, text)
            if code == SUCCESSFUL:
                self._handle.succeed(outcome, text)
            else:
                self._handle.abort(outcome, text)

    def cancel(self, text: str) -> None:
        """Cancel the goal on request of the client, or since it is replaced. Not in the loop."""
        if self._ends_now():
            self._handle.cancel(result(SUCCESSFUL, text), text)

    def feedback(self, message: Any) -> None:
        """Send the joint states to the client as feedback. Not in the loop."""
        if not self.ended:
            self._handle.publish_feedback(message)

    def _ends_now(self) -> bool:
        # The handle is called outside the lock: what it publishes may call back.
        with self._lock:
            first, self.ended = not self.ended, True
        return first
