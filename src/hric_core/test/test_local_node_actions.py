import logging

import pytest
from actionlib_msgs.msg import GoalID
from std_msgs.msg import Empty

from control_msgs.msg import GripperCommandAction, GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from hric_core.errors import HricError, UnknownNameError
from hric_core.local.action import FINAL, TRANSITIONS
from hric_core.local.node import LocalNode
from hric_core.node import GoalHandle


class Server:
    """Action server that stores the goal handles it gets."""

    def __init__(self, node: LocalNode) -> None:
        self.goals: list[GoalHandle] = []
        self.cancelled: list[GoalHandle] = []
        self.registration = node.action_server(
            "gripper", GripperCommandAction, self.goals.append, self.cancelled.append
        )


def test_a_goal_is_accepted_gives_feedback_and_succeeds() -> None:
    node = LocalNode()
    server = Server(node)
    goal = node.send_goal("gripper", GripperCommandGoal())
    assert goal.status == "PENDING" and server.goals[0].goal_id == goal.goal_id
    server.goals[0].accept()
    assert goal.status == "ACTIVE" and not goal.done
    server.goals[0].publish_feedback(GripperCommandFeedback(position=0.01))
    server.goals[0].succeed(GripperCommandResult(reached_goal=True), "there")
    assert (goal.status, goal.text, goal.done) == ("SUCCEEDED", "there", True)
    assert goal.result.reached_goal and [feedback.position for feedback in goal.feedback] == [0.01]


def test_a_cancelled_goal_is_preempted_when_the_server_says_so() -> None:
    node = LocalNode()
    server = Server(node)
    goal = node.send_goal("gripper", GripperCommandGoal())
    server.goals[0].accept()
    goal.cancel()
    assert goal.status == "PREEMPTING" and server.cancelled == server.goals
    server.cancelled[0].cancel(None, "as you wish")
    assert (goal.status, goal.text) == ("PREEMPTED", "as you wish")
    assert isinstance(goal.result, GripperCommandResult)


def test_a_goal_cancelled_before_it_was_accepted_is_recalled() -> None:
    node = LocalNode()
    server = Server(node)
    goal = node.send_goal("gripper", GripperCommandGoal())
    goal.cancel()
    assert goal.status == "RECALLING"
    server.goals[0].cancel(None)
    assert goal.status == "RECALLED"


def test_cancelling_after_the_end_does_nothing() -> None:
    node = LocalNode()
    server = Server(node)
    goal = node.send_goal("gripper", GripperCommandGoal())
    server.goals[0].accept()
    server.goals[0].succeed(None)
    goal.cancel()
    assert goal.status == "SUCCEEDED" and server.cancelled == []


def test_an_empty_cancel_message_cancels_all_goals() -> None:
    node = LocalNode()
    server = Server(node)
    goals = [node.send_goal("gripper", GripperCommandGoal()) for _ in range(2)]
    node.advertise("gripper/cancel", GoalID).publish(GoalID())
    assert [goal.status for goal in goals] == ["RECALLING", "RECALLING"] and len(server.cancelled) == 2


def test_a_refusal_while_taking_the_goal_rejects_it_or_aborts_it_when_accepted(
    caplog: pytest.LogCaptureFixture,
) -> None:
    node = LocalNode()

    def refuse(handle: GoalHandle) -> None:
        if handle.goal.command.position > 1.0:
            handle.accept()
        raise HricError("too wide")

    node.action_server("gripper", GripperCommandAction, refuse, refuse)
    near, far = GripperCommandGoal(), GripperCommandGoal()
    far.command.position = 2.0
    with caplog.at_level(logging.ERROR, "hric"):
        rejected, aborted = node.send_goal("gripper", near), node.send_goal("gripper", far)
    assert (rejected.status, rejected.text, aborted.status) == ("REJECTED", "too wide", "ABORTED")
    assert "action /gripper: too wide" in caplog.text


@pytest.mark.parametrize("event", TRANSITIONS)
def test_every_event_moves_a_goal_as_the_table_says_or_not_at_all(event: str) -> None:
    found = {}
    for state in (*FINAL, "PENDING", "ACTIVE", "PREEMPTING", "RECALLING"):
        node = LocalNode()
        server = Server(node)
        goal = node.send_goal("gripper", GripperCommandGoal())
        handle = server.goals[0]
        handle.client.status = state
        getattr(handle, event)(*{"accept": (), "request_cancel": ()}.get(event, (None, "")))
        found[state] = goal.status
    assert found == {state: TRANSITIONS[event].get(state, state) for state in found}


def test_a_transition_that_is_not_allowed_is_told(caplog: pytest.LogCaptureFixture) -> None:
    node = LocalNode()
    server = Server(node)
    node.send_goal("gripper", GripperCommandGoal())
    with caplog.at_level(logging.ERROR, "hric"):
        server.goals[0].succeed(None)
    assert "cannot succeed while PENDING; only while ACTIVE, PREEMPTING" in caplog.text


def test_the_topics_of_an_action_carry_what_actionlib_sends() -> None:
    node, seen = LocalNode(), []
    server = Server(node)
    node.tap(lambda topic, message, time: seen.append(topic))
    node.send_goal("gripper", GripperCommandGoal())
    server.goals[0].accept()
    server.goals[0].publish_feedback(GripperCommandFeedback())
    server.goals[0].succeed(None)
    assert seen == [f"/gripper/{name}" for name in ("goal", "status", "feedback", "status", "result")]
    assert node.topics()["/gripper/goal"] == "control_msgs/GripperCommandActionGoal"


def test_a_wrong_goal_type_and_an_unknown_action_are_refused() -> None:
    node = LocalNode()
    server = Server(node)
    with pytest.raises(HricError, match="action /gripper has type control_msgs/GripperCommandGoal, not std_msgs/Empty"):
        node.send_goal("gripper", Empty())
    with pytest.raises(HricError, match="offered already"):
        Server(node)
    server.registration.unregister()
    with pytest.raises(UnknownNameError, match="no action '/gripper'"):
        node.send_goal("gripper", GripperCommandGoal())
    assert node.topics() == {}
