"""Rate-limited log of bad input from the network."""

import logging
import math
import time
from collections.abc import Callable

LOG = logging.getLogger("hric.franka_sim.fci")
QUIET = 1.0
"""Minimum time between two log lines of the same kind [s] (project default, unconfirmed)."""
PEER_QUIET = 10.0
"""Quiet time of an address after which its next attack is logged again [s] (project default, unconfirmed)."""
MAX_PEERS = 256
"""Maximum number of addresses logged separately; further ones share one log line (project default, unconfirmed)."""


class Complaints:
    """Log of warnings: the first is logged at once, repetitions are counted and reported with the next line.

    A kind of warning is logged at most once per QUIET; an address is logged again after PEER_QUIET without a message.

    Args:
        who: prefix of each text.
        clock: monotonic time [s].
    """

    def __init__(self, who: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._who, self._clock = who, clock
        self._kinds: dict[str, tuple[float, int]] = {}
        self._peers: dict[str, tuple[float, int]] = {}

    def warn(self, kind: str, text: str) -> None:
        """Log a warning.

        Args:
            kind: category for counting, one of a few.
            text: text to log.
        """
        now = self._clock()
        written, held = self._kinds.get(kind, (-QUIET, 0))
        if now - written < QUIET:
            self._kinds[kind] = written, held + 1
            return
        self._kinds[kind] = now, 0
        self._write(text, held)

    def counts(self, host: str) -> bool:
        """Return True if messages about an address are only counted at present, since one was logged recently."""
        return self._clock() - self._peers.get(host, (-math.inf, 0))[0] < PEER_QUIET

    def warn_of(self, host: str, text: str, level: int = logging.WARNING) -> None:
        """Log a message about a peer.

        Args:
            host: address of the peer, without port.
            text: text to log.
            level: level of the message.
        """
        now = self._clock()
        last, held = self._peers.pop(host, (-PEER_QUIET, 0))
        if now - last < PEER_QUIET:
            self._peers[host] = now, held + 1
        elif self._has_room(now):
            self._peers[host] = now, 0
            self._write(text, held, level)
        else:
            self.warn("many addresses", f"{text}; too many other addresses to log each of them")

    def _has_room(self, now: float) -> bool:
        """Drop addresses that have been quiet, the longest first; return True if there is room for one more."""
        while len(self._peers) >= MAX_PEERS:
            host = next(iter(self._peers))
            if now - self._peers[host][0] < PEER_QUIET:
                return False
            del self._peers[host]
        return True

    def _write(self, text: str, held: int, level: int = logging.WARNING) -> None:
        LOG.log(level, "%s: %s%s", self._who, text, f" ({held} more like this)" if held else "")
