"""What can be wrong with a datagram."""

from __future__ import annotations

from hric_control.errors import HricError

REASONS = ("short", "length", "count", "size", "name", "end tag", "version", "unknown message", "unknown type")
"""Why a datagram is refused: shorter than its layout, another length than its header says, a count or a section size that the bytes left
cannot hold, a name that does not end or is not UTF-8, no end tag where the frame ends, a bitstream that this codec does not know,
a message id that does not exist or does not belong here, a description of a type that cannot be skipped."""


class CodecError(HricError):
    """A datagram that cannot be read; nothing of it is used.

    Args:
        reason: one of REASONS, to count by.
        text: what was found where.
    """

    def __init__(self, reason: str, text: str) -> None:
        assert reason in REASONS
        self.reason = reason
        super().__init__(f"NatNet datagram refused ({reason}): {text}")
