"""Helpers of tests of synchroniser nodes: sources whose values are their time, and subscribers."""

import time
from collections.abc import Callable
from typing import Any

import genpy
from sensor_msgs.msg import JointState

from hric_msgs.msg import SampleChunk

LIMIT = 30.0
"""Time after which a test that waits has failed [s]."""


def wait(condition: Callable[[], Any]) -> None:
    """Wait until a condition is true."""
    deadline = time.monotonic() + LIMIT
    while not condition():
        assert time.monotonic() < deadline, "waited too long"
        time.sleep(0.02)


def listen(topic: str, kind: type) -> list[Any]:
    """Return a list to which each message of a topic is appended."""
    import rospy

    seen: list[Any] = []
    rospy.Subscriber(topic, kind, seen.append, queue_size=10_000)
    return seen


class Feeder:
    """Publisher of two topics whose values are the time since the first message [s]."""

    def __init__(self) -> None:
        import rospy

        self.joints = rospy.Publisher("/sync_joints", JointState, queue_size=10_000)
        self.chunks = rospy.Publisher("/sync_chunks", SampleChunk, queue_size=10_000)
        self.begin = time.time()
        self._sent = 0

    def feed(self, seconds: float, chunks: bool = True, shift: float = 0.0) -> None:
        """Publish 100 messages per second on each topic; shift: error of the chunks' stamps [s]."""
        if not self._sent:  # else all that a node's start took would be sent at once
            self.begin = time.time()
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            stamp = self.begin + 0.01 * self._sent
            joints = JointState(name=["a"], position=[stamp - self.begin])
            chunk = SampleChunk(
                channels=["time"],
                unit="s",
                rate=1000.0,
                data=[stamp - self.begin + 0.001 * index for index in range(10)],
            )
            joints.header.stamp, chunk.header.stamp = genpy.Time.from_sec(stamp), genpy.Time.from_sec(stamp + shift)
            self.joints.publish(joints)
            if chunks:
                self.chunks.publish(chunk)
            self._sent += 1
            time.sleep(max(stamp - time.time(), 0.0))

    def heard(self) -> bool:
        """Return True if both topics have a subscriber."""
        return bool(self.joints.get_num_connections() and self.chunks.get_num_connections())
