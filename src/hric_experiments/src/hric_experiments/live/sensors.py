"""Sensors of a live experiment: wait until all publish, and at the end until their last samples have arrived."""

import struct
import threading
import time
from functools import partial
from typing import Any

import rosgraph
import rospy

from hric_experiments.live import node as live_node
from hric_perception.sent import TOPIC as SENT
from hric_run.definition.experiment import Experiment

_STAMP = struct.Struct("<xxxxII")
"""Binary format of sequence number and stamp in the header with which each message starts."""
DRAIN = 1.0
"""Time by which a received stamp must exceed the end of the experiment to prove that all earlier samples have arrived
[s of robot time]; longer than any latency (project default, unconfirmed)."""
DRAIN_TIMEOUT, POLL = 30.0, 0.05
"""Maximum wait for the last samples, and polling period [s of wall time]."""


class LiveSensors:
    """Sensor topics of a live experiment: motion capture, EMG, force plate, synchronised samples.

    Args:
        experiment: experiment, whose sections define the sensors.

    Attributes:
        topics: names of all topics.
        sampled: True if there are sources besides motion capture.
    """

    def __init__(self, experiment: Experiment) -> None:
        synchronised = [] if experiment.sync is None else experiment.sync.topics
        named = [str(part.source["topic"]) for part in experiment.sources] + synchronised
        self.topics = [rospy.resolve_name(topic) for topic in named]
        self.sampled = bool(experiment.sensors or synchronised)
        self._stamps: dict[str, float] = {}
        self._lock = threading.Lock()
        self._subscribers: dict[str, rospy.Subscriber] = {}
        self._listen()

    def missing(self) -> list[str]:
        """Return a message for each topic without data so far; unsubscribe from the other topics."""
        for topic in [topic for topic in self._subscribers if self._stamp(topic) is not None]:
            self._subscribers.pop(topic).unregister()
        return [f"no messages on {topic}" for topic in self._subscribers]

    def nodes(self) -> list[str]:
        """Return the names of the nodes that publish the sensor topics or the counts of sent samples."""
        counted = {*self.topics, rospy.resolve_name(SENT)} if self.topics else set()
        published = rosgraph.Master(rospy.get_name()).getSystemState()[0]
        return sorted({node for topic, nodes in published if topic in counted for node in nodes})

    def drain(self, end: float) -> list[str]:
        """Wait until all samples up to robot time `end` [s] have arrived; return the topics for which they have not."""
        with self._lock:
            self._stamps.clear()
        self._listen()
        deadline = time.monotonic() + DRAIN_TIMEOUT
        while behind := [topic for topic in self.topics if (self._stamp(topic) or 0.0) < end + DRAIN]:
            if time.monotonic() > deadline:
                break
            live_node.sleep(POLL)
        for subscriber in self._subscribers.values():
            subscriber.unregister()
        self._subscribers.clear()
        return behind

    def _listen(self) -> None:
        self._subscribers = {
            topic: rospy.Subscriber(topic, rospy.AnyMsg, partial(self._on_message, topic), queue_size=10)
            for topic in self.topics
        }

    def _on_message(self, topic: str, message: Any) -> None:
        if isinstance(message, rospy.AnyMsg):
            seconds, nanoseconds = _STAMP.unpack_from(message._buff)
            stamp = seconds + 1e-9 * nanoseconds
        else:  # another subscriber in this process uses the topic with its message type
            stamp = message.header.stamp.to_sec()
        with self._lock:
            self._stamps[topic] = max(self._stamps.get(topic, 0.0), stamp)

    def _stamp(self, topic: str) -> float | None:
        with self._lock:
            return self._stamps.get(topic)
