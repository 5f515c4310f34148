"""Verdicts of several recordings side by side."""

from collections.abc import Sequence

from hric_assessment.findings import DISCLAIMER, Finding
from hric_assessment.verdict.result import ORDER, Verdict
from hric_bags import text

NONE = "-"


def compared(verdicts: Sequence[Verdict]) -> str:
    """A row for each subject, with the worst of its findings in each recording, and one for each figure."""
    names = [str(one.input["name"]) for one in verdicts]
    outcomes = [str(one.outcome) for one in verdicts]
    cells = [["", *names], ["outcome", *outcomes]]
    subjects = dict.fromkeys((one.group, one.subject) for verdict in verdicts for one in verdict.findings)
    for group, subject in subjects:
        cells.append([f"{group}: {subject}", *(_worst(verdict, group, subject) for verdict in verdicts)])
    figures = dict.fromkeys((one.name, one.unit) for verdict in verdicts for one in verdict.figures)
    for name, unit in figures:
        cells.append([f"{name} [{unit}]", *(_figure(verdict, name) for verdict in verdicts)])
    return "\n".join([*text.rows(cells), DISCLAIMER])


def _worst(verdict: Verdict, group: str, subject: str) -> str:
    found = [one for one in verdict.findings if (one.group, one.subject) == (group, subject)]
    if not found:
        return NONE
    worst = min(found, key=lambda one: (ORDER.index(one.outcome), -(one.share or 0.0)))
    return f"{worst.outcome}{_share(worst)}"


def _share(one: Finding) -> str:
    score = next((value for name, value in one.values.items() if name == "score that counts"), None)
    if score is not None:
        return f" ({score:g})"
    return "" if one.share is None else f" ({100.0 * one.share:.0f} %)"


def _figure(verdict: Verdict, name: str) -> str:
    values = [one.value for one in verdict.figures if one.name == name]
    return NONE if not values or values[0] is None else f"{values[0]:.3g}"
