"""Received NatNet frames and their statistics."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import NamedTuple

from mocap_natnet.codec.types import Frame


class Received(NamedTuple):
    """Received frame, with times of arrival and exposure.

    Attributes:
        frame: decoded frame.
        received: arrival by the monotonic clock [ns].
        exposed: middle of the exposure by the monotonic clock [ns].
        means: method by which the exposure is known: "mid-exposure", "transmission", "time stamp" or "reception".
    """

    frame: Frame
    received: int
    exposed: int
    means: str


NS = 1_000_000_000
RATE_WINDOW = NS
"""Time window in which the frame rate is counted [ns]."""


@dataclass
class Statistics:
    """Counts of a NatNet session since its start.

    Attributes:
        frames: number of frames used.
        lost: number of frames missing by their numbers.
        taken: datagrams used, by message.
        refused: all other datagrams, by reason; "duplicate" and "late" are frames that came twice or after a later one,
            "number" those with a doubtful number, "unasked" and "echo" responses without a request.
        connects: number of connection requests.
        restarts: number of times that the server changed or restarted.
        skipped: bytes of frames beyond the known part of their bitstream.
        means: number of frames by the method of their exposure time.
    """

    frames: int = 0
    lost: int = 0
    taken: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    connects: int = 0
    restarts: int = 0
    skipped: int = 0
    means: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self._recent: deque[tuple[int, int]] = deque()

    def frame(self, received: int, exposed: int, means: str, skipped: int) -> None:
        """Count a frame.

        Args:
            received: arrival [ns].
            exposed: middle of the exposure [ns].
            means: method by which the exposure is known.
            skipped: number of skipped bytes.
        """
        self.frames += 1
        self.skipped += skipped
        self.means[means] += 1
        self._recent.append((received, exposed))
        while self._recent[0][0] < received - RATE_WINDOW:
            self._recent.popleft()

    def rate(self, now: int) -> float:
        """Return the frames in the last second [Hz]; thread-safe."""
        return sum(received >= now - RATE_WINDOW for received, _ in tuple(self._recent)) * NS / RATE_WINDOW

    def latency(self) -> float:
        """Return the mean time from exposure to arrival in the last second with frames [s], else NaN; thread-safe."""
        recent = tuple(self._recent)
        return sum(received - exposed for received, exposed in recent) / len(recent) / NS if recent else float("nan")
