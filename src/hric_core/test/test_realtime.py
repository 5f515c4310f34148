import gc
import json
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress

import pytest
from cost_ratio import cost_ratio
from std_msgs.msg import Float64

from hric_core import publishing, realtime
from hric_core.listeners import Listener, Parcel
from hric_core.local.node import LocalNode
from hric_core.publishing import OnError, PublishThread
from hric_core.realtime_setup import realtime as real_time_measures

pytestmark = pytest.mark.alone


@pytest.mark.parametrize("excluded", [False, True])
def test_the_garbage_collector_is_given_back_as_it_was(excluded: bool) -> None:
    gc.unfreeze()
    if excluded:
        gc.freeze()
    before = gc.get_freeze_count()
    with real_time_measures(0, False, 0.005) as measures:
        assert gc.get_freeze_count() >= before and gc.get_freeze_count() > 1000
        assert "objects excluded from garbage collection" in measures[-1].text
    assert gc.get_freeze_count() == pytest.approx(before, rel=0.01)  # those that have ended meanwhile are fewer
    gc.freeze()  # as conftest.py has it


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
    node = LocalNode()
    node.subscribe("x", Float64, print)
    publisher = realtime.publisher(node, "x", Float64)
    with pytest.raises(ZeroDivisionError):
        publisher.publish(lambda: 1 / 0)


def test_on_a_local_node_a_message_is_built_only_for_those_who_listen_now_or_to_a_latched_topic() -> None:
    node = LocalNode()
    built: list[str] = []

    def build(name: str) -> Float64:
        built.append(name)
        return Float64()

    plain, latched = (realtime.publisher(node, name, Float64, latch=name == "latched") for name in ("plain", "latched"))
    plain.publish(build, "for nobody")
    latched.publish(build, "for later")
    listening = node.subscribe("plain", Float64, lambda _: None)
    plain.publish(build, "for a listener")
    listening.unregister()
    plain.publish(build, "for nobody")
    node.tap(lambda topic, message, time: None)
    plain.publish(build, "for a tap")
    assert built == ["for later", "for a listener", "for a tap"]


def test_on_a_local_node_a_deferred_call_is_made_at_once() -> None:
    done: list[int] = []
    realtime.defer(LocalNode(), lambda: done.append(1))
    assert done == [1]


MADE: list[Listener] = []
"""Sinks of the running test."""


class Sink(Listener):
    """Topic with one listener on a real socket, which can stop reading."""

    def __init__(self) -> None:
        self.socket, self._peer = socket.socketpair()
        super().__init__("sink", self.socket)
        MADE.append(self)
        self._peer.setblocking(False)
        self._heard, self._filling, self.writes = bytearray(), 0, 0

    def pack(self, messages: list[object], on_error: OnError) -> Parcel:
        self.writes += 1
        return Parcel((self,), b"".join(json.dumps(message).encode() + b";" for message in messages), len(messages))

    def let_go(self) -> None:
        self.socket = None

    def hold(self) -> None:
        """Fill the socket, so that it accepts no more data."""
        self.socket.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                self._filling += self.socket.send(b"-" * 4096)

    def go_on(self) -> None:
        """Read the filling from the socket, so that queued messages arrive."""
        while self._filling:
            self._filling -= len(self._peer.recv(self._filling))

    def unregister(self) -> None:
        pass

    def leave(self) -> None:
        """Close the listener's end."""
        self._peer.close()

    @property
    def sent(self) -> list[object]:
        """Messages that have arrived so far."""
        with suppress(BlockingIOError):
            while heard := self._peer.recv(1 << 20):
                self._heard += heard
        return [json.loads(part) for part in self._heard.decode().split(";")[:-1]]


def within(seconds: float, condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.001)
    return condition()


@pytest.fixture
def thread():
    thread = PublishThread()
    yield thread
    thread.stop()
    while MADE:  # one with something to wait for would be behind in the tests to come
        MADE.pop().close()


def test_messages_are_built_and_sent_by_the_thread_in_order(thread: PublishThread) -> None:
    sink, builders = Sink(), set()
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)

    def build(i: int) -> int:
        builders.add(threading.current_thread().name)
        return i

    for i in range(10):
        publisher.publish(lambda i=i: build(i))
    assert within(30.0, lambda: sink.sent == list(range(10))) and builders == {"publish"}


