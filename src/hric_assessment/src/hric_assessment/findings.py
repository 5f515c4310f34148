"""What is found of a run, and how it is said."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from hric_control.errors import HricError

DISCLAIMER = (
    "Estimate of a model: no risk assessment (ISO 12100), no proof of conformity, no measurement (ISO/PAS 5672), "
    "no certified safety function."
)
"""The line beneath each finding."""


class Outcome(StrEnum):
    """Of a finding."""

    WITHIN = "within limits"
    WARNING = "warning"
    ABOVE = "above limits"
    NOT_ASSESSABLE = "not assessable"


class NotAssessableError(HricError):
    """A number that a table must not be held against; the message says which, why, and what would do."""


@dataclass(frozen=True)
class Finding:
    """What is found.

    Attributes:
        subject: what it is about.
        outcome: never WITHIN where anything that a limit needs is not known.
        reason: of the outcome, a sentence.
        table: title and edition of what it was held against.
        share: largest value over its limit [1]; None: no value could be held against a limit.
        values: the basis of it, by name and unit; None: not known.
        window: of the run that it is about, begin and end, robot time [s].
        signals: that the values come from.
        missing: what would be needed to say more.
        notes: what a reader must know of the values: how they were made, marks of the limits.
        group: of findings, in a verdict.
        regions: of ISO/TS 15066 that it is about.
    """

    subject: str
    outcome: Outcome
    reason: str
    table: str
    share: float | None = None
    values: Mapping[str, float | None] = field(default_factory=dict)
    window: tuple[float, float] | None = None
    signals: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    group: str = ""
    regions: tuple[str, ...] = ()

    def __str__(self) -> str:
        share = "" if self.share is None else f" ({100.0 * self.share:.0f} % of the limit)"
        when = "" if self.window is None else f" from {self.window[0]:.3f} to {self.window[1]:.3f} s"
        return f"{self.subject}{when}: {self.outcome}{share}: {self.reason} [{self.table}]\n  {DISCLAIMER}"
