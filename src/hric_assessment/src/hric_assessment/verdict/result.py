"""Verdict: conclusions, findings sorted from the worst, figures, and missing signals; as JSON and as text."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, TypeVar

import numpy as np

from hric_assessment.ergonomics.scoring import methods
from hric_assessment.findings import DISCLAIMER, EFFORTS, ENERGY, Finding, Missing, Outcome, UnjudgedValue
from hric_assessment.typed_json import NAMES, Content, JsonObject, closed, plain, schema_of
from hric_assessment.verdict.certainty import Certainty
from hric_assessment.verdict.conclusions import CONTACT, EFFORT, GROUPS, ORDER, Conclusion, headline, outcome
from hric_assessment.verdict.moment import Moment
from hric_assessment.verdict.person import PersonSummary
from hric_core.errors import NOT_GOOD, NOT_KNOWN
from hric_core.geometry import FloatArray

T = TypeVar("T", Finding, UnjudgedValue)
VERSION = 4
"""Version of verdict.json, whose schema is config/verdict.schema.json."""
EXIT_CODES = {Outcome.WITHIN: 0, Outcome.WARNING: 0, Outcome.ABOVE: NOT_GOOD, Outcome.NOT_ASSESSABLE: NOT_KNOWN}
SHOWN_LINES = 15
"""Maximum number of lines with findings in the short text (project default)."""
SHOWN = 20
"""Maximum number of findings of one group in the full text; verdict.json has all."""
SHOWN_FIGURES = 12
"""Maximum number of figures of one group in the full text; verdict.json has all."""
OUTCOME_TEXT = (
    "the worst of the answers about limits of a person (contact, distance, posture, and a lift above its limit), in "
    "the order above limits, not assessable, warning, within limits"
)
CONCLUSIONS_TEXT = "one answer to each question, for the person with the worst finding"


@dataclass(frozen=True)
class RecordingSummary:
    """Summary of the assessed recording.

    Attributes:
        name: name of the recording.
        kind: run, bag or c3d.
        experiment: name of the experiment; None without a run folder.
        begin, end: robot time of the recording's begin and end [s].
        notes: what was assumed and left out when the markers of a c3d file were read, one sentence each.
    """

    name: str
    kind: Annotated[str, ("enum", ("run", "bag", "c3d"))]
    experiment: str | None
    begin: float
    end: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TableTitle:
    """Title and edition of the table of contact limits."""

    title: str
    edition: str


@dataclass(frozen=True)
class ScoreCurve:
    """Posture scores of one arm over time [s]; stricter, looser: with the project's own thresholds smaller, larger."""

    side: Annotated[str, ("enum", ("right", "left"))]
    time: Sequence[float]
    score: Sequence[int]
    stricter: Sequence[int]
    looser: Sequence[int]


@dataclass(frozen=True)
class SeparationCurve:
    """Distance of the person and protective distance over time [s]; NaN: the arm is at rest, or not known."""

    time: Sequence[float]
    distance: Annotated[Sequence[float | None], "[m]"]
    protective: Annotated[Sequence[float | None], "S_p [m]; null: the arm is at rest, or not known"]


@dataclass(frozen=True)
class ActivationCurve:
    """Activation of muscles by name over time [s]; NaN: not known."""

    name: Sequence[str]
    time: Sequence[float]
    activation: Annotated[Sequence[Sequence[float | None]], "one list per name"]


@dataclass(frozen=True)
class Timelines:
    """Curves over time in a verdict.

    Attributes:
        scores: posture scores of each arm, by key of the method.
        separation: distance of the nearest person; None: not known.
        activation: muscle activation of the first person with one; None: not known.
    """

    scores: Mapping[str, Sequence[ScoreCurve]] = field(default_factory=dict, metadata={NAMES: methods})
    separation: SeparationCurve | None = None
    activation: ActivationCurve | None = None


