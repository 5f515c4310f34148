"""Topics that send in the publishing thread, and listeners that do not keep up."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from std_msgs.msg import String

from hric_control.ros import RosNode
from hric_control.ros.prompt import PromptConnection, send_promptly
from hric_control.testing import ros, roscore  # noqa: F401

pytestmark = pytest.mark.alone

SIZE = 50_000
"""Of a message [bytes]: some fill the buffers of a socket."""


class Wire:
    """What rospy's connection to a listener is made of, and the listener's end."""

    def __init__(self) -> None:
        self.socket, self.listener = socket.socketpair()
        self.socket.settimeout(60.0)  # as rospy's default for all sockets of a process
        self.done, self.stat_bytes, self.stat_num_msg = False, 0, 0
        self.threads: list[threading.Thread] = []

    def write_data(self, data: bytes) -> None:
        self.threads.append(threading.current_thread())
        assert self.done or self.socket.gettimeout() == 60.0, "rospy's own calls must end"
        self.socket.sendall(data)
        self.stat_bytes, self.stat_num_msg = self.stat_bytes + len(data), self.stat_num_msg + 1

    def close(self) -> None:
        self.done = True
        self.socket.close()

    def hear(self, number: int) -> list[int]:
        """Numbers of so many messages."""
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


def overfill(wire: Wire, connection: PromptConnection) -> int:
    """How many messages were sent until one had to wait."""
    for number in range(1000):
        connection.write_data(message(number))
        if connection._behind:
            return number + 1
    raise AssertionError("the buffers of a socket have no end")


def test_a_message_goes_out_in_the_publishing_thread(wire: Wire) -> None:
    connection = PromptConnection(wire, 10)
    connection.write_data(message(7))
    assert wire.hear(1) == [7]
    assert not connection._behind and not wire.threads
    assert (connection.stat_bytes, connection.stat_num_msg) == (SIZE, 1)


def test_a_listener_that_stands_still_holds_nobody_up_and_loses_the_oldest_of_his_queue(wire: Wire) -> None:
    connection = PromptConnection(wire, 3)
    sent = overfill(wire, connection)
    begin = time.monotonic()
    for number in range(1000, 1010):
        connection.write_data(message(number))
    assert time.monotonic() - begin < 10.0
    assert wire.hear(sent + 3) == [*range(sent), 1007, 1008, 1009]
    deadline = time.monotonic() + 30.0
    while connection.stat_bytes != (sent + 3) * SIZE:  # counted after it was sent
        assert time.monotonic() < deadline


def test_a_listener_who_kept_up_again_is_sent_to_promptly_and_in_order(wire: Wire) -> None:
    connection = PromptConnection(wire, 0)
    sent = overfill(wire, connection)
    connection.write_data(message(1000))
    assert wire.hear(sent + 1) == [*range(sent), 1000]
    (late,) = set(wire.threads)
    late.join(30.0)
    assert not late.is_alive()
    wire.threads.clear()
    connection.write_data(message(1001))
    assert wire.hear(1) == [1001] and not wire.threads


def test_a_connection_that_breaks_while_messages_wait_is_closed(wire: Wire) -> None:
    connection = PromptConnection(wire, 10)
    overfill(wire, connection)
    connection.write_data(message(1000))
    wire.listener.close()
    until(lambda: wire.done)
    with pytest.raises(OSError):
        until(lambda: connection.write_data(message(1001)) is False)


@pytest.mark.rostest
def test_listeners_of_a_topic_hear_all_and_are_forgotten_when_they_leave(
    ros: str,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import rospy

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


def until(condition: Any) -> None:
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)
