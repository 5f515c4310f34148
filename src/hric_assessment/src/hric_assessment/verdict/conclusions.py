"""Conclusions of a verdict: replies to five questions, which are printed before the findings.

contact   Did every contact stay within the limits of the body?
distance  Was the arm never nearer than the protective separation distance?
posture   Is the posture score of every arm whose joint angles are known within limits?
effort    How much effort does the run cost the person? Lifts have a limit, and the tasks of a work file.
task      Was the run completed?
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

from hric_assessment.ergonomics.scoring import method_of
from hric_assessment.findings import EFFORTS, ENERGY, Finding, Missing, Outcome, UnjudgedValue
from hric_assessment.tables import niosh_table
from hric_assessment.typed_json import Content
from hric_human.participant.settings import HumanSettings

CONTACT, DISTANCE, POSTURE, EFFORT, TASK = QUESTIONS = ("contact", "distance", "posture", "effort", "task")
BY_DEFAULT = (CONTACT, DISTANCE, POSTURE)
"""Questions that count for the outcome by default: those about limits of a person."""
GROUPS = {CONTACT: "contact", DISTANCE: "separation", POSTURE: "posture", EFFORT: "lift"}
"""Group of the findings that decide a question."""
GIVES = {
    CONTACT: ("contact forces",),
    DISTANCE: ("distance", "capsules"),
    POSTURE: ("the load of the muscles",),
    EFFORT: ("strength",),
}
"""Words in the description of a missing signal (`Missing.gives`) that show which question it would decide."""
AREA, PENALTY = "the contact's area", "a force of penalty contact"
AREA_REMEDY = "--contact-area M2, or human.contact_area in the experiment"
PENALTY_REMEDY = "make one of the two bodies elastic: contact: penalty of the object, or surfaces of the robot"
PARTS_REMEDY = "simulate more of the body: human.parts:="
SEE = "see the reason of the finding"
ORDER = (Outcome.ABOVE, Outcome.NOT_ASSESSABLE, Outcome.WARNING, Outcome.WITHIN)
"""Outcomes from the worst to the best; "not assessable" is second, because it may be above limits."""


class Reply(StrEnum):
    """Reply to a question of the verdict; a warning is within limits, by a rule that the finding states."""

    YES = "yes"
    WARNING = "warning"
    NO = "no"
    UNKNOWN = "unknown"
    NO_LIMIT = "no limit"


REPLIES = {
    Outcome.WITHIN: Reply.YES,
    Outcome.WARNING: Reply.WARNING,
    Outcome.ABOVE: Reply.NO,
    Outcome.NOT_ASSESSABLE: Reply.UNKNOWN,
}
OUTCOMES = {reply: outcome for outcome, reply in REPLIES.items()} | {Reply.NO_LIMIT: Outcome.NOT_ASSESSABLE}


@dataclass(frozen=True)
class Conclusion:
    """Reply to one question of the verdict, with the number that decides it.

    Attributes:
        question: one of QUESTIONS.
        reply: reply; yes only with sufficient evidence.
        subject: quantity or subject that the number describes.
        value, limit: number and its limit in `unit`; None: not known, or no limit exists.
        unit: unit of value and limit.
        reason: reason for the reply, one sentence.
        remedy: command, argument or topic that would make an unknown value known.
        person: namespace of the person with the worst finding; empty: there is one person only.
        finding: index of the deciding finding in `Verdict.findings`; None: there is none.
    """

    question: Annotated[str, ("enum", QUESTIONS)]
    reply: Annotated[Reply, "yes: within limits; no limit: the number has no limit"]
    subject: Annotated[str, "quantity or subject that the number describes"]
    value: float | None = None
    limit: Annotated[float | None, "in the unit of the value; null: there is none, or it is not known"] = None
    unit: str = ""
    reason: str = ""
    remedy: Annotated[str, "what would make an unknown value known"] = ""
    person: Annotated[str, "namespace; empty: there is one person only"] = ""
    finding: Annotated[int | None, "index of the deciding finding"] = None

    @property
    def number(self) -> str:
        """Value and limit as text; empty if no value is known."""
        if self.value is None:
            return ""
        if (self.limit, self.unit) == (100.0, "%"):
            return f"{self.value:.3g} % of the limit"
        if self.question == POSTURE and self.limit is not None:
            return f"score {self.value:g} (above limits beyond {self.limit:g})"
        unit, form = f" {self.unit}" if self.unit else "", ".3f" if self.unit == "m" else ".3g"
        limit = "" if self.limit is None else f" (limit {self.limit:{form}}{unit})"
        return f"{self.value:{form}}{unit}{limit}"

    def __str__(self) -> str:
        who = f"{self.person}: " if self.person else ""
        text = ", ".join(filter(None, (self.number, f"{who}{self.subject}")))
        return f"{self.question:<9} {self.reply:<9} {text}" + (f"; to know it: {self.remedy}" if self.remedy else "")


def conclusions(
    findings: Sequence[Finding],
    figures: Sequence[UnjudgedValue],
    missing: Sequence[Missing],
    run: Content,
    doubts: Mapping[str, str] = {},
) -> tuple[Conclusion, ...]:
    """Return the conclusions about all questions, each for the person with the worst finding.

    Args:
        findings: all findings, from the worst to the best.
        figures: numbers without a limit.
        missing: signals that the recording lacks.
        run: contents of run.yaml; empty without a run folder.
        doubts: reason why a "yes" to a question may be wrong, one sentence, by question; such a reply is a warning.
    """
    persons = list(dict.fromkeys(finding.person for finding in findings if finding.person)) or [""]
    worst = []
    for question in BY_DEFAULT:
        each = [_of_person(question, findings, missing, person) for person in persons]
        first = min(each, key=lambda conclusion: ORDER.index(OUTCOMES[conclusion.reply]))
        if question in doubts and first.reply == Reply.YES:
            first = replace(first, reply=Reply.WARNING, reason=f"{doubts[question]}; {first.reason}")
        worst.append(first)
    return (*worst, _effort(findings, figures, missing), _task(run))


def _relevant(question: str, findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings about contact, distance or posture; the first of them decides the question."""
    groups = (GROUPS[question], *([ENERGY] if question == CONTACT else []))
    relevant = [item for item in findings if item.group in groups]
    if question == CONTACT:  # of findings with the same outcome, that about the contact decides
        relevant.sort(key=lambda item: (ORDER.index(item.outcome), item.group == ENERGY))
    return _posture(relevant) if question == POSTURE else relevant


