"""Verdict: conclusions, findings from the worst on, figures, and missing signals; as JSON and as text."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from hric_assessment.findings import DISCLAIMER, Finding, Outcome
from hric_assessment.tables import VerdictTable, verdict_table
from hric_assessment.verdict.conclusions import GROUPS, ORDER, Conclusion, headline, outcome
from hric_core.errors import NOT_GOOD, NOT_KNOWN
from hric_core.geometry import FloatArray

VERSION = 2
"""Version of the JSON; its schema is config/verdict.schema.json."""
EXIT_CODES = {Outcome.WITHIN: 0, Outcome.WARNING: 0, Outcome.ABOVE: NOT_GOOD, Outcome.NOT_ASSESSABLE: NOT_KNOWN}
SHOWN_LINES = 15
"""Maximum lines of findings in a short text (project default)."""
SHOWN = 20
"""Maximum findings of one group in a full text; the JSON has all."""
SHOWN_FIGURES = 12
"""Maximum figures of one group in a full text; the JSON has all."""


@dataclass(frozen=True)
class Figure:
    """Number without a limit: it neither passes nor fails.

    Attributes:
        group: strength, muscles, joint load, interaction, productivity.
        value: value in `unit`; None: not known.
        note: origin of the value.
    """

    group: str
    name: str
    value: float | None
    unit: str
    note: str = ""

    def __str__(self) -> str:
        value = "not known" if self.value is None else f"{self.value:.4g} {self.unit}"
        return f"{self.name}: {value}" + (f" ({self.note})" if self.note else "")


@dataclass(frozen=True)
class Missing:
    """Missing signal, and what it would add."""

    signal: str
    gives: str

    def __str__(self) -> str:
        return f"{self.signal}: would give {self.gives}"


@dataclass(frozen=True)
class Verdict:
    """Verdict of one recording.

    Attributes:
        input: name, kind, experiment, begin and end [s].
        limits: title and edition of the table of contact limits.
        person: description of the body; None: there was no person.
        assumptions: a sentence each.
        findings: findings from the worst on.
        figures: numbers without a limit.
        missing: missing signals.
        timelines: curves as in the JSON.
        conclusions: conclusions about the five questions.
        moment: arm and person at the worst moment, as in the JSON; None: not known.
    """

    input: Mapping[str, Any]
    limits: Mapping[str, str]
    person: Mapping[str, Any] | None
    assumptions: tuple[str, ...]
    findings: tuple[Finding, ...]
    figures: tuple[Figure, ...] = ()
    missing: tuple[Missing, ...] = ()
    timelines: Mapping[str, Any] = field(default_factory=dict)
    conclusions: tuple[Conclusion, ...] = ()
    moment: Mapping[str, Any] | None = None

    @property
    def outcome(self) -> Outcome:
        """Worst outcome of the questions about limits of a person; unknown counts as not assessable."""
        return outcome(self.conclusions)

    def exit_code(self, only: Collection[str] = ()) -> int:
        """Return the exit code of the command; only: questions that count, empty: those of `outcome`."""
        return EXIT_CODES[outcome(self.conclusions, only)]

    def to_dict(self) -> dict[str, Any]:
        """Return the contents of the JSON."""
        return {
            "version": VERSION,
            "disclaimer": DISCLAIMER,
            "outcome": str(self.outcome),
            "answers": [self._conclusion(one) for one in self.conclusions],
            "input": dict(self.input),
            "limits": dict(self.limits),
            "person": None if self.person is None else dict(self.person),
            "assumptions": list(self.assumptions),
            "findings": [_finding(one) for one in self.findings],
            "figures": [{**vars(one), "value": _finite(one.value)} for one in self.figures],
            "missing": [vars(one) for one in self.missing],
            "timelines": dict(self.timelines),
            "moment": None if self.moment is None else dict(self.moment),
        }

    def _conclusion(self, one: Conclusion) -> dict[str, Any]:
        index = None if one.finding is None else self.findings.index(one.finding)
        numbers = {"value": _finite(one.value), "limit": _finite(one.limit), "finding": index}
        return {**vars(one), "reply": str(one.reply), **numbers}

    def render(self, only: Collection[str] = (), *, full: bool = False) -> str:
        """Return the text: the conclusions, then the worst findings.

        Args:
            only: questions that count; empty: those of `outcome`.
            full: with all findings, figures, missing signals, and assumptions.
        """
        name, begin, end = (self.input[key] for key in ("name", "begin", "end"))
        lines = [f"{name}, {begin:.2f} to {end:.2f} s: {headline(self.conclusions, only)}", ""]
        lines += [str(one) for one in self.conclusions if not only or one.question in only]
        lines += ["", DISCLAIMER, ""]
        groups = [GROUPS[one] for one in only if one in GROUPS] if only else list(GROUPS.values())
        decide = ranked([one.finding for one in self.conclusions if one.finding is not None])
        others = [one for one in self.findings if not any(one is known for known in decide)]
        shown = [one for one in (*decide, *others) if one.group in groups]
        return "\n".join(lines + (self._full(shown) if full else self._short(shown))) + "\n"

    def _short(self, findings: Sequence[Finding]) -> list[str]:
        lines: list[str] = []
        for count, one in enumerate(findings):
            remedy = f"  to know it: {one.remedy}"
            more = [f"- {one}"] + ([remedy] if one.remedy and remedy not in lines else [])
            if len(lines) + len(more) > SHOWN_LINES:
                return [*lines, f"and {len(findings) - count} more findings, figures and assumptions: --all"]
            lines += more
        return [*lines, "figures, assumptions and what the findings stand on: --all"]

    def _full(self, findings: Sequence[Finding]) -> list[str]:
        lines: list[str] = []
        for group, own in _grouped(findings).items():
            lines += [f"{group}:", *(line for one in own[:SHOWN] for line in [f"- {one}", *_details(one)])]
            lines += [f"- and {len(own) - SHOWN} more, which are no worse"] if len(own) > SHOWN else []
            lines.append("")
        parts: Mapping[str, Sequence[object]] = {
            "figures without a limit": _figures(self.figures),
            "missing": self.missing,
            "assumptions": self.assumptions,
        }
        for title, content in parts.items():
            lines += [f"{title}:", *(f"- {one}" for one in content), ""] if content else []
        return lines


def ranked(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Sort from the worst on: by outcome, then by the share of the limit."""
    return tuple(sorted(findings, key=lambda one: (ORDER.index(one.outcome), -(one.share or 0.0))))


