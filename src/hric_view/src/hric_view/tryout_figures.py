"""Figures (key values) of a run in `hric try`, from its verdict; a figure that is not known has no value."""

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
"""Name of the value of a contact finding that has the speed of arm and person at the first touch."""
SCORE, WORST = "score that counts", "score that counts, unknown at its worst"
"""Names of the values of a posture finding with its score, and with the worst score that unknown angles allow."""
NO_CONTACT, NOTHING = "no contact", "nothing touched the person"
"""Reply and reason of the figure about contacts if there was no contact; "within limits" would be misleading."""


@dataclass(frozen=True)
class TryoutFigure:
    """Key value of a run with its limit.

    Attributes:
        name: name that the page shows, the same in all runs.
        value: value in `unit`; None: not known.
        limit: limit in `unit`; None: there is none, or it is not known.
        unit: unit of value and limit; "": none.
        reply: reply of the verdict to the question about this value, or NO_CONTACT; "": there is no question.
        reason: reason of the reply, or reason why the value is not known.
        lower: True: values below the limit violate it, as for distances; False: values above.
    """

    name: str
    value: float | None
    limit: float | None
    unit: str
    reply: str = ""
    reason: str = ""
    lower: bool = False


def figures_of(verdict: Verdict) -> Iterator[TryoutFigure]:
    """Yield the figures of a verdict in the order of the page."""
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
    """Return the figure of a verdict's conclusion; without a decision (reply "not known") it has no value.

    Args:
        name: name of the figure.
        item: conclusion of the verdict.
    """
    known = item.reply != Reply.UNKNOWN
    remedy = f"to know it: {item.remedy}" if item.remedy else ""
    reason = "; ".join(filter(None, (item.subject, item.reason, remedy)))
    value, lower = item.value if known else None, item.question == DISTANCE
    return TryoutFigure(name, value, item.limit, item.unit, item.reply, reason, lower)


def _contact(contacts: Sequence[Finding]) -> Iterator[TryoutFigure]:
    """Yield three figures: largest force of all contacts, speed of the contact nearest to its limit, permitted speed.

    If a contact is not assessable, all three are not known, since its unknown values may be larger.

    Args:
        contacts: findings about contacts.
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
    """Return the findings about contacts, without those that prove that there was no contact."""
    return [finding for finding in contacts if not (finding.outcome == Outcome.WITHIN and finding.share == 0.0)]


def _score(title: str, postures: Sequence[Finding]) -> TryoutFigure:
    """Return the figure with the worst score of a posture method; not known if unknown angles could change the score.

    Args:
        title: name of the method, e.g. RULA.
        postures: findings of this method, the worst first.
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
