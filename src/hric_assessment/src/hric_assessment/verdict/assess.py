"""Assessment of a recording, which results in its verdict."""

from dataclasses import replace
from typing import Any

from hric_assessment.findings import Finding
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.conclusions import conclusions, with_remedy
from hric_assessment.verdict.contacts import contact_findings, silence_assumed
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.interaction import interaction, productivity
from hric_assessment.verdict.lifts import lift_findings
from hric_assessment.verdict.loads import Loads, loads
from hric_assessment.verdict.missing import missing
from hric_assessment.verdict.moment import moment
from hric_assessment.verdict.person import Person, people_of
from hric_assessment.verdict.postures import posture_finding, scored
from hric_assessment.verdict.result import Figure, Verdict, ranked
from hric_assessment.verdict.separating import Separated, not_separated, separated, separation_finding
from hric_core.errors import HricError


def assess(given: Given, choices: Choices | None = None) -> Verdict:
    """Return the verdict of a recording: findings of each person in it, and all figures that its signals allow.

    Args:
        given: the recording.
        choices: limits, braking, contact area; None: the defaults.
    """
    verdict, people = judge(given, choices), people_of(given)
    each = [loads(given, person) for person in people] or [loads(given, None)]
    activation = next((curves for one in each if (curves := one.timeline()) is not None), None)
    return _concluded(
        replace(
            verdict,
            figures=(*_figures(each, people), *verdict.figures),
            timelines={**verdict.timelines, "activation": activation},
        ),
        given,
    )


def judge(given: Given, choices: Choices | None = None) -> Verdict:
    """Return a verdict without the figures of joints and muscles, which take most of the time and decide nothing.

    Arguments as of `assess`.
    """
    choices = (choices or Choices()).stated(given.definition)
    people, found = people_of(given), given.recording
    findings = contact_findings(given, choices)
    timelines: dict[str, Any] = {"rula": [], "reba": [], "separation": None, "activation": None}
    distances: list[Separated] = []
    for person in people:
        for arm in scored(person, person.record, (found.begin, found.end), choices.rula_table):
            findings.append(replace(posture_finding(arm, person), person=person.name))
            timelines[arm.scores.table.title.lower()].append(arm.timeline())
        findings += [*_separation(given, person, choices, distances), *lift_findings(given, person)]
    if len({finding.person for finding in findings}) < 2:
        findings = [replace(finding, person="") for finding in findings]  # with one person no name is needed
    nearest = min(distances, key=lambda one: one.margin, default=None)
    timelines["separation"] = None if nearest is None else nearest.timeline()
    table, first = choices.limits.table, people[0] if people else None
    about = {"name": given.name, "kind": given.kind, "experiment": given.run.get("experiment")}
    verdict = Verdict(
        {**about, "begin": found.begin, "end": found.end},
        {"title": table.title, "edition": table.edition},
        None if first is None else first.about(),
        (
            *dict.fromkeys(line for person in people for line in person.assumptions),
            *silence_assumed(given),
            *choices.assumptions,
        ),
        ranked([with_remedy(finding) for finding in findings]),
        (*interaction(given), *productivity(nearest, found.safety)),
        tuple(missing(given, first)),
        timelines,
    )
    drawn = _concluded(verdict, given)
    try:
        return replace(drawn, moment=moment(given, people, drawn.conclusions))
    except HricError:  # the findings contain the error
        return drawn


def _concluded(verdict: Verdict, given: Given) -> Verdict:
    """Return a copy with its conclusions."""
    drawn = conclusions(verdict.findings, verdict.figures, verdict.missing, given.run)
    return replace(verdict, conclusions=drawn)


def _separation(given: Given, person: Person, choices: Choices, distances: list[Separated]) -> list[Finding]:
    """Return the finding about a person's distance, and add the curve to `distances`."""
    try:
        apart = separated(given, person, choices)
    except HricError as error:  # an unusable description or root must not hide a contact
        return [not_separated(str(error), person.name)]
    if apart is None:
        return []
    distances.append(apart)
    return [separation_finding(apart)]


def _figures(each: list[Loads], people: list[Person]) -> list[Figure]:
    """Return the figures of all persons, prefixed by the person's name if there are several."""
    if len(people) < 2:
        return [figure for one in each for figure in one.figures]
    named = zip(each, people, strict=True)
    return [replace(figure, name=f"{person.name}: {figure.name}") for one, person in named for figure in one.figures]
