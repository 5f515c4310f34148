"""A log that a flood of bad input cannot flood."""

import logging
import math
import time
from collections.abc import Callable

LOG = logging.getLogger("hric.franka_sim.fci")
QUIET = 1.0
"""Shortest time between two lines of the same kind [s] (project default, unconfirmed)."""
PEER_QUIET = 10.0
"""Quiet time of an address after which its next attack is written again [s] (project default, unconfirmed)."""
MAX_PEERS = 256
"""Addresses remembered; what more of them do at the same time is one kind (project default, unconfirmed)."""


class Complaints:
    """Warnings of which the first is written at once, and those that follow are counted; the count comes with the next.

    Those of a kind are written once in QUIET, those about an address once for as long as it goes on.

    Args:
        who: before each text.
        clock: monotonic time [s].
    """

    def __init__(self, who: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._who, self._clock = who, clock
        self._kinds: dict[str, tuple[float, int]] = {}
        self._peers: dict[str, tuple[float, int]] = {}

    def warn(self, kind: str, text: str) -> None:
        """Complain.

        Args:
            kind: what is counted together, one of a few.
            text: what is written.
        """
        now = self._clock()
        written, held = self._kinds.get(kind, (-QUIET, 0))
        if now - written < QUIET:
            self._kinds[kind] = written, held + 1
            return
        self._kinds[kind] = now, 0
        self._write(text, held)

    def counts(self, host: str) -> bool:
        """True if what comes of an address now is counted, not written."""
        return self._clock() - self._peers.get(host, (-math.inf, 0))[0] < PEER_QUIET

    def warn_of(self, host: str, text: str, level: int = logging.WARNING) -> None:
        """Complain about a peer.

        Args:
            host: its address, whatever its port.
            text: what is written.
            level: of the log.
        """
        now = self._clock()
        last, held = self._peers.pop(host, (-PEER_QUIET, 0))
        if now - last < PEER_QUIET:
            self._peers[host] = now, held + 1
        elif self._has_room(now):
            self._peers[host] = now, 0
            self._write(text, held, level)
        else:
            self.warn("many addresses", f"{text}; there are too many addresses to write each")

    def _has_room(self, now: float) -> bool:
        """Forget who has gone, the longest gone first; True if one more address can be remembered."""
        while len(self._peers) >= MAX_PEERS:
            host = next(iter(self._peers))
            if now - self._peers[host][0] < PEER_QUIET:
                return False
            del self._peers[host]
        return True

    def _write(self, text: str, held: int, level: int = logging.WARNING) -> None:
        LOG.log(level, "%s: %s%s", self._who, text, f" ({held} more like this)" if held else "")
