"""Chunks: consecutive samples of an evenly sampled sensor, as passed between drivers, filters and messages. No node."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hric_core.errors import CommandError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Layout:
    """Description of a sensor's sample stream: channels, units, rate and frame.

    Args:
        source: name for display, e.g. "lsl EMG emulated_emg".
        channels: names of the channels.
        units: unit of each channel.
        rate: sample rate declared by the source [Hz].
        frame: coordinate frame of channels that are components of vectors; "": none.
    """

    source: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    rate: float
    frame: str = ""

    @property
    def unit(self) -> str:
        """Unit that all channels share, or one per channel, separated by spaces; "N m" is "N*m", no unit "-"."""
        words = [unit.replace(" ", "*") or "-" for unit in self.units]
        return words[0] if len(set(words)) == 1 else " ".join(words)


def source_name(kind: str, name: str) -> str:
    """Return the name by which a driver's messages refer to an LSL stream of this type and name."""
    return f"lsl {kind} {name}"


@dataclass(frozen=True)
class Chunk:
    """Samples without a gap; sample k was taken at start + k / rate, the rate being the layout's times `pace`.

    Args:
        layout: channels of the samples.
        start: robot time of the first sample [s].
        first: sequence number of the first sample.
        data: values, shape (samples, channels).
        pace: samples per second of robot time, divided by the layout's rate: above 1 while samples are placed closer
            together, because robot time fell behind the clock of the source.
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
        """Robot time of each sample, shape (samples,) [s]."""
        return self.start + np.arange(len(self.data)) / self.rate

    @property
    def after(self) -> int:
        """Sequence number of the sample after the last one."""
        return self.first + len(self.data)


class Merger:
    """Buffer that merges consecutive chunks until they have the duration of a message.

    Args:
        duration: duration of a message [s]; a gap or another layout ends one early. 0: chunks are passed on unchanged.
        on_chunk: callback for each merged chunk.
    """

    def __init__(self, duration: float, on_chunk: Callable[[Chunk], None]) -> None:
        self._duration, self._on_chunk = duration, on_chunk
        self._parts: list[Chunk] = []
        self._count = 0

    def add(self, chunk: Chunk) -> None:
        """Add the next chunk; pass merged chunks on as soon as they are complete."""
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
        """Pass the stored samples on as one chunk, even if it is shorter than a message."""
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
        """Return True if the chunk starts more than half a sample period before or after the expected time."""
        rate = chunk.rate
        return abs(self._parts[0].start + self._count / rate - chunk.start) > 0.5 / rate


def cut(chunk: Chunk, count: int) -> tuple[Chunk, Chunk]:
    """Split a chunk into its first `count` samples and the remaining ones."""
    rest = replace(chunk, start=chunk.start + count / chunk.rate, first=chunk.first + count, data=chunk.data[count:])
    return replace(chunk, data=chunk.data[:count]), rest


def chunk_message(chunk: Chunk) -> Any:
    """Return the chunk as hric_msgs/SampleChunk; its start must not be negative, because ROS stamps cannot be."""
    # Imported here, because exports use chunks on machines without ROS.
    from std_msgs.msg import Header

    from hric_core.robot_time import stamps
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
    """Return the chunk in a hric_msgs/SampleChunk; the inverse of `chunk_message`.

    Raises:
        CommandError: the rate is not positive, or the data do not divide evenly among the channels.
    """
    channels = tuple(message.channels)
    if not channels or len(message.data) % len(channels) or not message.rate > 0:
        raise CommandError(
            f"SampleChunk with {len(message.data)} values of {len(channels)} channels at {message.rate:g} Hz; valid: "
            "a multiple of the number of channels, at a rate above 0"
        )
    words = message.unit.split() or ["-"]
    units = tuple(
        "" if word == "-" else word.replace("*", " ")
        for word in (words if len(words) == len(channels) else [words[0]] * len(channels))
    )
    layout = Layout(message.source, channels, units, message.rate, message.header.frame_id)
    data = np.asarray(message.data, dtype=float).reshape(-1, len(channels))
    return Chunk(layout, message.header.stamp.to_sec(), message.first_sample, data)