@dataclass(frozen=True)
class Verdict:
    """Verdict of one recording.

    Attributes:
        input: assessed recording.
        limits: table of contact limits.
        person: description of the first person; None: the recording has no person.
        assumptions: assumptions of the assessment, one sentence each.
        findings: findings, sorted from the worst.
        figures: values without a limit.
        missing: signals that the recording lacks.
        timelines: curves over time.
        conclusions: replies to the five questions.
        moment: arm and person at the worst moment; None: not known.
        certainty: how unconfirmed numbers move the conclusions about contact, distance and posture.
    """

    input: RecordingSummary
    limits: TableTitle
    person: Annotated[PersonSummary, ("additionalProperties", True)] | None
    assumptions: tuple[str, ...]
    findings: Annotated[tuple[Finding, ...], "sorted from the worst"]
    figures: Annotated[tuple[UnjudgedValue, ...], "without a limit: they neither pass nor fail"] = ()
    missing: tuple[Missing, ...] = ()
    timelines: Timelines = field(default_factory=Timelines)
    conclusions: tuple[Conclusion, ...] = ()
    moment: Annotated[Moment | None, "capsules of arm and person at the worst moment of the worst answer"] = None
    certainty: Annotated[tuple[Certainty, ...], "how unconfirmed numbers move the conclusions"] = ()

    @property
    def outcome(self) -> Outcome:
        """Worst outcome of the questions about limits of a person; unknown counts as not assessable."""
        return outcome(self.conclusions)

    def exit_code(self, only: Collection[str] = ()) -> int:
        """Return the exit code of `hric assess`; only: questions that count, empty: those of `outcome`."""
        return EXIT_CODES[outcome(self.conclusions, only)]

    def to_dict(self) -> JsonObject:
        """Return the contents of verdict.json."""
        content: JsonObject = plain(self)
        head = {"version": VERSION, "disclaimer": DISCLAIMER, "outcome": str(self.outcome)}
        return head | {"answers": content.pop("conclusions")} | content

    def render(self, only: Collection[str] = (), *, full: bool = False) -> str:
        """Return the verdict as text: the conclusions, then the worst findings.

        Args:
            only: questions that count; empty: those of `outcome`.
            full: True for all findings with their values, figures, missing signals, and assumptions.
        """
        span = f"{self.input.begin:.2f} to {self.input.end:.2f} s"
        notes = [f"note: {note}" for note in self.input.notes]
        lines = [f"{self.input.name}, {span}: {headline(self.conclusions, only)}", *notes, ""]
        certain = {item.question: item for item in self.certainty}
        for item in self.conclusions:
            if not only or item.question in only:
                known = certain.get(item.question)
                lines += [str(item), *(f"{'':20}{line}" for line in (known.lines() if known else ()))]
        lines += ["", DISCLAIMER, ""]
        groups = [GROUPS[item] for item in only if item in GROUPS] if only else list(GROUPS.values())
        groups += [ENERGY] if GROUPS[CONTACT] in groups else []
        groups += EFFORTS if GROUPS[EFFORT] in groups else []
        decisive = [item.finding for item in self.conclusions if item.finding is not None]
        others = [item for index, item in enumerate(self.findings) if index not in decisive]
        first = ranked([self.findings[index] for index in decisive])
        shown = [item for item in (*first, *others) if item.group in groups]
        return "\n".join(lines + (self._full(shown) if full else self._short(shown))) + "\n"

    def _short(self, findings: Sequence[Finding]) -> list[str]:
        lines: list[str] = []
        for count, item in enumerate(findings):
            remedy = f"  to know it: {item.remedy}"
            more = [f"- {item}"] + ([remedy] if item.remedy and remedy not in lines else [])
            if len(lines) + len(more) > SHOWN_LINES:
                return [*lines, f"{len(findings) - count} more findings, figures and assumptions: see --all"]
            lines += more
        return [*lines, "figures, assumptions, and values of the findings: see --all"]

    def _full(self, findings: Sequence[Finding]) -> list[str]:
        lines: list[str] = []
        for group, members in _grouped(findings).items():
            lines += [f"{group}:", *(line for item in members[:SHOWN] for line in [f"- {item}", *_details(item)])]
            lines += [f"- and {len(members) - SHOWN} more, none of them worse"] if len(members) > SHOWN else []
            lines.append("")
        parts: Mapping[str, Sequence[object]] = {
            "figures without a limit": _figures(self.figures),
            "missing": self.missing,
            "assumptions": self.assumptions,
        }
        for title, content in parts.items():
            lines += [f"{title}:", *(f"- {item}" for item in content), ""] if content else []
        return lines


