"""A log that a flood of bad input cannot flood."""

import logging
import time

LOG = logging.getLogger("hric.franka_sim.fci")
QUIET = 1.0
"""The same kind of complaint is written once in this time [s]."""
MAX_KINDS = 256
"""Kinds remembered."""


class Complaints:
    """Warnings by kind: the first is written at once, those that follow within QUIET are counted, and their count
    comes with the next.

    Args:
        who: before each text.
    """

    def __init__(self, who: str) -> None:
        self._who = who
        self._last: dict[str, tuple[float, int]] = {}

    def warn(self, kind: str, text: str) -> None:
        """Complain.

        Args:
            kind: what is counted together.
            text: what is written.
        """
        now = time.monotonic()
        written, held = self._last.get(kind, (-QUIET, 0))
        if now - written < QUIET:
            self._last[kind] = written, held + 1
            return
        if len(self._last) >= MAX_KINDS:
            self._last.clear()
        self._last[kind] = now, 0
        LOG.warning("%s: %s%s", self._who, text, f" ({held} more like this)" if held else "")