def test_behind_a_busy_thread_the_newest_win_and_the_drops_are_counted_and_reported(thread: PublishThread) -> None:
    sink, reports, busy = Sink(), [], threading.Event()
    publisher = realtime.RealtimePublisher(sink, "/x", report=reports.append, thread=thread)
    thread.call(lambda: busy.wait(30.0))
    assert within(30.0, lambda: not thread._calls)
    for i in range(300):
        publisher.publish(lambda i=i: i)
    assert publisher.dropped == 300 - realtime.LAGGING_LIMIT
    busy.set()
    assert thread.drain(2.0)
    assert sink.sent == [*range(300 - realtime.LAGGING_LIMIT, 300)]
    assert reports == ["/x: messages were dropped, as more than 100 were queued (reported once)"]


def test_messages_that_wait_together_are_sent_in_one_write_but_for_a_builder_that_fails(thread: PublishThread) -> None:
    sink, told = Sink(), []
    publisher = realtime.RealtimePublisher(sink, "/x", report=told.append, thread=thread)
    assert thread.hand_over(1.0)  # from now on it does not look by itself
    for i in (2, 1, 0, 4):
        publisher.publish(lambda i=i: 4 // i)
    assert thread.drain(2.0)
    assert (sink.sent, sink.writes, len(told)) == ([2, 4, 1], 1, 1)


def test_a_lossless_publisher_keeps_all(thread: PublishThread) -> None:
    sink = Sink()
    publisher = realtime.RealtimePublisher(sink, "/x", limit=realtime.LOSSLESS_LIMIT, thread=thread)
    sink.hold()
    for i in range(5000):
        publisher.publish(lambda i=i: i)
    assert within(30.0, lambda: not publisher._outbox)  # all of them wait for the listener now
    sink.go_on()
    assert within(30.0, lambda: thread.drain(5.0))
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
    sink.hold()
    publisher.publish(lambda: 1)
    begin = time.monotonic()
    assert not thread.drain(0.1)
    assert 0.09 < time.monotonic() - begin < 5.0
    begin = time.monotonic()
    assert not thread.drain(5.0)
    assert time.monotonic() - begin < 4.0
    sink.go_on()
    assert within(30.0, lambda: thread.drain(0.1)) and sink.sent == [1]


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


def test_of_messages_that_only_matter_now_the_newest_alone_is_sent_and_nothing_is_told(thread: PublishThread) -> None:
    sink, told = Sink(), []
    publisher = realtime.RealtimePublisher(sink, "/clock", limit=1, report=told.append, thread=thread)
    assert thread.hand_over(1.0)
    for k in range(5):
        publisher.publish(lambda k=k: k)
    assert thread.drain(1.0)
    assert (sink.sent, told) == ([4], [])


def test_between_two_hand_overs_messages_wait_and_when_none_comes_they_are_sent(
    thread: PublishThread, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(publishing, "PATIENCE", 3.0)
    sink = Sink()
    publisher = realtime.RealtimePublisher(sink, "/x", thread=thread)
    assert thread.hand_over(1.0)
    time.sleep(0.01)
    publisher.publish(lambda: 1)
    time.sleep(0.02)  # ten times the period of polling
    assert sink.sent == []
    assert within(30.0, lambda: sink.sent == [1])


def test_a_loop_waits_once_for_a_listener_that_is_behind_and_its_messages_wait(thread: PublishThread) -> None:
    sink, other = Sink(), Sink()
    publishers = [realtime.RealtimePublisher(one, "/x", thread=thread) for one in (sink, other)]
    sink.hold()
    for number in range(3):
        begin = time.monotonic()
        for publisher in publishers:
            publisher.publish(lambda number=number: number)
        assert thread.hand_over(20.0 if number == 2 else 0.1)
    assert time.monotonic() - begin < 15.0
    assert within(30.0, lambda: other.sent == [0, 1, 2])
    sink.go_on()
    assert within(30.0, lambda: thread.drain(0.1)) and sink.sent == [0, 1, 2]


def test_a_listener_that_has_gone_is_closed_and_the_others_hear(thread: PublishThread) -> None:
    gone, there = Sink(), Sink()
    publishers = [realtime.RealtimePublisher(sink, sink, thread=thread) for sink in (gone, there)]
    gone.leave()
    for publisher in publishers:
        publisher.publish(lambda: 1)
    assert thread.drain(2.0)
    assert (gone.socket, there.sent) == (None, [1])
