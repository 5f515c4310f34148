"""Findings: statements about a limit, each with its numbers and its evidence.

    evidence = Evidence.of(time, finite, (begin, end), max_gap)
    evidence.complete, evidence.shortfall

Evidence states how much of a finding's time window is covered by finite samples, and how densely. The time between two
finite samples counts as known if it is not longer than the longest gap that may be bridged. Covered time counts, not
the number of samples: a thousand samples in the first second say nothing about the second one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Annotated, Any

import numpy as np

from hric_assessment import DISCLAIMER as DISCLAIMER
from hric_assessment.tables import verdict_table
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
JITTER = 1e-3
"""Tolerance for jitter of stamps when a gap is compared with the longest that may be bridged [s] (project default)."""


def finite_rows(values: FloatArray) -> BoolArray:
    """Return True for rows whose values are all finite, shape (n,); values: shape (n, k)."""
    return np.asarray(np.isfinite(values).all(axis=1))


@dataclass(frozen=True)
class Evidence:
    """Evidence of a finding: how much of its time window is covered by finite samples.

    Attributes:
        requested: length of the window [s].
        known: part of the window that is covered [s].
        rate: finite samples per covered second [Hz].
        longest_gap: longest time without a finite sample, ends of the window included [s].
        not_finite: number of samples in the window that are NaN or infinite.
        max_gap: longest gap that may be bridged [s].
        arm_motion: covered share of the time in which the arm moves [1]; None: the finding does not need it.
    """

    requested: Annotated[float, "length of the window [s]"]
    known: Annotated[float, "known part of it [s]"]
    rate: Annotated[float, "finite samples per known second [Hz]"]
    longest_gap: Annotated[float, "[s]"]
    not_finite: Annotated[int, "samples that were NaN or infinite"]
    max_gap: Annotated[float, "longest gap that may be bridged [s]"]
    arm_motion: Annotated[float | None, "known share of the arm's time in motion [1]; null: not needed"] = None

    @classmethod
    def of(cls, time: FloatArray, finite: BoolArray, window: tuple[float, float], max_gap: float) -> "Evidence":
        """Return the evidence of one signal.

        Args:
            time: ascending times of the samples, shape (n,) [s].
            finite: True for each finite sample, shape (n,).
            window: begin and end of the window [s].
            max_gap: longest gap that may be bridged [s].
        """
        begin, end = window
        gaps = unknown(time, finite, window, max_gap)
        inside = (time >= begin) & (time <= end)
        requested = max(end - begin, 0.0)
        known = requested - sum(b - a for a, b in gaps)
        samples = int((inside & finite).sum())
        edges = np.concatenate([[begin], time[inside & finite], [end]])
        longest = float(np.diff(edges).max()) if samples or requested > 0.0 else 0.0
        rate = samples / known if known > 0.0 else 0.0
        return cls(requested, known, rate, longest, int((inside & ~finite).sum()), max_gap)

    @property
    def complete(self) -> bool:
        """True if a time is covered without a gap that may not be bridged, and the arm's motion is completely known."""
        covered = self.requested > 0.0 and self.longest_gap <= self.max_gap + JITTER
        return covered and (self.arm_motion is None or self.arm_motion >= 1.0)

    @property
    def shortfall(self) -> str:
        """Clause that states how much of the time window lacks data; empty if the evidence is complete."""
        if self.complete:
            return ""
        clauses = []
        if self.requested <= 0.0 or self.longest_gap > self.max_gap + JITTER:
            clauses.append(
                f"known for {self.known:.2f} of {self.requested:.2f} s, longest gap {self.longest_gap:.2f} s"
            )
        if self.not_finite:
            clauses.append(f"{self.not_finite} samples not finite")
        if self.arm_motion is not None and self.arm_motion < 1.0:
            clauses.append(f"known for {100.0 * self.arm_motion:.0f} % of the time in which the arm moves")
        return ", ".join(clauses)


def unknown(
    time: FloatArray, finite: BoolArray, window: tuple[float, float], max_gap: float
) -> list[tuple[float, float]]:
    """Return the parts of a window in which a signal is unknown, [(begin, end), ...] [s].

    Args:
        time: ascending times of the samples, shape (n,) [s].
        finite: True for each finite sample, shape (n,).
        window: begin and end of the window [s].
        max_gap: longest gap that may be bridged [s].
    """
    begin, end = window
    known = time[finite & (time >= begin) & (time <= end)]
    edges = np.concatenate([[begin], known, [end]])
    long = np.flatnonzero(np.diff(edges) > max_gap + JITTER)
    return [(float(edges[k]), float(edges[k + 1])) for k in long]


