"""Topics that send in the publishing thread, and listeners that do not keep up."""

import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest
import rospy
from std_msgs.msg import String

from hric_core import listeners
from hric_core.listeners import DISPATCHER
from hric_core.ros import RosNode
from hric_core.ros.prompt import PromptConnection, send_promptly

pytestmark = pytest.mark.alone

SIZE = 50_000
"""Size of a message [bytes]; a few of them fill the buffers of a socket."""


class Wire:
    """Parts of rospy's connection to a listener, and the listener's end of the socket."""

    endpoint_id, name = "/listener", "/topic"

    def __init__(self) -> None:
        self.socket, self.listener = socket.socketpair()
        self.socket.settimeout(60.0)  # as rospy's default for all sockets of a process
        self.done, self.stat_bytes, self.stat_num_msg = False, 0, 0

    def close(self) -> None:
        self.done = True
        self.socket.close()

    def hear(self, number: int) -> list[int]:
        """Receive `number` messages and return the numbers in them."""
        heard = []
        for _ in range(number):
            heard.append(struct.unpack("<I", self._take(4))[0])
            assert self._take(SIZE - 4) == bytes(SIZE - 4)
        return heard

    def _take(self, size: int) -> bytes:
        taken = b""
        while len(taken) < size:
            taken += self.listener.recv(size - len(taken))
        return taken


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.listener.close()
    made.close()


def message(number: int) -> bytes:
    return struct.pack("<I", number).ljust(SIZE, b"\0")


def overfill(connection: PromptConnection) -> int:
    """Send messages until one is queued; return their number."""
    for number in range(1000):
        connection.write_data(message(number))
        if connection.waiting:
            return number + 1
    raise AssertionError("the buffers of a socket have no end")


def test_a_message_goes_out_in_the_publishing_thread(wire: Wire) -> None:
    connection = PromptConnection(wire)
    connection.write_data(message(7))
    assert wire.hear(1) == [7]
    assert not connection.waiting
    assert (connection.stat_bytes, connection.stat_num_msg) == (SIZE, 1)


def test_a_listener_that_stands_still_holds_nobody_up_and_loses_its_oldest_messages_beyond_the_limit(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listeners, "LIMIT", 4 * SIZE)
    connection, before = PromptConnection(wire), DISPATCHER.status()
    sent = overfill(connection)
    begin = time.monotonic()
    for number in range(1000, 1010):
        connection.write_data(message(number))
    assert time.monotonic() - begin < 10.0
    after = DISPATCHER.status()
    assert after.behind == ("/listener on /topic",) and 3 * SIZE < after.waiting <= 4 * SIZE
    numbers = wire.hear(sent + 3)
    assert numbers == [*range(sent), 1007, 1008, 1009]
    assert (connection.lost, after.lost - before.lost) == (7, 7)
    until(lambda: not DISPATCHER.status().behind)


