"""All findings of a recording: contacts, postures, distances and lifts, with the curves behind them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hric_assessment.ergonomics.scoring import methods
from hric_assessment.findings import Finding
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.contacts import contact_findings
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.person import AssessedPerson
from hric_assessment.verdict.postures import posture_finding, scored
from hric_assessment.verdict.refined import with_bars
from hric_assessment.verdict.result import ScoreCurve
from hric_assessment.verdict.separating import PersonSeparation, not_separated, separated, separation_finding
from hric_assessment.verdict.tasks import task_methods
from hric_core.errors import HricError


@dataclass(frozen=True)
class AllFindings:
    """Findings of a recording.

    Attributes:
        findings: findings about each person, with the error bars that run.yaml has.
        scores: posture scores of each arm, by key of the method.
        separations: distances of each person from the arm, where they are known.
    """

    findings: list[Finding]
    scores: dict[str, list[ScoreCurve]]
    separations: list[PersonSeparation]

    @property
    def nearest(self) -> PersonSeparation | None:
        """Distances of the person with the smallest margin; None: no distance is known."""
        return min(self.separations, key=lambda item: item.margin, default=None)


def all_findings(source: AssessmentInput, people: Sequence[AssessedPerson], choices: AssessmentChoices) -> AllFindings:
    """Return all findings of a recording; people: persons in it."""
    findings, signals = contact_findings(source, choices), source.recording
    scores: dict[str, list[ScoreCurve]] = {key: [] for key in methods()}
    distances: list[PersonSeparation] = []
    for person in people:
        for arm in scored(person, person.record, (signals.begin, signals.end), choices.versions):
            findings.append(replace(posture_finding(arm, person), person=person.name))
            scores[arm.key].append(arm.timeline())
        findings += _separation(source, person, choices, distances)
        findings += [item for method in task_methods() for item in method.findings(source, person, choices.work)]
    if len({finding.person for finding in findings}) < 2:
        findings = [replace(finding, person="") for finding in findings]  # with one person no name is needed
    return AllFindings(with_bars(findings, source.run), scores, distances)


def _separation(
    source: AssessmentInput, person: AssessedPerson, choices: AssessmentChoices, distances: list[PersonSeparation]
) -> list[Finding]:
    """Return the finding about a person's distance from the arm, and add the distances to `distances`."""
    try:
        apart = separated(source, person, choices)
    except HricError as error:  # an unusable description or root must not hide a contact
        return [not_separated(str(error), person.name)]
    if apart is None:
        return []
    distances.append(apart)
    return [separation_finding(apart)]
