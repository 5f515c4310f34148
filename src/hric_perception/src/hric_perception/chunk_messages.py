"""Chunks of samples as messages, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from std_msgs.msg import Header

from hric_control import stamps
from hric_control.errors import CommandError
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import Chunk, Layout


def chunk_message(chunk: Chunk) -> Any:
    """hric_msgs/SampleChunk. The start must not lie before the time 0."""
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
        raise CommandError(f"{len(message.data)} values of {len(channels)} channels at {message.rate:g} Hz; valid: whole samples at a rate above 0")
    words = message.unit.split() or ["-"]
    units = tuple("" if word == "-" else word.replace("*", " ") for word in (words if len(words) == len(channels) else [words[0]] * len(channels)))
    layout = Layout(message.source, channels, units, message.rate, message.header.frame_id)
    data = np.asarray(message.data, dtype=float).reshape(-1, len(channels))
    return Chunk(layout, message.header.stamp.to_sec(), message.first_sample, data)
