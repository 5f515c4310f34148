"""Decimation of topics to a viewer's rate: the newest message, or the mean since the last one sent. No node."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from hric_perception.chunk import Chunk, chunk_message, read_chunk

NAN = float("nan")


class Newest:
    """Buffer of a topic's newest message, which `take` returns once; thread-safe."""

    def __init__(self) -> None:
        self._message: Any = None

    def push(self, message: Any) -> None:
        """Store a message."""
        self._message = message

    def take(self) -> Any:
        """Return the newest message since the last call; None if there was none."""
        message, self._message = self._message, None
        return message


class ReactionWrench(Newest):
    """Buffer of the newest WrenchStamped; `take` turns the wrench by the arm into that on the arm (opposite sign)."""

    def take(self) -> Any:
        """Return geometry_msgs/WrenchStamped; None if no message came since the last call."""
        message = super().take()
        if message is None:
            return None
        force, torque = message.wrench.force, message.wrench.torque
        return WrenchStamped(
            message.header, Wrench(Vector3(-force.x, -force.y, -force.z), Vector3(-torque.x, -torque.y, -torque.z))
        )


class NewestJoints:
    """Buffer that merges the newest states of all joints, since arm and hand publish separately. Thread-safe.

    Args:
        names: joints to include, in order.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names, self._lock = tuple(names), threading.Lock()
        self._states: dict[str, tuple[float, float, float]] = {}
        self._header: Any = None

    def push(self, message: Any) -> None:
        """Store the joint states of a message."""
        missing = [NAN] * len(message.name)
        rows = [
            list(values) if len(values) == len(missing) else missing
            for values in (message.position, message.velocity, message.effort)
        ]
        known = {
            name: state
            for name, state in zip(message.name, zip(*rows, strict=True), strict=True)
            if name in self._names
        }
        if known:
            with self._lock:
                self._states.update(known)
                self._header = message.header

    def take(self) -> Any:
        """Return sensor_msgs/JointState of all joints received so far; None if no message came since the last call."""
        with self._lock:
            header, self._header = self._header, None
            names = [name for name in self._names if name in self._states]
            states = [self._states[name] for name in names]
        if header is None:
            return None
        position, velocity, effort = map(list, zip(*states, strict=True))
        return JointState(Header(stamp=header.stamp), names, position, velocity, effort)


class MeanChunk:
    """Buffer that averages received samples to a SampleChunk with one sample; thread-safe.

    The stamp is the mean time of the samples, `first_sample` the number of the first of them, and `rate` the rate of
    the means.

    Args:
        rate: rate at which `take` is called [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate, self._lock = rate, threading.Lock()
        self._chunks: list[Any] = []

    def push(self, message: Any) -> None:
        """Add the samples of a message."""
        with self._lock:
            if self._chunks and self._chunks[-1].channels != message.channels:
                self._chunks = []
            self._chunks.append(message)

    def take(self) -> Any:
        """Return hric_msgs/SampleChunk; None if no sample came since the last call. Channels with only NaN are NaN."""
        with self._lock:
            messages, self._chunks = self._chunks, []
        chunks = [chunk for chunk in map(read_chunk, messages) if len(chunk.data)]
        if not chunks:
            return None
        time = float(np.mean(np.concatenate([chunk.times for chunk in chunks])))
        data = np.concatenate([chunk.data for chunk in chunks])
        counts = np.sum(~np.isnan(data), axis=0)
        mean = np.where(counts > 0, np.nansum(data, axis=0) / np.maximum(counts, 1), np.nan)
        message = chunk_message(Chunk(chunks[-1].layout, time, chunks[0].first, mean[None, :]))
        message.rate = self._rate
        return message


Keeper = Newest | NewestJoints | MeanChunk
