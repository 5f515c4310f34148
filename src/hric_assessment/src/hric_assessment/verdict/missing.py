"""Missing signals of a recording, and what each would add."""

from hric_assessment.verdict.given import Given
from hric_assessment.verdict.person import Person
from hric_assessment.verdict.result import Missing

ANGLES = "joint angles of a person (hric/human/joint_states, hric/person/joint_states, or markers of the body)"
CONTACTS = "contacts of a person by region (hric/human/contacts)"
FORCES = "contact forces to hold against limits; the arm's estimate F_ext is filtered at 20 Hz and is no contact force"
DESCRIPTION = "the robot's description (robot.urdf, /robot_description)"
ROOT = "where the person was in the world (run.yaml, tracking, or a static transform)"
TORQUE = "joint torques of a person (hric/human/joint_torque, hric/person/joint_torque)"
MAXIMUM = "the largest voluntary activation of each EMG channel (none is recorded: a bag has volts)"
BONES = "contact forces between a person's bones (hric/human/joint_reactions, hric/person/joint_reactions)"
LEGS = "joints of the legs (parts: whole_body)"
GRIP = "what the hands hold, and with which force (hric/human/grip)"


def missing(given: Given, person: Person | None) -> list[Missing]:
    """Return the missing signals of a recording; person: the first person in it."""
    found = given.recording
    lacks = (
        (person is None, ANGLES, "RULA, REBA, the distance to the arm, the load of the muscles"),
        (not _has(given, "human/contacts"), CONTACTS, FORCES),
        (
            found.log is None,
            "the arm's motion (control_log)",
            "its distance to the person, the closed form of contacts",
        ),
        (not given.description, DESCRIPTION, "capsules and masses of the arm"),
        (person is not None and person.root is None, ROOT, "the distance to the arm"),
        (not _has(given, "joint_torque"), TORQUE, "the load of the joints as share of their strength"),
        (not found.activation, "activation of the muscles (activation)", "how active they were"),
        (
            person is not None and person.settings is None and not found.contact,
            BONES,
            "how much shoulders and elbows carry",
        ),
        (not _has(given, "/grip"), GRIP, "the effort of the interaction, the load in RULA, REBA and NIOSH"),
        (_of_kind(given, "SampleChunk") and not found.activation, MAXIMUM, "how active the muscles below them were"),
        (person is not None and not _knees(person), LEGS, "REBA, which counts bent knees, and the balance of RULA"),
    )
    return [Missing(signal, gives) for lacking, signal, gives in lacks if lacking]


def _knees(person: Person) -> bool:
    return any(name.endswith("knee_flex") for name in person.names)


def _of_kind(given: Given, kind: str) -> bool:
    return any(found.endswith(kind) for found in given.recording.kinds)


def _has(given: Given, suffix: str) -> bool:
    return any(topic.endswith(suffix) for topic in given.recording.topics)
