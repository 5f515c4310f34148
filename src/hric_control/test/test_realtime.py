import threading
import time

import pytest
from cost_ratio import cost_ratio
from std_msgs.msg import Float64

from hric_control import realtime
from hric_control.local.node import LocalNode
from hric_control.publishing import PublishThread

pytestmark = pytest.mark.alone


def test_the_latest_value_is_the_newest_and_new_once() -> None:
    value = realtime.LatestValue(0)
    assert (value.get(), value.take_new()) == (0, None)
    value.set(1)
    value.set(2)
    assert (value.get(), value.take_new(), value.take_new(), value.get()) == (2, 2, None, 2)


def test_values_set_by_another_thread_arrive_each_at_most_once_and_in_order() -> None:
    value: realtime.LatestValue[int] = realtime.LatestValue(-1)
    writer = threading.Thread(target=lambda: [value.set(i) for i in range(20000)])
    writer.start()
    taken: list[int] = []
    while writer.is_alive() or value.get() != (taken[-1] if taken else None):
        new = value.take_new()
        if new is not None:
            taken.append(new)
    assert taken == sorted(set(taken)) and taken[-1] == 19999


def test_on_a_local_node_a_message_is_built_and_published_within_the_call() -> None:
    node, heard = LocalNode(), []
    node.subscribe("x", Float64, lambda message: heard.append(message.data))
    publisher = realtime.publisher(node, "x", Float64)
    for i in range(3):
        publisher.publish(lambda i=i: Float64(i))
        assert heard == [float(k) for k in range(i + 1)]
    assert publisher.subscribers() == 1


def test_on_a_local_node_errors_reach_the_caller() -> None:
    publisher = realtime.publisher(LocalNode(), "x", Float64)
    with pytest.raises(ZeroDivisionError):
        publisher.publish(lambda: 1 / 0)


def test_on_a_local_node_a_deferred_call_is_made_at_once() -> None:
    done: list[int] = []
    realtime.defer(LocalNode(), lambda: done.append(1))
    assert done == [1]


class Sink:
    """A publisher that can be held up."""

    def __init__(self) -> None:
        self.sent: list[object] = []
        self.open = threading.Event()
        self.open.set()

    def publish(self, message: object) -> None:
        self.open.wait()
        self.sent.append(message)

    def unregister(self) -> None:
        pass


@pytest.fixture
def thread():
    thread = PublishThread()
    yield thread
    thread.stop()


def test_messages_are_built_and_sent_by_the_thread_in_order(thread: PublishThread) -> None:
    sink, builders = Sink(), set()
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)

    def build(i: int) -> int:
        builders.add(threading.current_thread().name)
        return i

    for i in range(10):
        publisher.publish(lambda i=i: build(i))
    assert thread.drain(2.0)
    assert sink.sent == list(range(10)) and builders == {"publish"}


def test_messages_are_sent_without_a_drain(thread: PublishThread) -> None:
    sink = Sink()
    realtime.RealtimePublisher(sink, "/x", thread=thread).publish(lambda: 1)
    deadline = time.monotonic() + 2.0
    while not sink.sent and time.monotonic() < deadline:
        time.sleep(0.001)
    assert sink.sent == [1]


def test_behind_a_slow_subscriber_the_newest_win_and_the_drops_are_counted_and_told(thread: PublishThread) -> None:
    sink, told = Sink(), []
    publisher = realtime.RealtimePublisher(sink, "/x", report=told.append, thread=thread)
    sink.open.clear()
    publisher.publish(lambda: "first")
    time.sleep(0.05)
    for i in range(300):
        publisher.publish(lambda i=i: i)
    assert publisher.dropped == 300 - realtime.LAGGING_LIMIT
    sink.open.set()
    assert thread.drain(2.0)
    assert sink.sent == ["first", *range(300 - realtime.LAGGING_LIMIT, 300)]
    assert told == ["/x: messages were dropped, more than 100 waited (reported once)"]


def test_a_lossless_publisher_keeps_all(thread: PublishThread) -> None:
    sink = Sink()
    publisher = realtime.RealtimePublisher(sink, "/x", limit=realtime.LOSSLESS_LIMIT, thread=thread)
    sink.open.clear()
    for i in range(5000):
        publisher.publish(lambda i=i: i)
    sink.open.set()
    assert thread.drain(5.0)
    assert sink.sent == list(range(5000)) and publisher.dropped == 0


def test_a_failing_builder_is_told_once_per_topic_and_harms_no_other(thread: PublishThread) -> None:
    bad, good, told = Sink(), Sink(), []
    first = realtime.RealtimePublisher(bad, "/bad", report=told.append, thread=thread)
    second = realtime.RealtimePublisher(good, "/good", report=told.append, thread=thread)
    for _ in range(3):
        first.publish(lambda: 1 / 0)
        second.publish(lambda: 1)
    assert thread.drain(2.0)
    assert good.sent == [1, 1, 1] and told == [
        "/bad: message could not be sent: ZeroDivisionError: division by zero (reported once)"
    ]


def test_a_drain_behind_a_hanging_subscriber_waits_once(thread: PublishThread) -> None:
    sink = Sink()
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)
    sink.open.clear()
    publisher.publish(lambda: 1)
    begin = time.monotonic()
    assert not thread.drain(0.1)
    assert 0.09 < time.monotonic() - begin < 1.0
    begin = time.monotonic()
    assert not thread.drain(5.0)
    assert time.monotonic() - begin < 1.0
    sink.open.set()
    deadline = time.monotonic() + 2.0
    while not thread.drain(0.1) and time.monotonic() < deadline:
        time.sleep(0.001)
    assert sink.sent == [1]


def test_unregistering_sends_what_waits(thread: PublishThread) -> None:
    sink = Sink()
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)
    publisher.publish(lambda: 1)
    publisher.unregister()
    publisher.publish(lambda: 2)
    thread.drain(1.0)
    time.sleep(0.01)
    assert sink.sent == [1]


def test_publishing_costs_the_loop_a_few_calls(thread: PublishThread, figure) -> None:
    publisher = realtime.RealtimePublisher(Sink(), "/x", limit=realtime.LOSSLESS_LIMIT, thread=thread)
    ratio = cost_ratio(lambda: publisher.publish(time.monotonic), lambda: time.monotonic())
    figure("handing a message over beside a look at the clock", ratio, "1")
    assert ratio < 10.0


def test_of_messages_that_only_matter_now_the_newest_alone_is_sent_and_nothing_is_told(thread):
    told = []
    sink = Sink()
    thread.polling = False
    time.sleep(0.02)  # the look that was under way is over
    publisher = realtime.RealtimePublisher(sink, "/clock", limit=1, report=told.append, thread=thread)
    for k in range(5):
        publisher.publish(lambda k=k: k)
    assert thread.drain(1.0)
    assert (sink.sent, told) == ([4], [])


def test_without_polling_messages_wait_for_the_drain(thread):
    sink = Sink()
    thread.polling = False
    time.sleep(0.02)  # the look that was under way is over
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)
    publisher.publish(lambda: 1)
    time.sleep(0.02)  # ten times the period of polling
    assert sink.sent == []
    assert thread.drain(1.0)
    assert sink.sent == [1]
