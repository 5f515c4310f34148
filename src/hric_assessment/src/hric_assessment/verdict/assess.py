"""Assessment of a recording: it gives a verdict with findings, figures, and the signals that are missing."""

from collections.abc import Sequence
from dataclasses import replace

from hric_assessment.ergonomics.scoring import methods
from hric_assessment.findings import Missing, UnjudgedValue
from hric_assessment.verdict.all_findings import all_findings
from hric_assessment.verdict.choices import AssessmentChoices
from hric_assessment.verdict.conclusions import conclusions, with_remedy
from hric_assessment.verdict.contacts import silence_assumed
from hric_assessment.verdict.inputs import AssessmentInput
from hric_assessment.verdict.interaction import interaction, productivity
from hric_assessment.verdict.loads import Loads, loads
from hric_assessment.verdict.moment import moment
from hric_assessment.verdict.person import AssessedPerson, people_of
from hric_assessment.verdict.result import RecordingSummary, TableTitle, Timelines, Verdict, ranked
from hric_assessment.verdict.sensitivity import Sensitivity, certainties, doubts
from hric_core.errors import HricError

ANGLES = "joint angles of a person (hric/human/joint_states, hric/person/joint_states, or markers of the body)"
CONTACTS = "contacts of a person by region (hric/human/contacts)"
FORCES = "contact forces to compare with limits; the arm's estimate F_ext, filtered at 20 Hz, is not a contact force"
DESCRIPTION = "the robot's description (robot.urdf, /robot_description)"
ROOT = "the person's position in the world (run.yaml, tracking, or a static transform)"
TORQUE = "joint torques of a person (hric/human/joint_torque, hric/person/joint_torque)"
MAXIMUM = "the maximum voluntary contraction of each EMG channel (never recorded: a bag has volts only)"
BONES = "joint contact forces of a person (hric/human/joint_reactions, hric/person/joint_reactions)"
LEGS = "joints of the legs (parts: whole_body)"
GRIP = "objects in the hands, and the grip forces (hric/human/grip)"


def missing(source: AssessmentInput, person: AssessedPerson | None) -> list[Missing]:
    """Return the signals that a recording lacks, with what each would give; person: first person in it, or None."""
    signals, scorers = source.recording, methods().values()
    scores = ", ".join(scorer.table().title for scorer in scorers)
    legs = ", and ".join(scorer.legs for scorer in reversed(scorers) if scorer.legs)
    lacks = (
        (person is None, ANGLES, f"{scores}, the distance to the arm, the load of the muscles"),
        (not _has(source, "human/contacts"), CONTACTS, FORCES),
        (
            signals.log is None,
            "the arm's motion (control_log)",
            "its distance to the person, the closed form of contacts",
        ),
        (not source.description, DESCRIPTION, "capsules and masses of the arm"),
        (person is not None and person.root is None, ROOT, "the distance to the arm"),
        (not _has(source, "joint_torque"), TORQUE, "the joint torques as share of the strength"),
        (not signals.activation, "activation of the muscles (activation)", "how active they were"),
        (
            person is not None and person.settings is None and not signals.contact,
            BONES,
            "the load in shoulders and elbows",
        ),
        (not _has(source, "/grip"), GRIP, f"the effort of the interaction, the load in {scores} and NIOSH"),
        (_of_kind(source, "SampleChunk") and not signals.activation, MAXIMUM, "how active the muscles below them were"),
        (person is not None and not _knees(person), LEGS, legs),
    )
    return [Missing(signal, gives) for lacking, signal, gives in lacks if lacking]


def _knees(person: AssessedPerson) -> bool:
    return any(name.endswith("knee_flex") for name in person.names)


def _of_kind(source: AssessmentInput, kind: str) -> bool:
    return any(name.endswith(kind) for name in source.recording.kinds)


def _has(source: AssessmentInput, suffix: str) -> bool:
    return any(topic.endswith(suffix) for topic in source.recording.topics)


def assess(source: AssessmentInput, choices: AssessmentChoices | None = None, *, muscles: bool = True) -> Verdict:
    """Assess a recording and return its verdict: findings about each person, and all figures that its signals allow.

    Args:
        source: recording with the files next to it.
        choices: limits, braking, contact area; None: the defaults.
        muscles: False to save the time of computing muscle loads (see `loads`); if joint torques are recorded,
            the conclusions are the same.
    """
    verdict, people = judge(source, choices), people_of(source)
    each = [loads(source, person, muscles=muscles) for person in people] or [loads(source, None, muscles=muscles)]
    activation = next((curves for item in each if (curves := item.timeline()) is not None), None)
    figures = (*_figures(each, people), *verdict.figures)
    drawn = conclusions(verdict.findings, figures, verdict.missing, source.run, doubts(verdict.certainty))
    timelines = replace(verdict.timelines, activation=activation)
    return replace(verdict, figures=figures, timelines=timelines, conclusions=drawn)


def judge(source: AssessmentInput, choices: AssessmentChoices | None = None) -> Verdict:
    """Return a verdict without figures of joints and muscles, which take most of the time and have no limits.

    Arguments: see `assess`.
    """
    choices = (choices or AssessmentChoices()).stated(source.definition)
    people, signals = people_of(source), source.recording
    judged = all_findings(source, people, choices)
    findings, nearest = judged.findings, judged.nearest
    table, first = choices.limits.table, people[0] if people else None
    assumptions = [line for person in people for line in person.assumptions]
    recording = source.name if source.kind == "run" else "FILE"
    verdict = Verdict(
        RecordingSummary(
            source.name, source.kind, source.run.get("experiment"), signals.begin, signals.end, signals.notes
        ),
        TableTitle(table.title, table.edition),
        None if first is None else first.summary(),
        (*dict.fromkeys(assumptions), *silence_assumed(source), *choices.assumptions),
        ranked([with_remedy(finding, recording, source.run.get("experiment", "EXPERIMENT")) for finding in findings]),
        (*interaction(source), *productivity(nearest, signals.safety)),
        tuple(missing(source, first)),
        Timelines(judged.scores, None if nearest is None else nearest.timeline()),
    )
    certain = certainties(Sensitivity(source, choices, judged.separations), verdict.findings)
    drawn = conclusions(verdict.findings, verdict.figures, verdict.missing, source.run, doubts(certain))
    verdict = replace(verdict, conclusions=drawn, certainty=certain)
    try:
        return replace(verdict, moment=moment(source, people, drawn, verdict.findings))
    except HricError:  # the same error is the reason of a finding
        return verdict


def _figures(each: Sequence[Loads], people: Sequence[AssessedPerson]) -> list[UnjudgedValue]:
    """Return the figures of all persons, named with the person if there are several."""
    names = [f"{person.name}: " for person in people] if len(people) > 1 else [""]
    return [
        replace(figure, name=name + figure.name)
        for name, item in zip(names, each, strict=True)
        for figure in item.figures
    ]