def _of_person(question: str, findings: Sequence[Finding], missing: Sequence[Missing], person: str) -> Conclusion:
    relevant = _relevant(question, [item for item in findings if item.person in ("", person)])
    if not relevant:
        return Conclusion(question, Reply.UNKNOWN, "not recorded", remedy=_lacking(question, missing), person=person)
    return _by(question, relevant[0], findings)


def _posture(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings that decide the question about posture.

    Findings of a method that supplements others are left out if they are not assessable: REBA needs legs, which most
    recordings lack, and a missing REBA score must not hide a RULA score for the same question.
    """
    main = [item for item in findings if not ((method := method_of(item.subject)) and method.supplements)]
    return [item for item in findings if not main or item in main or item.outcome != Outcome.NOT_ASSESSABLE]


def decisive(question: str, findings: Sequence[Finding]) -> Finding | None:
    """Return the finding that decides a question about limits of a person; None: there is none.

    findings: findings from the worst to the best.
    """
    return next(iter(_relevant(question, findings)), None)


def _by(question: str, finding: Finding, findings: Sequence[Finding]) -> Conclusion:
    number, at = _number(finding), findings.index(finding)
    about = finding.reason, finding.remedy, finding.person
    return Conclusion(question, REPLIES[finding.outcome], finding.subject, *number, *about, at)


def _number(finding: Finding) -> tuple[float | None, float | None, str]:
    """Return value, limit and unit of a finding: of a score, lifting index, share of a limit, or distance."""
    values = finding.values
    if (method := method_of(finding.subject)) and (score := values.get("score that counts")) is not None:
        return score, method.table().warning.value, ""
    if (index := values.get("lifting index [1]")) is not None:
        return index, niosh_table()["high"], ""
    if finding.share is not None:
        return 100.0 * finding.share, 100.0, "%"
    if (distance := values.get("distance [m]")) is not None:
        return distance, values.get("S_p [m]"), "m"
    return None, None, ""


def with_remedy(finding: Finding, recording: str = "RUN", experiment: str = "EXPERIMENT") -> Finding:
    """Return a finding with complete commands in its remedy; one that is not assessable always has a remedy.

    Args:
        finding: finding, with or without remedy.
        recording: name of the assessed recording.
        experiment: name of its experiment with a simulated person.
    """
    remedy = finding.remedy
    if finding.outcome == Outcome.NOT_ASSESSABLE and not remedy:
        remedy = SEE
        if AREA in finding.missing:
            remedy = AREA_REMEDY
        elif PENALTY in finding.missing:
            remedy = PENALTY_REMEDY
        elif any("angle" in name for name in finding.missing) and any("human/" in topic for topic in finding.signals):
            remedy = PARTS_REMEDY + getattr(method_of(finding.subject), "parts", "upper_body")
    remedy = remedy.replace("--contact-area", f"hric assess {recording} --contact-area")
    return replace(finding, remedy=remedy.replace("human.parts:=", f"hric run {experiment} human.parts:="))


def _lacking(question: str, missing: Sequence[Missing]) -> str:
    signals = [item.signal for item in missing if any(word in item.gives for word in GIVES[question])]
    return f"record {'; '.join(signals)}" if signals else ""


def _effort(findings: Sequence[Finding], figures: Sequence[UnjudgedValue], missing: Sequence[Missing]) -> Conclusion:
    """Return the conclusion about effort: of the worst rated task, else of the largest load, which has no limit."""
    lifts = [item for item in findings if item.group in EFFORTS]
    if lifts and lifts[0].outcome != Outcome.NOT_ASSESSABLE:
        return _by(EFFORT, lifts[0], findings)
    load = next((item for item in figures if item.group in ("strength", "muscles") and item.value is not None), None)
    value = None if load is None else 100.0 * (load.value or 0.0)
    if lifts:
        subject = f"{'no load is known' if load is None else load.name}; {lifts[0].subject} is not rated"
        about = lifts[0].reason, lifts[0].remedy, lifts[0].person
        return Conclusion(EFFORT, Reply.UNKNOWN, subject, value, None, "%", *about, findings.index(lifts[0]))
    if load is not None:
        return Conclusion(EFFORT, Reply.NO_LIMIT, load.name, value, None, "%", load.note)
    return Conclusion(EFFORT, Reply.UNKNOWN, "not recorded", remedy=_lacking(EFFORT, missing))


def _task(run: Content) -> Conclusion:
    if not run:
        return Conclusion(
            TASK, Reply.UNKNOWN, "no run.yaml", remedy="assess the run folder instead of only the recording"
        )
    status = str(run.get("status", "not known"))
    error = str(run.get("arm_error") or run.get("error") or "")
    reply = Reply.YES if status == "completed" and not error else Reply.NO
    subject = f"run {status}" + (f"; {error}" if error else "")
    duration = (run.get("definition") or {}).get("duration")
    return Conclusion(TASK, reply, subject, None if duration is None else float(duration), None, "s")


def outcome(conclusions: Sequence[Conclusion], only: Collection[str] = ()) -> Outcome:
    """Return the worst outcome of the questions that count.

    Args:
        conclusions: conclusions about all questions.
        only: questions that count; empty: those about limits of a person, and effort if a lift is above its limit.
    """
    counted = [OUTCOMES[item.reply] for item in conclusions if item.question in (only or BY_DEFAULT)]
    if not only:
        counted += [OUTCOMES[item.reply] for item in conclusions if (item.question, item.reply) == (EFFORT, Reply.NO)]
    return next((worst for worst in ORDER if worst in counted), Outcome.NOT_ASSESSABLE)


def headline(conclusions: Sequence[Conclusion], only: Collection[str] = ()) -> str:
    """Return in words the outcome of the questions that count; arguments: see `outcome`.

    For the question "task" it is the status of the run, since completion has no limit for a person.
    """
    limits = [item.question for item in conclusions if item.question in only and item.question != TASK]
    tasks = [item.subject for item in conclusions if item.question == TASK and TASK in only]
    return ", ".join([str(outcome(conclusions, limits))] * (not only or bool(limits)) + tasks)


def unknown_beforehand(section: Content) -> str:
    """Return a line about questions that a run's verdict cannot decide; empty: there are none.

    Args:
        section: section `human` of the experiment.
    """
    human, lacks = HumanSettings.of(section, "human"), []
    if human.contact_area is None:
        lacks.append("contacts, if any: the contact area is not stated (human.contact_area:=M2)")
    if human.person.parts not in ("upper_body", "whole_body"):
        lacks.append("posture: neck and trunk are not simulated (human.parts:=upper_body)")
    return f"the verdict of this run will not decide about {'; '.join(lacks)}" if lacks else ""