def warned(finding: Finding, table: VerdictTable | None = None) -> Finding:
    """Return the finding, as a warning if it is near its limit."""
    table = table or verdict_table()
    near = table["near_limit"]
    if finding.outcome != Outcome.WITHIN or finding.share is None or finding.share < near:
        return finding
    note = f"a warning from {100.0 * near:.0f} % of a limit on ({table.mark_of(table.near_limit)})"
    return replace(finding, outcome=Outcome.WARNING, notes=(*finding.notes, note))


def thinned(time: FloatArray, *curves: FloatArray, count: int = 2000) -> list[int]:
    """Return the indices of at most `count` instants, with the extremes of all curves between any two of them.

    Args:
        time: shape (n,) [s].
        curves: shape (n,) each.
        count: maximum number of indices.
    """
    n = len(time)
    if n <= count:
        return list(range(n))
    kept = {0, n - 1}
    edges = np.linspace(0, n, (count - 2) // (2 * max(len(curves), 1)) + 1).astype(int)
    for begin, end in pairwise(edges.tolist()):
        for curve in curves:
            part = curve[begin:end]
            kept |= {begin + int(np.nanargmin(part)), begin + int(np.nanargmax(part))} if _any_known(part) else set()
    return sorted(kept)


def _any_known(values: FloatArray) -> bool:
    return bool(np.isfinite(values).any())


def numbers(values: FloatArray) -> list[float | None]:
    """Return values for JSON, None for NaN."""
    return [_finite(value) for value in np.asarray(values, dtype=float).tolist()]


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _finding(one: Finding) -> dict[str, Any]:
    return {
        "group": one.group,
        "subject": one.subject,
        "outcome": str(one.outcome),
        "reason": one.reason,
        "table": one.table,
        "share": _finite(one.share),
        "values": {name: _finite(value) for name, value in one.values.items()},
        "window": None if one.window is None else list(one.window),
        "signals": list(one.signals),
        "missing": list(one.missing),
        "notes": list(one.notes),
        "regions": list(one.regions),
        "evidence": None if one.evidence is None else vars(one.evidence),
        "remedy": one.remedy,
        "person": one.person,
    }


def _grouped(findings: Sequence[Finding]) -> dict[str, list[Finding]]:
    found: dict[str, list[Finding]] = {}
    for one in findings:
        found.setdefault(one.group, []).append(one)
    return found


def _figures(figures: Sequence[Figure]) -> list[str]:
    """Return the first figures of each group, which are the largest if the group has no other order."""
    groups: dict[str, list[Figure]] = {}
    for one in figures:
        groups.setdefault(one.group, []).append(one)
    lines = []
    for group, found in groups.items():
        lines += [str(one) for one in found[:SHOWN_FIGURES]]
        if len(found) > SHOWN_FIGURES:
            lines.append(f"and {len(found) - SHOWN_FIGURES} more of {group}")
    return lines


def _details(one: Finding) -> list[str]:
    known = [f"{name} {value:.4g}" for name, value in one.values.items() if value is not None]
    lines = [f"values: {'; '.join(known)}"] if known else []
    lines += [f"from: {', '.join(one.signals)}"] if one.signals else []
    lines += [f"missing: {', '.join(one.missing)}"] if one.missing else []
    lines += [f"to know it: {one.remedy}"] if one.remedy else []
    return [f"  {line}" for line in [*lines, *one.notes]]