def certainty_lines(entry: Content) -> list[str]:
    """Return an entry `certainty` of verdict.json as lines of text."""
    return [*Certainty.read(entry).lines()]


def verdict_schema() -> JsonObject:
    """Return the JSON schema of verdict.json, with the installed posture methods.

    config/verdict.schema.json is the schema with the methods of this package only.
    """
    properties = schema_of(Verdict)["properties"]
    head = {
        "version": Annotated[int, ("const", VERSION)],
        "disclaimer": Annotated[str, "to be shown once with the findings"],
    }
    head |= {"outcome": Annotated[Outcome, OUTCOME_TEXT], "answers": Annotated[Sequence[Conclusion], CONCLUSIONS_TEXT]}
    properties = {name: schema_of(kind) for name, kind in head.items()} | properties
    del properties["conclusions"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Verdict of hric_assessment",
        "description": "Contents of verdict.json, written by hric assess. Times are robot time [s]; null: not known.",
        **closed(properties),
    }


def ranked(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Sort findings from the worst to the best: by outcome, then by the share of the limit."""
    return tuple(sorted(findings, key=lambda item: (ORDER.index(item.outcome), -(item.share or 0.0))))


def thinned(time: FloatArray, *curves: FloatArray, count: int = 2000) -> list[int]:
    """Thin out curves for display: return the indices of at most `count` instants that keep all extremes.

    Args:
        time: times, shape (n,) [s].
        curves: curves, shape (n,) each.
        count: maximum number of indices.
    """
    n = len(time)
    if n <= count:
        return list(range(n))
    edges = np.linspace(0, n, (count - 2) // (2 * max(len(curves), 1)) + 1).astype(int)
    parts = np.repeat(np.arange(len(edges) - 1), np.diff(edges))
    indices = {0, n - 1}
    for curve in curves:
        for extreme in (np.fmin, np.fmax):
            at = np.flatnonzero(curve == extreme.reduceat(curve, edges[:-1])[parts])
            indices |= set(at[np.unique(parts[at], return_index=True)[1]].tolist())
    return sorted(indices)


def _grouped(items: Sequence[T]) -> dict[str, list[T]]:
    """Return the items of each group, groups in the order of their first items."""
    return {group: [item for item in items if item.group == group] for group in dict.fromkeys(i.group for i in items)}


def _figures(figures: Sequence[UnjudgedValue]) -> list[str]:
    """Return lines with the first figures of each group."""
    lines = []
    for group, members in _grouped(figures).items():
        lines += [str(item) for item in members[:SHOWN_FIGURES]]
        if len(members) > SHOWN_FIGURES:
            lines.append(f"and {len(members) - SHOWN_FIGURES} more of {group}")
    return lines


def _details(finding: Finding) -> list[str]:
    values = "; ".join(f"{name} {value:.4g}" for name, value in finding.values.items() if value is not None)
    parts = {"values": values, "from": ", ".join(finding.signals), "missing": ", ".join(finding.missing)}
    parts["to know it"] = finding.remedy
    return [f"  {line}" for line in [*(f"{name}: {text}" for name, text in parts.items() if text), *finding.notes]]
