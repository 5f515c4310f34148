"""Errors of the framework: each message says what was wrong, where, and what would be valid."""

from __future__ import annotations

from collections.abc import Iterable


class HricError(Exception):
    """A mistake of the user or a state that forbids the request. The message stands alone; a node prints it without a traceback."""


class UnknownNameError(HricError):
    """A name that does not exist.

    Args:
        kind: what was looked for, e.g. "joint".
        name: what was asked for.
        valid: the names that exist.
        where: who was asked, e.g. "EffortJointInterface".
    """

    def __init__(self, kind: str, name: object, valid: Iterable[str], where: str = "") -> None:
        self.kind, self.name, self.valid = kind, name, sorted(valid)
        place = f" in {where}" if where else ""
        choices = ", ".join(self.valid) if self.valid else "none"
        super().__init__(f"no {kind} {name!r}{place}; valid: {choices}")


class ParameterError(HricError):
    """A parameter that is missing, of the wrong type or out of range; the message gives its full name and the valid values."""


class CommandError(HricError):
    """A command that cannot be carried out: wrong length, not finite, wrong joints. The command before it stays in force."""


class ResourceConflictError(HricError):
    """Two controllers want the same resource; the message names both and the resource."""


class DescriptionError(HricError):
    """A robot description that cannot be used; the message names the element."""