def test_a_message_larger_than_the_limit_comes_whole_and_the_newest_waits_whatever_its_size(
    wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listeners, "LIMIT", SIZE // 2)
    connection = PromptConnection(wire)
    sent = overfill(connection)
    for number in (1000, 1001):
        connection.write_data(message(number))
    assert wire.hear(sent + 1) == [*range(sent), 1001]


def test_a_listener_who_kept_up_again_is_sent_to_promptly_and_in_order(wire: Wire) -> None:
    connection = PromptConnection(wire)
    sent = overfill(connection)
    connection.write_data(message(1000))
    assert wire.hear(sent + 1) == [*range(sent), 1000]
    until(lambda: not connection.waiting)
    connection.write_data(message(1001))
    assert wire.hear(1) == [1001] and not connection.waiting


def test_a_connection_that_breaks_while_messages_wait_is_closed(wire: Wire) -> None:
    connection = PromptConnection(wire)
    overfill(connection)
    wire.listener.close()
    until(lambda: wire.done)
    with pytest.raises(rospy.exceptions.TransportTerminated):
        connection.write_data(message(1001))


def test_a_socket_that_its_owner_closes_while_messages_wait_costs_the_others_nothing(wire: Wire) -> None:
    connection = PromptConnection(wire)
    overfill(connection)
    wire.socket.close()
    connection.close()
    other = Wire()
    later = PromptConnection(other)
    sent = overfill(later)
    assert other.hear(sent) == [*range(sent)]
    until(lambda: not DISPATCHER.status().behind)
    later.close()
    other.listener.close()


def test_a_listener_that_takes_nothing_for_long_is_closed_with_a_word(
    wire: Wire, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(listeners, "DEAD", 0.5)
    connection = PromptConnection(wire)
    overfill(connection)
    until(lambda: wire.done)
    assert (
        not connection.open
        and "/listener on /topic read nothing for 0.5 s; closing the connection to it" in caplog.text
    )


LISTENER = """
import sys, time, rospy
from std_msgs.msg import String
rospy.init_node("listener", anonymous=True)
heard = []
rospy.Subscriber("/isolated", String, lambda message: heard.append((time.monotonic(), int(message.data[:9]))))
print("ready", flush=True)
sys.stdin.readline()
gaps = [b[0] - a[0] for a, b in zip(heard, heard[1:])]
print(len(heard), heard[-1][1] - heard[0][1] + 1, max(gaps), flush=True)
"""


@pytest.mark.rostest
def test_of_three_listeners_one_that_is_stopped_costs_the_others_nothing(ros: str, figure) -> None:
    publisher = RosNode().advertise("/isolated", String, queue_size=0)
    with ExitStack() as stack:
        children = [
            stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", LISTENER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
                )
            )
            for _ in range(3)
        ]
        stack.callback(lambda: [child.kill() for child in children])
        assert [child.stdout.readline() for child in children] == ["ready\n"] * 3
        until(lambda: publisher.subscribers() == 3)
        gaps, number = [], 0
        for stopped in (False, True):
            end, last = time.monotonic() + (5.0 if stopped else 1.0), time.monotonic()
            while time.monotonic() < end:
                publisher.publish(String(f"{number:09d}".ljust(20_000)))
                number += 1
                gaps.append(time.monotonic() - last)
                time.sleep(0.002)
                last = time.monotonic()
            if not stopped:
                children[0].send_signal(signal.SIGSTOP)
        assert DISPATCHER.status().behind and max(gaps) < 2.0  # a write that waited would take the five seconds
        for child in children[1:]:
            count, span, gap = map(float, child.communicate("end\n", timeout=30.0)[0].split())
            figure("largest gap of a listener beside one that is stopped", gap, "s")
            assert count == span and gap < 2.0
        children[0].kill()
    publisher.unregister()


@pytest.mark.rostest
def test_listeners_of_a_topic_hear_all_and_are_forgotten_when_they_leave(
    ros: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rospy.topics, "QueuedConnection", rospy.topics.QueuedConnection)
    send_promptly()
    publisher = RosNode().advertise("/prompt", String, queue_size=100)
    heard: list[str] = []
    listener = rospy.Subscriber("/prompt", String, lambda told: heard.append(told.data), queue_size=None)
    until(lambda: publisher.subscribers() == 1)
    for number in range(200):
        publisher.publish(String(str(number)))
    until(lambda: len(heard) == 200)
    assert heard == [str(number) for number in range(200)]
    listener.unregister()

    def forgotten() -> bool:
        publisher.publish(String("gone"))
        return publisher.subscribers() == 0

    until(forgotten)
    publisher.unregister()


@pytest.mark.rostest
def test_a_listener_that_comes_before_rospy_knows_the_size_of_the_queue_is_sent_to_as_any_other(ros: str) -> None:
    publisher = RosNode().advertise("/early", String, queue_size=100)
    publisher._publisher.impl.queue_size = None  # as it is between rospy's first and second line of a publisher
    heard: list[str] = []
    listener = rospy.Subscriber("/early", String, lambda message: heard.append(message.data), queue_size=None)
    until(lambda: publisher.subscribers() == 1)
    publisher.publish(String("a"))
    until(lambda: heard == ["a"])
    assert all(isinstance(one, PromptConnection) for one in publisher._publisher.impl.connections)
    listener.unregister()
    until(lambda: publisher.subscribers() == 0)
    publisher.unregister()


def until(condition: Any) -> None:
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
