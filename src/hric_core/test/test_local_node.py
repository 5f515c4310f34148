import logging

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header, String
from std_srvs.srv import Empty, SetBool, SetBoolRequest, SetBoolResponse, TriggerRequest, TriggerResponse

from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.local.node import LocalNode
from hric_core.node import LiveParameter, Node


def test_it_has_the_face_of_a_node() -> None:
    assert isinstance(LocalNode(), Node)


def test_what_belongs_to_the_whole_robot_lies_beside_a_nodes_own_namespace() -> None:
    assert LocalNode().child("lab").child("natnet_client").beside("mocap/marker") == "/lab/mocap/marker"
    assert LocalNode().child("natnet_client").beside("mocap/marker") == "/mocap/marker"
    assert LocalNode().beside("mocap/marker") == "/mocap/marker" and LocalNode().child("a").beside("/b") == "/b"


def test_children_see_the_same_parameters_under_their_own_names() -> None:
    node = LocalNode({"arm": {"pd": {"kp": 50.0}}, "arm/pd/kd": 10.0})
    child = node.child("arm").child("pd")
    assert child.namespace == "/arm/pd"
    assert (child.param("kp"), child.param("kd"), child.param("/arm/pd/kp"), node.param("arm/pd/kp")) == (
        50.0,
        10.0,
        50.0,
        50.0,
    )
    child.set_param("kp", 60.0)
    assert node.param("arm") == {"pd": {"kp": 60.0, "kd": 10.0}}


def test_a_missing_parameter_is_told_by_its_absolute_name() -> None:
    with pytest.raises(ParameterError, match="parameter /arm/kp is not set"):
        LocalNode().child("arm").param("kp")


def test_a_default_may_be_none_and_false_values_are_values() -> None:
    node = LocalNode({"off": False, "zero": 0, "empty": ""})
    assert node.param("absent", None) is None
    assert (node.param("off", True), node.param("zero", 1), node.param("empty", "x")) == (False, 0, "")
    assert node.has_param("off") and not node.has_param("absent") and not node.has_param("off/below")


def test_parameters_are_copies() -> None:
    node = LocalNode({"list": [1, 2]})
    node.param("list").append(3)
    assert node.param("list") == [1, 2]


def test_searching_goes_upwards_and_takes_the_nearest() -> None:
    node = LocalNode({"robot_description": "root", "arm": {"robot_description": "arm", "pd": {}}})
    assert node.child("arm/pd").search_param("robot_description") == "arm"
    assert node.child("other").search_param("robot_description") == "root"
    assert node.child("other").search_param("absent", 3) == 3
    with pytest.raises(ParameterError, match="absent is set neither in /other nor above it"):
        node.child("other").search_param("absent")


def test_private_and_empty_names_are_refused() -> None:
    for name in ("~x", ""):
        with pytest.raises(HricError, match="is not a name that can be resolved in /: give a relative name"):
            LocalNode().resolve(name)


def test_a_message_is_delivered_within_publish_in_order_of_subscription() -> None:
    node, heard = LocalNode(), []
    node.subscribe("a/x", Float64, lambda m: heard.append(("first", m.data)))
    node.subscribe("/a/x", Float64, lambda m: heard.append(("second", m.data)))
    node.child("a").advertise("x", Float64).publish(Float64(1.5))
    assert heard == [("first", 1.5), ("second", 1.5)]


def test_a_latched_message_reaches_those_who_come_later_and_others_do_not() -> None:
    node, heard = LocalNode(), []
    node.advertise("plain", Float64).publish(Float64(1))
    node.advertise("latched", Float64, latch=True).publish(Float64(2))
    for topic in ("plain", "latched"):
        node.subscribe(topic, Float64, lambda m: heard.append(m.data))
    assert heard == [2]


