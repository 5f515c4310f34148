import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import Float64, Float64MultiArray, String
from std_srvs.srv import SetBool, SetBoolResponse, TriggerResponse

from hric_core import realtime
from hric_core.errors import HricError, ParameterError
from hric_core.node import Node
from hric_core.ros import RosNode

pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("ignore::DeprecationWarning")]


@pytest.fixture
def node(ros: str, request: pytest.FixtureRequest) -> RosNode:
    return RosNode(f"/{request.node.name[:40].split('[')[0]}")


def wait(condition: Callable[[], object], timeout: float = 30.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def test_it_has_the_face_of_a_node(node: RosNode) -> None:
    assert isinstance(node, Node)


def test_relative_private_and_absolute_namespaces_are_resolved(ros: str) -> None:
    assert (RosNode().namespace, RosNode("~").namespace, RosNode("arm").namespace, RosNode("/a/b/").namespace) == (
        "/",
        ros,
        "/arm",
        "/a/b",
    )
    assert RosNode("/a").child("b").resolve("c") == "/a/b/c"


def test_parameters_are_read_and_a_missing_one_is_told_by_its_absolute_name(node: RosNode) -> None:
    node.set_param("pd", {"kp": 50.0, "off": False, "names": ["a", "b"]})
    child = node.child("pd")
    assert (child.param("kp"), child.param("off"), child.param("names"), child.param("/test_absent", 3)) == (
        50.0,
        False,
        ["a", "b"],
        3,
    )
    assert child.has_param("off") and not child.has_param("kd") and child.param("kd", None) is None
    with pytest.raises(ParameterError, match=f"parameter {node.namespace}/pd/kd is not set"):
        child.param("kd")


def test_searching_goes_upwards_from_the_nodes_namespace(node: RosNode) -> None:
    node.set_param("search_me", "above")
    node.set_param("near/search_me", "near")
    assert node.child("near/pd").search_param("search_me") == "near"
    assert node.child("far/pd").search_param("search_me") == "above"
    assert node.search_param("nowhere_at_all", 1) == 1
    with pytest.raises(ParameterError, match="nowhere_at_all is set neither in"):
        node.search_param("nowhere_at_all")


def test_a_message_goes_from_publisher_to_subscriber_until_it_is_taken_back(node: RosNode) -> None:
    heard: list[float] = []
    subscription = node.subscribe("x", Float64, lambda message: heard.append(message.data))
    publisher = node.advertise("x", Float64, queue_size=0)
    assert wait(publisher.subscribers)
    publisher.publish(Float64(1.0))
    assert wait(lambda: heard == [1.0])
    subscription.unregister()
    subscription.unregister()
    publisher.publish(Float64(2.0))
    publisher.unregister()
    publisher.unregister()
    publisher.publish(Float64(3.0))
    time.sleep(0.05)
    assert heard == [1.0]


def test_a_latched_message_reaches_those_who_come_later(node: RosNode) -> None:
    heard: list[float] = []
    node.advertise("latched", Float64, latch=True).publish(Float64(4.0))
    node.subscribe("latched", Float64, lambda message: heard.append(message.data))
    assert wait(lambda: heard == [4.0])


def test_a_wrong_type_and_a_wrong_field_are_refused_with_the_topic(node: RosNode) -> None:
    publisher = node.advertise("typed", Float64, queue_size=0)
    node.subscribe("typed", Float64, print)
    assert wait(publisher.subscribers)
    with pytest.raises(HricError, match="/typed has type std_msgs/Float64, not std_msgs/String"):
        publisher.publish(String("1"))
    with pytest.raises(HricError, match="/typed: "):
        publisher.publish(Float64("one"))


def test_what_a_callback_refuses_is_one_line_of_log(node: RosNode, monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    monkeypatch.setattr(rospy, "logerr", lambda text, *args: lines.append(text % args))

    def refuse(message: Float64) -> None:
        raise HricError("command has 1 values for 7 joints")

    node.subscribe("command", Float64, refuse)
    publisher = node.advertise("command", Float64, latch=True)
    publisher.publish(Float64(1.0))
    assert wait(lambda: lines)
    assert lines == [f"{node.namespace}: {node.namespace}/command: command has 1 values for 7 joints"]


def test_a_services_error_is_its_text_at_the_caller(node: RosNode) -> None:
    def handle(request: object) -> object:
        if not request.data:  # type: ignore[attr-defined]
            raise HricError("only true is valid")
        return SetBoolResponse(success=True)

    service = node.service("set", SetBool, handle)
    proxy = rospy.ServiceProxy(node.resolve("set"), SetBool)
    assert proxy(True).success
    with pytest.raises(rospy.ServiceException, match="only true is valid"):
        proxy(False)
    with pytest.raises(HricError, match=f"service {node.namespace}/set cannot be offered"):
        node.service("set", SetBool, handle)
    service.unregister()
    with pytest.raises(rospy.ServiceException, match="unavailable"):
        proxy(True)


def test_a_service_must_answer_with_its_type(node: RosNode) -> None:
    node.service("set", SetBool, lambda request: TriggerResponse())
    with pytest.raises(rospy.ServiceException, match="has type std_srvs/SetBoolResponse, not std_srvs/TriggerResponse"):
        rospy.ServiceProxy(node.resolve("set"), SetBool)(True)


def test_now_is_ros_time_or_the_clock_that_was_given(node: RosNode) -> None:
    assert abs(node.now().to_sec() - time.time()) < 5.0
    child = node.child("a")
    node.clock = lambda: 12.003
    assert child.now().to_nsec() == 12_003_000_000
    node.clock = None
    assert abs(child.now().to_sec() - time.time()) < 5.0


def test_a_realtime_publisher_sends_from_the_publishing_thread_and_its_messages_arrive(node: RosNode) -> None:
    heard: list[float] = []
    builders: set[str] = set()
    node.subscribe("x", Float64, lambda message: heard.append(message.data), queue_size=0)
    publisher = realtime.publisher(node, "x", Float64, lossless=True)
    assert wait(publisher.subscribers)

    def build(i: int) -> Float64:
        builders.add(threading.current_thread().name)
        return Float64(i)

    for i in range(500):
        publisher.publish(lambda i=i: build(i))
    assert wait(lambda: len(heard) == 500) and heard == [float(i) for i in range(500)] and builders == {"publish"}
    publisher.unregister()


def test_what_waits_when_the_robot_ends_is_still_sent(node: RosNode) -> None:
    heard: list[float] = []
    node.subscribe("x", Float64, lambda message: heard.append(message.data), queue_size=0)
    publisher = realtime.publisher(node, "x", Float64, lossless=True)
    assert wait(publisher.subscribers)
    for i in range(200):
        publisher.publish(Float64, float(i))
    realtime.shutdown(5.0)
    assert wait(lambda: len(heard) == 200)


def test_a_latched_message_of_the_loop_reaches_who_comes_later(node: RosNode) -> None:
    publisher = realtime.publisher(node, "x", Float64, latch=True)
    publisher.publish(Float64, 3.0)
    assert realtime.drain(5.0)
    heard: list[float] = []
    node.subscribe("x", Float64, lambda message: heard.append(message.data))
    assert wait(lambda: heard == [3.0])
    publisher.unregister()


def test_what_is_no_message_type_is_refused_at_once(node: RosNode) -> None:
    with pytest.raises(HricError, match="x cannot be advertised: data_class"):
        realtime.publisher(node, "x", dict)


def test_messages_sent_together_arrive_whole_in_their_order_with_running_numbers(node: RosNode) -> None:
    heard: list[tuple[int, float]] = []
    publisher = node.advertise("points", PointStamped)
    node.subscribe(
        "points", PointStamped, lambda message: heard.append((message.header.seq, message.point.x)), queue_size=0
    )
    assert wait(publisher.subscribers)
    points = [PointStamped() for _ in range(200)]
    for index, point in enumerate(points):
        point.point.x = float(index)
    publisher.publish_all(points)
    assert wait(lambda: len(heard) == 200)
    assert heard == [(heard[0][0] + index, float(index)) for index in range(200)]


@pytest.mark.parametrize("bad", [0, 1, 3])
@pytest.mark.parametrize("content", [{"data": ["not a number"]}, {"layout": None, "data": []}])
def test_of_many_one_that_cannot_be_sent_is_told_and_the_others_arrive(
    node: RosNode, bad: int, content: dict[str, Any]
) -> None:
    heard: list[tuple[float, ...]] = []
    publisher = node.advertise(f"numbers{bad}", Float64MultiArray)
    subscription = node.subscribe(f"numbers{bad}", Float64MultiArray, lambda message: heard.append(message.data))
    assert wait(publisher.subscribers)
    messages = [Float64MultiArray(data=[float(number)]) for number in range(3)]
    messages.insert(bad, Float64MultiArray())
    for field, value in content.items():
        setattr(messages[bad], field, value)
    with pytest.raises(HricError, match=f"numbers{bad}: "):
        publisher.publish_all(messages)
    assert wait(lambda: heard == [(0.0,), (1.0,), (2.0,)])
    subscription.unregister()
    publisher.unregister()


def test_deferred_calls_are_made_by_the_publishing_thread_and_each_failure_is_told(
    node: RosNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    monkeypatch.setattr(rospy, "logerr", lambda text, *args: lines.append(text % args))
    threads: list[str] = []
    realtime.defer(node, lambda: threads.append(threading.current_thread().name))
    for _ in range(2):
        realtime.defer(node, lambda: 1 / 0, "result of the action")
    assert realtime.drain(2.0)
    assert (
        threads == ["publish"]
        and lines == [f"{node.namespace}: result of the action failed: ZeroDivisionError: division by zero"] * 2
    )


def test_after_a_shutdown_a_new_publisher_starts_a_new_thread(node: RosNode) -> None:
    realtime.shutdown()
    assert not [thread for thread in threading.enumerate() if thread.name == "publish"]
    done: list[int] = []
    realtime.defer(node, lambda: done.append(1))
    assert realtime.drain(2.0) and done == [1]
    realtime.shutdown()


def test_the_error_names_the_address_of_a_silent_master(ros: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from hric_core.ros import node as ros_node

    def refuse() -> None:
        raise ConnectionRefusedError("refused")

    with pytest.raises(HricError, match=r"the ROS master at http://127\.0\.0\.1:\d+.* does not respond: refused"):
        ros_node._query(refuse)
