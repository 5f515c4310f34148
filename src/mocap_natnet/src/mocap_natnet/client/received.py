"""What a client hands on."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import NamedTuple

from mocap_natnet.codec.types import Frame


class Received(NamedTuple):
    """A frame.

    Attributes:
        frame: as read.
        received: when it arrived, monotonic clock [ns].
        exposed: middle of the exposure, the same clock [ns].
        means: how that time is known, see `frame_clock.ExposureClock`.
    """

    frame: Frame
    received: int
    exposed: int
    means: str


NS = 1_000_000_000
RATE_WINDOW = NS
"""[ns]"""


@dataclass
class Statistics:
    """Counts since the start.

    Attributes:
        frames: that were used.
        lost: numbers that were left out between frames.
        taken: datagrams that were used, by message.
        refused: all others, by reason; "duplicate" and "late" are frames that came twice or after a later one.
        connects: how often a connection was requested.
        restarts: how often the server was found to be another one, or begun again.
        skipped: bytes that frames held beyond what is known of their bitstream.
        means: frames by how their time is known.
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
            received: [ns].
            exposed: middle of the exposure [ns].
            means: how it is known.
            skipped: bytes.
        """
        self.frames += 1
        self.skipped += skipped
        self.means[means] += 1
        self._recent.append((received, exposed))
        while self._recent[0][0] < received - RATE_WINDOW:
            self._recent.popleft()

    def rate(self, now: int) -> float:
        """Frames in the last second [Hz]; from any thread."""
        return sum(received >= now - RATE_WINDOW for received, _ in tuple(self._recent)) * NS / RATE_WINDOW

    def latency(self) -> float:
        """Mean time from exposure to arrival in the last second in which frames came [s]; NaN without frames; from any
        thread."""
        recent = tuple(self._recent)
        return sum(received - exposed for received, exposed in recent) / len(recent) / NS if recent else float("nan")
