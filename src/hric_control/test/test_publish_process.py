"""Publishers that send from a process of their own, against a real master."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rosgraph
import rospy
from geometry_msgs.msg import PointStamped
from std_msgs.msg import Float64, Float64MultiArray

from hric_control import realtime
from hric_control.errors import HricError
from hric_control.publish_process import PublishProcess
from hric_control.ros_node import RosNode

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


def wait(condition: Callable[[], object], timeout: float = 15.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


class Listener:
    """What is heard on a topic, once connected."""

    def __init__(self, topic: str, message_type: type = Float64) -> None:
        self.heard: list[Any] = []
        self._subscriber = rospy.Subscriber(topic, message_type, lambda message: self.heard.append(message.data))

    def connected(self) -> bool:
        return bool(self._subscriber.get_num_connections() > 0)

    def close(self) -> None:
        self._subscriber.unregister()


class Told:
    """A node whose errors are kept."""

    def __init__(self, node: RosNode) -> None:
        self.errors: list[str] = []
        node.log_error = self.errors.append  # type: ignore[method-assign]


def process() -> PublishProcess:
    assert realtime._process is not None
    return realtime._process


def child() -> int:
    return process()._process.pid


def publisher_of(topic: str) -> list[str]:
    return dict(rosgraph.Master("/test").getSystemState()[0]).get(topic, [])


def point(x: float) -> PointStamped:
    message = PointStamped()
    message.point.x = x
    return message


def array(data: list[float]) -> Float64MultiArray:
    return Float64MultiArray(data=data)


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def node(ros: str, told: list[str], request: pytest.FixtureRequest) -> Iterator[RosNode]:
    realtime.shutdown()
    realtime.use_process(PublishProcess("test_topics", "/", told.append))
    yield RosNode(f"/{request.node.name[:40]}")
    realtime.shutdown()


def test_messages_arrive_in_order_from_the_other_process(node: RosNode) -> None:
    publisher = realtime.publisher(node, "x", Float64, lossless=True)
    assert publisher_of(node.resolve("x")) == ["/test_topics"]
    listener = Listener(node.resolve("x"))
    assert wait(listener.connected) and wait(lambda: publisher.subscribers() == 1)
    for i in range(500):
        publisher.publish(Float64, float(i))
    assert wait(lambda: len(listener.heard) == 500) and listener.heard == [float(i) for i in range(500)]
    listener.close()
    assert wait(lambda: publisher.subscribers() == 0)


def test_a_closure_is_built_here_and_its_message_sent_there(node: RosNode) -> None:
    publisher, here = realtime.publisher(node, "x", Float64), []
    listener = Listener(node.resolve("x"))
    assert wait(listener.connected)

    def build() -> Float64:
        here.append(os.getpid())
        return Float64(7.0)

    publisher.publish(build)
    assert wait(lambda: listener.heard == [7.0]) and here == [os.getpid()]
    listener.close()


def test_a_latched_message_reaches_who_comes_later_and_a_topic_taken_back_is_gone(node: RosNode) -> None:
    publisher = realtime.publisher(node, "x", Float64, latch=True)
    publisher.publish(Float64, 3.0)
    assert realtime.drain(5.0)
    listener = Listener(node.resolve("x"))
    assert wait(lambda: listener.heard == [3.0])
    publisher.unregister()
    publisher.unregister()
    publisher.publish(Float64, 4.0)
    assert wait(lambda: publisher_of(node.resolve("x")) == [])
    assert process()._process.poll() is None and listener.heard == [3.0]
    listener.close()


def test_a_message_that_cannot_be_built_or_sent_is_told_once_and_harms_no_other(node: RosNode) -> None:
    told = Told(node)
    bad, good = realtime.publisher(node, "bad", Float64), realtime.publisher(node, "good", Float64)
    listener = Listener(node.resolve("good"))
    assert wait(listener.connected)
    for _ in range(3):
        bad.publish(array, [1.0])
        good.publish(Float64, 1.0)
    assert wait(lambda: listener.heard == [1.0] * 3)
    assert wait(lambda: told.errors) and len(told.errors) == 1
    assert told.errors[0].startswith(f"{node.resolve('bad')}: message could not be sent: ") and "std_msgs/Float64" in told.errors[0]
    listener.close()


def test_what_is_no_message_type_is_refused_at_once(node: RosNode) -> None:
    with pytest.raises(HricError, match="x cannot be advertised: data_class"):
        realtime.publisher(node, "x", dict)


def test_what_waits_when_the_robot_ends_is_still_sent_also_after_ctrl_c(node: RosNode) -> None:
    publisher = realtime.publisher(node, "x", Float64, lossless=True)
    listener = Listener(node.resolve("x"))
    assert wait(listener.connected)
    running = process()._process
    os.kill(child(), signal.SIGINT)
    for i in range(200):
        publisher.publish(Float64, float(i))
    realtime.shutdown(5.0)
    assert wait(lambda: running.poll() == 0)
    assert wait(lambda: len(listener.heard) == 200)
    listener.close()


def test_behind_a_process_that_stands_still_the_loop_goes_on_and_the_newest_win(node: RosNode) -> None:
    publisher = realtime.publisher(node, "x", Float64MultiArray)
    listener = Listener(node.resolve("x"), Float64MultiArray)
    assert wait(listener.connected)
    os.kill(child(), signal.SIGSTOP)
    begin = time.monotonic()
    for i in range(1000):  # 16 MB: more than the pipe takes
        publisher.publish(array, [float(i)] * 2000)
        time.sleep(0.0001)
    assert not realtime.drain(0.1)
    assert time.monotonic() - begin < 10.0 and publisher.dropped > 0
    os.kill(child(), signal.SIGCONT)
    assert wait(lambda: listener.heard and listener.heard[-1][0] == 999.0)
    listener.close()


def test_a_process_that_was_killed_is_told_once_and_stops_nothing(node: RosNode, told: list[str]) -> None:
    publisher, other = realtime.publisher(node, "x", Float64), realtime.publisher(node, "y", Float64)
    os.kill(child(), signal.SIGKILL)
    assert wait(lambda: process()._process.poll() is not None)
    for _ in range(5):
        publisher.publish(Float64, 1.0)
        other.publish(Float64, 1.0)
        realtime.drain(0.1)
    assert len(told) == 1 and told[0].startswith("the publishing process test_topics has ended") and "exit code -9" in told[0]
    publisher.unregister()


def test_it_ends_when_the_robot_process_dies(ros: str) -> None:
    alone = PublishProcess("orphan_topics", "/", print)
    alone.advertise("/orphan", Float64, False, print)
    os.close(alone._out)  # what the kernel does when a process is killed
    assert wait(lambda: alone._process.poll() == 0)


def test_threads_that_publish_side_by_side_mix_no_frames(node: RosNode) -> None:
    topics = [realtime.publisher(node, f"x{i}", Float64, lossless=True) for i in range(4)]
    listeners = [Listener(node.resolve(f"x{i}")) for i in range(4)]
    assert all(wait(listener.connected) for listener in listeners)
    threads = [threading.Thread(target=lambda t=topic: [t.publish(Float64, float(k)) for k in range(300)]) for topic in topics]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert realtime.drain(5.0)
    for listener in listeners:
        assert wait(lambda heard=listener.heard: len(heard) == 300) and listener.heard == [float(k) for k in range(300)]
        listener.close()


def test_messages_that_come_together_arrive_whole_in_their_order_with_running_numbers(node: RosNode) -> None:
    publisher, heard = realtime.publisher(node, "points", PointStamped, lossless=True), []
    subscriber = rospy.Subscriber(node.resolve("points"), PointStamped, lambda message: heard.append((message.header.seq, message.point.x)))
    assert wait(lambda: subscriber.get_num_connections() and publisher.subscribers())
    realtime.set_polling(False)
    for i in range(200):
        publisher.publish(point, float(i))
    realtime.drain(5.0)
    assert wait(lambda: len(heard) == 200)
    subscriber.unregister()
    first = heard[0][0]
    assert heard == [(first + i, float(i)) for i in range(200)]


@pytest.mark.parametrize("bad", [0, 1, 3])
def test_one_of_many_that_cannot_be_sent_is_told_and_the_others_arrive(node: RosNode, bad: int) -> None:
    told = Told(node)
    publisher, listener = realtime.publisher(node, "numbers", Float64MultiArray, lossless=True), Listener(node.resolve("numbers"), Float64MultiArray)
    assert wait(listener.connected) and wait(publisher.subscribers)
    realtime.set_polling(False)
    numbers: list[list[Any]] = [[1.0], [2.0], [3.0]]
    numbers.insert(bad, ["not a number"])
    for data in numbers:
        publisher.publish(array, data)
    realtime.drain(5.0)
    assert wait(lambda: len(listener.heard) == 3, 5.0)
    listener.close()
    assert [data[0] for data in listener.heard] == [1.0, 2.0, 3.0]
    assert wait(lambda: told.errors) and len(told.errors) == 1
