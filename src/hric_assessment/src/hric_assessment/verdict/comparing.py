"""Comparison of the verdicts of several recordings, side by side."""

from collections.abc import Collection, Sequence

from hric_assessment.findings import DISCLAIMER, Finding
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE, GROUPS, headline
from hric_assessment.verdict.result import Verdict
from hric_bags import text

NONE = "-"


def compared(verdicts: Sequence[Verdict], only: Collection[str] = ()) -> str:
    """Return a text table with a row for each question, for the worst finding of each subject, and for each figure.

    Args:
        verdicts: verdicts to compare, one column each.
        only: questions that count for the outcome; empty: the default ones.
    """
    cells = [["", *_names(verdicts)]]
    cells.append(["outcome", *(headline(verdict.conclusions, only) for verdict in verdicts)])
    for conclusions in zip(*(verdict.conclusions for verdict in verdicts), strict=True):
        replies = [f"{item.reply}{f': {item.number}' if item.number else ''}" for item in conclusions]
        cells.append([conclusions[0].question, *replies])
    worst = [_worst(verdict) for verdict in verdicts]
    for key in dict.fromkeys(key for findings in worst for key in findings):
        cells.append([key, *(_shown(findings.get(key)) for findings in worst)])
    figures = dict.fromkeys((item.name, item.unit) for verdict in verdicts for item in verdict.figures)
    for name, unit in figures:
        cells.append([f"{name} [{unit}]", *(_figure(verdict, name) for verdict in verdicts)])
    return "\n".join([*text.rows(cells), DISCLAIMER])


def _names(verdicts: Sequence[Verdict]) -> list[str]:
    """Return a name for each verdict, with a number if several have the same name."""
    names = [verdict.input.name for verdict in verdicts]
    return [f"{name} ({names[: k + 1].count(name)})" if names.count(name) > 1 else name for k, name in enumerate(names)]


def _worst(verdict: Verdict) -> dict[str, Finding]:
    """Return the worst finding of each subject: contacts by body region, and one for all distances.

    The nearest links differ from run to run, so distances are not distinguished by link.
    """
    findings: dict[str, Finding] = {}
    for finding in verdict.findings:
        subject = finding.subject
        if finding.group == GROUPS[CONTACT]:
            subject = f"contact with {' or '.join(finding.regions)}" if finding.regions else subject
        elif finding.group == GROUPS[DISTANCE]:
            subject = "distance of the arm"
        findings.setdefault(f"{finding.person}: {subject}" if finding.person else subject, finding)
    return findings


def _shown(finding: Finding | None) -> str:
    if finding is None:
        return NONE
    score = finding.values.get("score that counts")
    if score is not None:
        return f"{finding.outcome} ({score:g})"
    return str(finding.outcome) if finding.share is None else f"{finding.outcome} ({100.0 * finding.share:.0f} %)"


def _figure(verdict: Verdict, name: str) -> str:
    values = [item.value for item in verdict.figures if item.name == name]
    return NONE if not values or values[0] is None else f"{values[0]:.3g}"
