"""Findings: one statement about a limit, with the numbers and the evidence for it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from hric_assessment.evidence import Evidence
from hric_core.errors import HricError

DISCLAIMER = (
    "Estimate of a model: no risk assessment (ISO 12100), no proof of conformity, no measurement (ISO/PAS 5672), "
    "no certified safety function."
)
"""Disclaimer below each finding."""


class Outcome(StrEnum):
    """Result of a finding; "within limits" needs complete evidence."""

    WITHIN = "within limits"
    WARNING = "warning"
    ABOVE = "above limits"
    NOT_ASSESSABLE = "not assessable"


class NotAssessableError(HricError):
    """Refusal to compare a number with a table; the message says which number, why, and how to make it comparable."""


@dataclass(frozen=True)
class Finding:
    """A statement about one limit.

    Attributes:
        subject: subject of the statement.
        outcome: never WITHIN if a value that the limit needs is unknown.
        reason: reason for the outcome, one sentence.
        table: title and edition of the limits.
        share: largest ratio of a value to its limit [1]; None: no value could be compared with a limit.
        values: numbers behind the outcome, by name and unit; None: not known.
        window: begin and end of the time that the finding covers, robot time [s].
        signals: topics from which the values were recorded.
        missing: data needed for a better finding.
        notes: remarks on the computation of the values; marks of the limits.
        group: part of the verdict: contact, separation, posture, lift.
        regions: body regions of ISO/TS 15066.
        evidence: part of the window that is known; None: the finding has no signal over time.
        remedy: command, option or topic that would make a finding assessable; empty: it is assessable.
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
