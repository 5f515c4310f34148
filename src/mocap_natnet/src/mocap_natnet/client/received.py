"""What a client hands on."""

from __future__ import annotations

from typing import NamedTuple

from mocap_natnet.codec.types import Frame


class Received(NamedTuple):
    """A frame.

    Attributes:
        frame: as read.
        received: when it arrived, monotonic clock [ns].
        exposed: middle of the exposure, the same clock [ns].
        means: what told that time, see `clock.ExposureClock`.
    """

    frame: Frame
    received: int
    exposed: int
    means: str