EFFORTS = LIFT, REPETITION, PUSHING = ("lift", "repetition", "pushing")
"""Groups of findings about tasks of a person."""
GROUPS = CONTACT, ENERGY, SEPARATION, POSTURE, *_ = ("contact", "energy", "separation", "posture", *EFFORTS)
"""Groups into which findings are sorted."""
FIGURE_GROUPS = ("strength", "muscles", "joint load", "interaction", "productivity")


class Outcome(StrEnum):
    """Outcome of a finding; "within limits" needs complete evidence."""

    WITHIN = "within limits"
    WARNING = "warning"
    ABOVE = "above limits"
    NOT_ASSESSABLE = "not assessable"


class NotAssessableError(HricError):
    """Error for a number that cannot be compared with a table; the text says why, and what would make it comparable."""


@dataclass(frozen=True)
class Finding:
    """Statement about one limit: outcome, reason, numbers and evidence.

    Attributes:
        group: part of the verdict, one of GROUPS.
        subject: subject of the statement, such as a contact or a posture.
        outcome: outcome; never WITHIN if a value that the limit needs is unknown.
        reason: reason for the outcome, one sentence.
        table: title and edition of the table of limits.
        share: largest ratio of a value to its limit [1]; None: no value could be compared with a limit.
        values: numbers behind the outcome, by name and unit; None: not known.
        window: begin and end of the time that the finding covers, robot time [s].
        signals: topics from which the values were recorded.
        missing: data that a better finding would need.
        notes: remarks on the computation of the values, and marks of the limits (how well they are confirmed).
        regions: body regions of ISO/TS 15066 that the finding is about.
        side: side of the person's body; "": the middle, or not known.
        evidence: covered part of the window; None: the finding does not use a signal over time.
        remedy: command, option or topic that would make the finding assessable; empty: it is, or there is none.
        person: namespace of the person; empty: there is one person only.
    """

    group: Annotated[str, ("enum", GROUPS)] = field(default="", kw_only=True)
    subject: str
    outcome: Outcome
    reason: str
    table: Annotated[str, "title and edition of the table of limits"]
    share: Annotated[float | None, "largest value over its limit"] = None
    values: Annotated[Mapping[str, float | None], ("description", "by name and unit")] = field(default_factory=dict)
    window: tuple[float, float] | None = None
    signals: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    regions: Annotated[tuple[str, ...], ("description", "of ISO/TS 15066")] = ()
    side: Annotated[str, ("enum", ("", "right", "left"))] = ""
    evidence: Annotated[Evidence | None, "how much of the window is known"] = None
    remedy: Annotated[str, "what would make the finding assessable; empty: it is, or that is not known"] = ""
    person: Annotated[str, "namespace; empty: there is one person only"] = ""

    def marked_near_limit(self) -> "Finding":
        """Return the finding, changed to a warning if it is within limits but near its limit."""
        table = verdict_table()
        near = table["near_limit"]
        if self.outcome != Outcome.WITHIN or self.share is None or self.share < near:
            return self
        note = f"a value of at least {100.0 * near:.0f} % of its limit is a warning ({table.value_mark('near_limit')})"
        return replace(self, outcome=Outcome.WARNING, notes=(*self.notes, note))

    def __str__(self) -> str:
        share = "" if self.share is None else f" ({100.0 * self.share:.0f} % of the limit)"
        when = "" if self.window is None else f" from {self.window[0]:.3f} to {self.window[1]:.3f} s"
        who = f"{self.person}: " if self.person else ""
        return f"{who}{self.subject}{when}: {self.outcome}{share}: {self.reason} [{self.table}]"


@dataclass(frozen=True)
class UnjudgedValue:
    """Result without a limit, such as a muscle's activation: it neither passes nor fails.

    Attributes:
        group: one of FIGURE_GROUPS.
        name: name of the value.
        value: value in `unit`; None: not known.
        unit: unit of the value.
        note: how the value was computed.
    """

    group: Annotated[str, ("enum", FIGURE_GROUPS)]
    name: str
    value: float | None
    unit: str
    note: str = ""

    def __str__(self) -> str:
        value = "not known" if self.value is None else f"{self.value:.4g} {self.unit}"
        return f"{self.name}: {value}" + (f" ({self.note})" if self.note else "")


@dataclass(frozen=True)
class Missing:
    """Signal that the recording lacks, and the results that it would give."""

    signal: str
    gives: str

    def __str__(self) -> str:
        return f"{self.signal}: would give {self.gives}"