def test_a_message_of_a_wrong_type_is_refused_with_topic_and_types() -> None:
    publisher = LocalNode().advertise("x", Float64)
    with pytest.raises(HricError, match="topic /x has type std_msgs/Float64, not std_msgs/String"):
        publisher.publish(String("1"))
    with pytest.raises(HricError, match="topic /x has type std_msgs/Float64, not float"):
        publisher.publish(1.0)


def test_a_topic_has_one_type() -> None:
    node = LocalNode()
    node.advertise("x", Float64)
    with pytest.raises(HricError, match="topic /x has type std_msgs/Float64, not std_msgs/String"):
        node.subscribe("x", String, print)


def test_after_unregistering_nothing_is_heard_and_a_second_time_does_nothing() -> None:
    node, heard = LocalNode(), []
    publisher = node.advertise("x", Float64)
    subscription = node.subscribe("x", Float64, heard.append)
    subscription.unregister()
    subscription.unregister()
    publisher.publish(Float64(1))
    node.subscribe("x", Float64, heard.append)
    publisher.unregister()
    publisher.unregister()
    publisher.publish(Float64(2))
    assert heard == []


def test_what_a_callback_refuses_is_logged_with_its_topic_and_other_errors_reach_the_publisher(
    caplog: pytest.LogCaptureFixture,
) -> None:
    node = LocalNode()
    publisher = node.advertise("arm/command", Float64)

    def refuse(message: Float64) -> None:
        raise HricError("only 7 values") if message.data == 1.0 else ZeroDivisionError

    node.child("arm").subscribe("command", Float64, refuse)
    with caplog.at_level(logging.ERROR, "hric"):
        publisher.publish(Float64(1.0))
    assert "/arm: /arm/command: only 7 values" in caplog.text
    with pytest.raises(ZeroDivisionError):
        publisher.publish(Float64(2.0))


def test_a_flood_of_refused_messages_is_a_line_each_second_with_a_count(caplog: pytest.LogCaptureFixture) -> None:
    now = 0.0
    node = LocalNode()
    node.clock = lambda: now
    publisher = node.advertise("command", Float64)

    def refuse(message: Float64) -> None:
        raise HricError(f"{message.data:g} is too much")

    registration = node.subscribe("command", Float64, refuse)
    with caplog.at_level(logging.ERROR, "hric"):
        for k in range(2500):
            now = 0.001 * k
            publisher.publish(Float64(k))
        registration.unregister()
    lines = [record.getMessage().partition("/command: ")[2] for record in caplog.records]
    assert lines == [
        "0 is too much",
        "1000 is too much (999 more since the last line)",
        "2000 is too much (999 more since the last line)",
        "2499 is too much (499 times since the last line)",
    ]


def test_a_tap_sees_all_messages_with_robot_time_and_numbers_their_headers() -> None:
    node, seen = LocalNode(), []
    node.clock = lambda: 1.25
    tap = node.tap(lambda topic, message, time: seen.append((topic, type(message), time)))
    publisher = node.child("a").advertise("x", Header)
    assert publisher.subscribers() == 1
    publisher.publish(Header())
    tap.unregister()
    publisher.publish(Header())
    assert seen == [("/a/x", Header, 1.25)]


def test_headers_are_numbered_from_one() -> None:
    node, numbers = LocalNode(), []
    node.subscribe("x", JointState, lambda m: numbers.append(m.header.seq))
    publisher = node.advertise("x", JointState)
    for _i in range(3):
        publisher.publish(JointState())
    assert numbers == [1, 2, 3]


def test_stamps_are_robot_time_to_the_nanosecond() -> None:
    node = LocalNode()
    for milliseconds in (0, 1, 3, 1001, 123456789):
        node.child("a").clock = lambda t=milliseconds / 1000: t
        assert node.now().to_nsec() == milliseconds * 1_000_000


