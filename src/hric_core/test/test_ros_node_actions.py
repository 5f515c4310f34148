import time
from collections.abc import Callable, Iterator

import actionlib
import pytest
from actionlib_msgs.msg import GoalStatus

from control_msgs.msg import GripperCommandAction, GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from hric_core.errors import HricError
from hric_core.node import GoalHandle
from hric_core.ros import RosNode

pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]


class Server:
    """An action server and actionlib's own client of it."""

    def __init__(self, name: str) -> None:
        self.goals: list[GoalHandle] = []
        self.cancelled: list[GoalHandle] = []
        self.refusal = ""
        node = RosNode("/actions")
        self.registration = node.action_server(name, GripperCommandAction, self._take, self.cancelled.append)
        self.client = actionlib.ActionClient(f"/actions/{name}", GripperCommandAction)
        assert self.client.wait_for_server(rospy_duration(5.0))

    def _take(self, goal: GoalHandle) -> None:
        self.goals.append(goal)
        if self.refusal:
            raise HricError(self.refusal)

    def send(self, feedback: Callable[..., None] | None = None):
        client_goal = self.client.send_goal(GripperCommandGoal(), feedback_cb=feedback)
        assert wait(lambda: self.goals)
        return client_goal


def rospy_duration(seconds: float):
    import rospy

    return rospy.Duration(seconds)


def wait(condition: Callable[[], object], timeout: float = 30.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


@pytest.fixture
def server(ros: str, request: pytest.FixtureRequest) -> Iterator[Server]:
    server = Server(request.node.name)
    yield server
    server.registration.unregister()
    server.client.stop()


def test_an_actionlib_client_sees_feedback_and_success(server: Server) -> None:
    heard: list[float] = []
    goal = server.send(lambda handle, feedback: heard.append(feedback.position))
    server.goals[0].accept()
    server.goals[0].publish_feedback(GripperCommandFeedback(position=0.02))
    assert wait(lambda: heard == [0.02])
    server.goals[0].succeed(GripperCommandResult(reached_goal=True), "there")
    assert wait(lambda: goal.get_comm_state() == actionlib.CommState.DONE)
    assert (goal.get_terminal_state(), goal.get_goal_status_text()) == (
        GoalStatus.SUCCEEDED,
        "there",
    ) and goal.get_result().reached_goal


def test_a_cancel_reaches_the_server_with_the_handle_that_it_knows(server: Server) -> None:
    goal = server.send()
    server.goals[0].accept()
    goal.cancel()
    assert wait(lambda: server.cancelled) and server.cancelled[0] is server.goals[0]
    server.cancelled[0].cancel(None, "as you wish")
    assert wait(lambda: goal.get_comm_state() == actionlib.CommState.DONE)
    assert goal.get_terminal_state() == GoalStatus.PREEMPTED


def test_a_refusal_while_taking_the_goal_rejects_it_with_its_text(server: Server) -> None:
    server.refusal = "unknown joints: elbow"
    goal = server.send()
    assert wait(lambda: goal.get_comm_state() == actionlib.CommState.DONE)
    assert (goal.get_terminal_state(), goal.get_goal_status_text()) == (GoalStatus.REJECTED, "unknown joints: elbow")


def test_an_aborted_goal_carries_result_and_text(server: Server) -> None:
    goal = server.send()
    server.goals[0].accept()
    server.goals[0].abort(GripperCommandResult(stalled=True), "stalled")
    assert wait(lambda: goal.get_comm_state() == actionlib.CommState.DONE)
    assert goal.get_terminal_state() == GoalStatus.ABORTED and goal.get_result().stalled


def test_goals_that_have_not_ended_are_aborted_when_the_server_is_taken_back(server: Server) -> None:
    goal = server.send()
    server.goals[0].accept()
    server.registration.unregister()
    assert wait(lambda: goal.get_comm_state() == actionlib.CommState.DONE)
    assert goal.get_terminal_state() == GoalStatus.ABORTED
