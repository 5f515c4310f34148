"""Decimation of streams to a viewer's rate: the newest message, or the mean since the last one. No node."""

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
    """Newest message of a topic, returned once; thread-safe."""

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
    """Newest WrenchStamped with opposite sign, returned once: from the wrench of the arm to that on the arm."""

    def take(self) -> Any:
        """Return geometry_msgs/WrenchStamped; None if nothing came since the last call."""
        message = super().take()
        if message is None:
            return None
        force, torque = message.wrench.force, message.wrench.torque
        return WrenchStamped(
            message.header, Wrench(Vector3(-force.x, -force.y, -force.z), Vector3(-torque.x, -torque.y, -torque.z))
        )


class NewestJoints:
    """Newest state of each joint as one message, returned once; arm and hand are published apart. Thread-safe.

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
        """Return sensor_msgs/JointState of all joints received, with the newest stamp; None if nothing came since."""
        with self._lock:
            header, self._header = self._header, None
            names = [name for name in self._names if name in self._states]
            states = [self._states[name] for name in names]
        if header is None:
            return None
        position, velocity, effort = map(list, zip(*states, strict=True))
        return JointState(Header(stamp=header.stamp), names, position, velocity, effort)


class MeanChunk:
    """Mean of the received samples as a SampleChunk of one sample, returned once; thread-safe.

    The stamp is the mean time of the samples; `first_sample` the number of the first of them; `rate` that at which
    means are taken.

    Args:
        rate: rate of `take` [Hz].
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
        """Return hric_msgs/SampleChunk; None if nothing came. A channel without a finite value is NaN."""
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