def test_a_service_is_a_call_and_its_error_reaches_the_caller() -> None:
    node = LocalNode()

    def handle(request: SetBoolRequest) -> SetBoolResponse:
        if not request.data:
            raise HricError("only true")
        return SetBoolResponse(success=True)

    service = node.child("a").service("set", SetBool, handle)
    assert node.call("a/set", SetBoolRequest(data=True)).success
    with pytest.raises(HricError, match="only true"):
        node.call("a/set", SetBoolRequest(data=False))
    with pytest.raises(HricError, match="service /a/set has type std_srvs/SetBoolRequest, not std_srvs/TriggerRequest"):
        node.call("a/set", TriggerRequest())
    assert node.services() == {"/a/set": "std_srvs/SetBool"}
    service.unregister()
    with pytest.raises(UnknownNameError, match="no service '/a/set'"):
        node.call("a/set", SetBoolRequest())


def test_a_service_is_offered_once_and_must_answer_with_its_type() -> None:
    node = LocalNode()
    node.service("x", Empty, lambda request: TriggerResponse())
    with pytest.raises(HricError, match="service /x is offered already"):
        node.service("x", Empty, lambda request: None)
    with pytest.raises(
        HricError, match="response of service /x has type std_srvs/EmptyResponse, not std_srvs/TriggerResponse"
    ):
        node.call("x", Empty._request_class())


PARAMETERS = [
    LiveParameter("kp", 50.0, 0.0, 1000.0, "gain"),
    LiveParameter("count", 3, 1, 5),
    LiveParameter("on", True),
    LiveParameter("mode", "soft"),
    LiveParameter("free", 0.0),
]


def test_live_parameters_start_from_the_parameter_tree_and_stand_in_it() -> None:
    node, seen = LocalNode({"c": {"kp": 70}}), []
    node.child("c").live_parameters(PARAMETERS, lambda values: seen.append(dict(values)) or values)
    assert seen == [{"kp": 70.0, "count": 3, "on": True, "mode": "soft", "free": 0.0}]
    assert node.param("c/count") == 3


def test_a_live_change_is_asked_of_the_owner_who_may_put_values_back() -> None:
    node = LocalNode()

    def on_change(values: dict) -> dict:
        return {**values, "kp": min(values["kp"], 100.0)}

    node.child("c").live_parameters(PARAMETERS, on_change)
    assert node.set_live("c", {"kp": 500, "mode": "hard"})["kp"] == 100.0
    assert (node.param("c/kp"), node.param("c/mode")) == (100.0, "hard")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"kp": -5.0}, "/c/kp is -5.0; valid: a finite number from 0 to 1000"),
        ({"kp": float("nan")}, "/c/kp is nan; valid: a finite number"),
        ({"free": float("inf")}, "/c/free is inf; valid: a finite number"),
        ({"count": 2.5}, "/c/count is 2.5; valid: a whole number"),
        ({"on": 1}, "/c/on is 1; valid: true or false"),
        ({"kd": 1.0}, "no live parameter 'kd' in /c; valid: count, free, kp, mode, on"),
    ],
)
def test_a_bad_live_value_changes_nothing(changes: dict, reason: str) -> None:
    node = LocalNode()
    node.child("c").live_parameters(PARAMETERS, lambda values: values)
    with pytest.raises(HricError, match=reason):
        node.set_live("c", {"mode": "hard", **changes})
    assert (node.param("c/mode"), node.param("c/kp")) == ("soft", 50.0)


def test_a_bad_initial_value_is_refused_at_once() -> None:
    with pytest.raises(ParameterError, match=r"/kp is -1\.0; valid: a finite number from 0 to 1000"):
        LocalNode({"kp": -1.0}).live_parameters(PARAMETERS, lambda values: values)


def test_live_parameters_are_offered_once_per_namespace_and_can_be_taken_back() -> None:
    node = LocalNode()
    registration = node.live_parameters(PARAMETERS, lambda values: values)
    with pytest.raises(HricError, match="offers live parameters already"):
        node.live_parameters(PARAMETERS, lambda values: values)
    registration.unregister()
    with pytest.raises(UnknownNameError, match="no namespace with live parameters"):
        node.set_live("/", {"kp": 1.0})
