"""Consecutive samples of a source that samples evenly, between drivers, filters and messages. No node."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hric_control.errors import CommandError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Layout:
    """What a source samples.

    Args:
        source: for people, e.g. "lsl EMG emulated_emg".
        channels: names.
        units: as many.
        rate: as the source declares it [Hz].
        frame: of vectors, else "".
    """

    source: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    frame: str = ""

    @property
    def unit(self) -> str:
        """One word if all channels agree, else one per channel; "N m" is the word "N*m", and none is "-"."""
        words = [unit.replace(" ", "*") or "-" for unit in self.units]
        return words[0] if len(set(words)) == 1 else " ".join(words)


@dataclass(frozen=True)
class Chunk:
    """Samples without a gap; sample k was taken at start + k / rate, the rate being the layout's times `pace`.

    Args:
        layout: what is sampled.
        start: robot time of the first sample [s].
        first: its running number.
        data: shape (samples, channels).
        pace: rate over that of the layout: above 1 where the run lost time, which the source did not know.
    """

    layout: Layout
    start: float
    first: int
    data: FloatArray
    pace: float = 1.0

    @property
    def rate(self) -> float:
        """Samples per second of robot time [Hz]."""
        return self.layout.rate * self.pace

    @property
    def times(self) -> FloatArray:
        """Robot time of each sample [s]."""
        return self.start + np.arange(len(self.data)) / self.rate

    @property
    def after(self) -> int:
        """Number of the sample that would follow."""
        return self.first + len(self.data)


class Merger:
    """Joins and cuts chunks that follow each other to the length that messages shall have.

    Args:
        duration: of a message [s]; a gap or another layout ends one early. 0: they stay as they are.
        on_chunk: gets them.
    """

    def __init__(self, duration: float, on_chunk: Callable[[Chunk], None]) -> None:
        self._duration, self._on_chunk = duration, on_chunk
        self._parts: list[Chunk] = []
        self._count = 0

    def add(self, chunk: Chunk) -> None:
        """Take the next one."""
        if self._parts and (chunk.first != self._parts[-1].after or self._differs(chunk) or self._strays(chunk)):
            self.flush()
        size = round(self._duration * chunk.layout.rate) or len(chunk.data)
        while chunk.data.size and self._count + len(chunk.data) >= size:
            head, chunk = cut(chunk, size - self._count)
            self._parts.append(head)
            self.flush()
        if len(chunk.data):
            self._parts.append(chunk)
            self._count += len(chunk.data)

    def flush(self) -> None:
        """Pass on what there is."""
        if self._parts:
            first = self._parts[0]
            parts, self._parts, self._count = self._parts, [], 0
            self._on_chunk(
                Chunk(first.layout, first.start, first.first, np.concatenate([part.data for part in parts]), first.pace)
            )

    def _differs(self, chunk: Chunk) -> bool:
        first = self._parts[0]
        return chunk.layout is not first.layout or chunk.pace != first.pace

    def _strays(self, chunk: Chunk) -> bool:
        """Whether its time differs from that which follows from the first part by more than half a sample."""
        rate = chunk.rate
        return abs(self._parts[0].start + self._count / rate - chunk.start) > 0.5 / rate


def cut(chunk: Chunk, count: int) -> tuple[Chunk, Chunk]:
    """The first `count` samples, and the others."""
    rest = replace(chunk, start=chunk.start + count / chunk.rate, first=chunk.first + count, data=chunk.data[count:])
    return replace(chunk, data=chunk.data[:count]), rest


def chunk_message(chunk: Chunk) -> Any:
    """hric_msgs/SampleChunk. The start must not lie before the time 0."""
    # Here, as exports use chunks where there is no ROS.
    from std_msgs.msg import Header

    from hric_control.robot_time import stamps
    from hric_msgs.msg import SampleChunk

    layout = chunk.layout
    return SampleChunk(
        header=Header(stamp=stamps.to_time(chunk.start), frame_id=layout.frame),
        source=layout.source,
        channels=list(layout.channels),
        unit=layout.unit,
        rate=chunk.rate,
        first_sample=chunk.first,
        data=chunk.data.ravel().tolist(),
    )


def read_chunk(message: Any) -> Chunk:
    """The other direction of `chunk_message`.

    Raises:
        CommandError: no rate, or the data are no whole number of samples.
    """
    channels = tuple(message.channels)
    if not channels or len(message.data) % len(channels) or not message.rate > 0:
        raise CommandError(
            f"{len(message.data)} values of {len(channels)} channels at {message.rate:g} Hz; valid: whole samples "
            "at a rate above 0"
        )
    words = message.unit.split() or ["-"]
    units = tuple(
        "" if word == "-" else word.replace("*", " ")
        for word in (words if len(words) == len(channels) else [words[0]] * len(channels))
    )
    layout = Layout(message.source, channels, units, message.rate, message.header.frame_id)
    data = np.asarray(message.data, dtype=float).reshape(-1, len(channels))
    return Chunk(layout, message.header.stamp.to_sec(), message.first_sample, data)
