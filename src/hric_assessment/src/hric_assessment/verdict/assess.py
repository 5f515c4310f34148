"""From a recording to its verdict."""

from typing import Any

from hric_assessment.findings import Finding, NotAssessableError
from hric_assessment.verdict.choices import Choices
from hric_assessment.verdict.contacts import contact_findings
from hric_assessment.verdict.given import Given
from hric_assessment.verdict.interaction import interaction, productivity
from hric_assessment.verdict.lifts import lift_findings
from hric_assessment.verdict.loads import loads
from hric_assessment.verdict.missing import missing
from hric_assessment.verdict.person import person_of
from hric_assessment.verdict.postures import posture_finding, scored
from hric_assessment.verdict.result import Verdict, ranked
from hric_assessment.verdict.separating import not_separated, separated, separation_finding


def assess(given: Given, choices: Choices | None = None) -> Verdict:
    """All that its signals give.

    Args:
        given: the recording.
        choices: limits, braking, area of contacts; None: the defaults.
    """
    choices = choices or Choices()
    person, found = person_of(given), given.recording
    findings: list[Finding] = contact_findings(given, person, choices)
    timelines: dict[str, Any] = {"rula": [], "reba": [], "separation": None, "activation": None}
    if person is not None:
        for one in scored(person, found.human):
            findings.append(posture_finding(one, person))
            timelines[one.method.split(" ")[0].lower()].append(one.timeline())
    apart = None
    try:
        apart = separated(given, person, choices)
    except NotAssessableError as error:
        findings.append(not_separated(str(error)))
    if apart is not None:
        findings.append(separation_finding(apart))
        timelines["separation"] = apart.timeline()
    findings += lift_findings(given, person)
    heavy = loads(given, person)
    timelines["activation"] = heavy.timeline()
    figures = (*heavy.figures, *interaction(given), *productivity(apart, found.safety))
    table = choices.limits.table
    return Verdict(
        {
            "name": given.name,
            "kind": given.kind,
            "experiment": given.run.get("experiment"),
            "begin": found.begin,
            "end": found.end,
        },
        {"title": table.title, "edition": table.edition},
        None if person is None else person.about(),
        () if person is None else person.assumptions,
        ranked(findings),
        figures,
        tuple(missing(given, person)),
        timelines,
    )
