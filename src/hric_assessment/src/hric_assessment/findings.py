"""Findings: one statement about a limit, with the numbers and the evidence that carry it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from hric_assessment.evidence import Evidence
from hric_control.errors import HricError

DISCLAIMER = (
    "Estimate of a model: no risk assessment (ISO 12100), no proof of conformity, no measurement (ISO/PAS 5672), "
    "no certified safety function."
)
"""The line beneath each finding."""


class Outcome(StrEnum):
    """Result of a finding. Within limits is a statement that the evidence carries; what is not known never is."""

    WITHIN = "within limits"
    WARNING = "warning"
    ABOVE = "above limits"
    NOT_ASSESSABLE = "not assessable"


class NotAssessableError(HricError):
    """A number that a table must not be held against; the message says which, why, and what would do."""


@dataclass(frozen=True)
class Finding:
    """A statement about one limit.

    Attributes:
        subject: what the statement is about.
        outcome: never WITHIN where anything that the limit needs is not known.
        reason: why the outcome is what it is, one sentence.
        table: title and edition of the limits.
        share: largest value over its limit [1]; None: no value could be compared with a limit.
        values: numbers behind the outcome, by name and unit; None: not known.
        window: begin and end of the time that the finding covers, robot time [s].
        signals: topics that the values come from.
        missing: what would be needed to say more.
        notes: how the values were made; marks of the limits.
        group: part of the verdict: contact, separation, posture, lift.
        regions: of ISO/TS 15066.
        evidence: how much of the window is known; None: the finding has no signal over time.
        remedy: command, option or topic that would make a finding assessable; empty: it is.
        person: namespace of the person; empty: there is one person only.
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
    evidence: Evidence | None = None
    remedy: str = ""
    person: str = ""

    def __str__(self) -> str:
        share = "" if self.share is None else f" ({100.0 * self.share:.0f} % of the limit)"
        when = "" if self.window is None else f" from {self.window[0]:.3f} to {self.window[1]:.3f} s"
        who = f"{self.person}: " if self.person else ""
        return f"{who}{self.subject}{when}: {self.outcome}{share}: {self.reason} [{self.table}]"
