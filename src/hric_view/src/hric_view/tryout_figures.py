"""Figures of a run in `hric try`: what its verdict knows; whatever the verdict does not know has no value."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from hric_assessment.ergonomics.scoring import method_of, methods
from hric_assessment.findings import POSTURE as POSTURES
from hric_assessment.findings import Finding, Outcome
from hric_assessment.verdict.conclusions import CONTACT, DISTANCE, EFFORT, REPLIES, Conclusion, Reply
from hric_assessment.verdict.impacts import PERMITTED
from hric_assessment.verdict.result import Verdict

PEAKS = ("transient peak [N]", "quasi-static peak [N]")
MET = "speed at contact [m/s]"
"""Names of values in findings about contacts."""
SCORE, WORST = "score that counts", "score that counts, unknown at its worst"
"""Names of values in findings about postures."""
NO_CONTACT, NOTHING = "no contact", "nothing touched the person"
"""Reply to the question about contacts without a contact, and its reason; it is not shown as "within"."""


@dataclass(frozen=True)
class TryoutFigure:
    """Figure of a run.

    Attributes:
        name: name for display, the same in all runs.
        value: value in `unit`; None: not known.
        limit: limit in `unit`; None: there is none, or it is not known.
        unit: unit.
        reply: reply of the verdict to the figure's question, or NO_CONTACT; "": the figure has none.
        reason: why the reply is as it is, or why the value is not known.
        lower: True if values below the limit are beyond it.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    reply: str = ""
    reason: str = ""
    lower: bool = False


def figures_of(verdict: Verdict) -> Iterator[TryoutFigure]:
    """Yield the figures of a verdict."""
    contacts = [finding for finding in verdict.findings if finding.group == CONTACT]
    yield from _contact(contacts)
    by_question = {conclusion.question: conclusion for conclusion in verdict.conclusions}
    share = _concluded("contact, share of its limit", by_question[CONTACT])
    apart = share.reply == Reply.YES and not _touches(contacts)
    yield replace(share, value=None, reply=NO_CONTACT, reason=NOTHING) if apart else share
    yield _concluded("smallest distance", by_question[DISTANCE])
    postures = [finding for finding in verdict.findings if finding.group == POSTURES]
    for title in (method.table().title for method in methods().values()):
        yield _score(title, [finding for finding in postures if finding.subject.startswith(f"{title} of the ")])
    yield _concluded("effort, largest joint torque", by_question[EFFORT])


def _concluded(name: str, item: Conclusion) -> TryoutFigure:
    """Return the figure of a conclusion; a value that decides nothing is not shown."""
    known = item.reply != Reply.UNKNOWN
    remedy = f"to know it: {item.remedy}" if item.remedy else ""
    reason = "; ".join(filter(None, (item.subject, item.reason, remedy)))
    value, lower = item.value if known else None, item.question == DISTANCE
    return TryoutFigure(name, value, item.limit, item.unit, item.reply, reason, lower)


def _contact(contacts: Sequence[Finding]) -> Iterator[TryoutFigure]:
    """Yield the largest force of all contacts, the speed of the one nearest to its limit, and its permitted speed.

    Args:
        contacts: findings about contacts. One that is not assessable leaves all three unknown: what it lacks may be
            larger.
    """
    unknown = next((finding for finding in contacts if finding.outcome == Outcome.NOT_ASSESSABLE), None)
    touches = _touches(contacts)
    forces: list[float] = []
    speeds: list[tuple[float, float]] = []
    why = "" if touches else NOTHING if contacts else "contacts are not assessed"
    no_force = no_speed = why if unknown is None else f"{unknown.subject}: {unknown.reason}"
    for finding in touches:
        peaks = [peak for name in PEAKS if (peak := finding.values.get(name)) is not None]
        permitted = [speed for name in PERMITTED if (speed := finding.values.get(name)) is not None]
        forces += peaks
        no_force = no_force or ("" if peaks else f"{finding.subject}: {finding.reason}")
        met = finding.values.get(MET)
        if met is None or not permitted:
            no_speed = no_speed or f"{finding.subject}: {'; '.join(finding.missing) or finding.reason}"
        else:
            speeds.append((met, min(permitted)))
    force = None if no_force else max(forces)
    met, limit = (None, None) if no_speed else max(speeds, key=lambda pair: pair[0] / max(pair[1], 1e-9))
    yield TryoutFigure("largest contact force", force, None, "N", reason=no_force)
    yield TryoutFigure("speed at contact", met, limit, "m/s", reason=no_speed)
    yield TryoutFigure("permitted speed", limit, None, "m/s", reason=no_speed)


def _touches(contacts: Sequence[Finding]) -> list[Finding]:
    """Return the findings about contacts that happened, or may have happened."""
    return [finding for finding in contacts if not (finding.outcome == Outcome.WITHIN and finding.share == 0.0)]


def _score(title: str, postures: Sequence[Finding]) -> TryoutFigure:
    """Return the worst score of a posture method; a score that unknown angles could change is not known.

    Args:
        title: name of the method.
        postures: its findings, sorted from the worst.
    """
    if not postures:
        return TryoutFigure(title, None, None, "", Reply.UNKNOWN, "no posture of the person is assessed")
    finding = next((item for item in postures if item.outcome == Outcome.NOT_ASSESSABLE), postures[0])
    method, score = method_of(finding.subject), finding.values.get(SCORE)
    limit = None if method is None else method.table().warning.value
    reason = f"{finding.subject}: {finding.reason}" + (f"; to know it: {finding.remedy}" if finding.remedy else "")
    if finding.outcome == Outcome.NOT_ASSESSABLE or finding.values.get(WORST, score) != score:
        return TryoutFigure(title, None, limit, "", Reply.UNKNOWN, reason)
    return TryoutFigure(title, score, limit, "", REPLIES[finding.outcome], reason)
