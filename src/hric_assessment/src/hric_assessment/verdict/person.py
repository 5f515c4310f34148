"""Persons of a recording and their motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hric_assessment.typed_json import Content
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.recording import TrackedRoot
from hric_bags.records.root_record import RootRecord
from hric_core import urdf
from hric_core.geometry import FloatArray, Pose, compose, quaternion_from_rotation
from hric_core.geometry.quaternions import normalized
from hric_human.body import Body
from hric_human.participant.settings import HumanSettings
from hric_perception.person.settings import PersonSettings

ROOT_FRAME = "human_base"
BEYOND = np.radians(30.0)
"""Angle beyond the range of a joint from which on the joint is not known [rad] (project default, unconfirmed)."""


@dataclass(frozen=True)
class PersonSummary:
    """Description of a person: what was recorded, code of the subject, mass [kg] and height [m]."""

    what: str
    code: str
    mass: Annotated[float, "[kg]"]
    height: Annotated[float, "[m]"]


@dataclass(frozen=True)
class AssessedPerson:
    """Person whose posture and distance are assessed.

    Attributes:
        what: simulated human, tracked person, or joint states alone.
        body: body of the person, or an assumed one.
        names: names of joints with known angles.
        time: robot time, shape (n,) [s].
        q: joint angles, shape (n, j) [rad]; NaN where not known.
        root: pose of the root link in the world; None: not known.
        attitude: pose of the root link in a frame whose z is up; only the orientation counts; None: not known.
        signals: topics.
        assumptions: sentences.
        settings: settings of a simulated human; None for others.
        uncertainty: uncertainty of the body's position, Z_d [m].
        uncertainty_from: explanation of the uncertainty.
        name: namespace.
        record: recording of a simulated human, with grips and torques; None for others.
    """

    what: str
    body: Body
    names: tuple[str, ...]
    time: FloatArray
    q: FloatArray
    root: RootRecord | None
    attitude: RootRecord | None
    signals: tuple[str, ...]
    assumptions: tuple[str, ...] = ()
    settings: HumanSettings | None = None
    uncertainty: float = 0.0
    uncertainty_from: str = "simulated, so exact"
    name: str = ""
    record: HumanRecord | None = None

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of the arms whose elbow is known."""
        return tuple(side for side in ("right", "left") if f"{side}_el_flex" in self.names)

    def summary(self) -> PersonSummary:
        """Return the description of the person for the verdict."""
        subject = self.body.subject
        return PersonSummary(self.what, subject.code, float(subject.mass), float(subject.height))


def people_of(source: AssessmentInput) -> list[AssessedPerson]:
    """Return the simulated persons with joint states, and the tracked ones.

    A tracked person is left out if the emulated cameras of the run track the simulated one.
    """
    people = [_simulated(source, record) for record in source.recording.humans.values() if len(record.time)]
    if people and (source.definition.get("mocap") or {}).get("human"):
        return people
    return people + [_other(source, topic) for topic in source.recording.people]


def known_angles(body: Body, names: tuple[str, ...], q: FloatArray) -> FloatArray:
    """Return angles with NaN where a joint is farther out of its range than BEYOND, shape (n, j) [rad]."""
    ranges = [body.joints[name].range if name in body.joints else (-np.inf, np.inf) for name in names]
    lower, upper = np.array(ranges).reshape(-1, 2).T
    with np.errstate(invalid="ignore"):
        return np.where((q >= lower - BEYOND) & (q <= upper + BEYOND), q, np.nan)


def body_of(source: AssessmentInput, record: HumanRecord) -> Body | None:
    """Return the body of a simulated person; None: neither the run nor joint states define it."""
    section = source.definition.get("human")
    return None if section is None and not record.joints else _settings(section, record.joints).body()


def _settings(section: Content | None, joints: Sequence[str]) -> HumanSettings:
    """Return the settings of a section `human`; without one those of the default subject with some joints."""
    return HumanSettings.of({"parts": _parts(joints)} if section is None else section, "human")


def _assumed(body: Body, joints: Sequence[str]) -> str:
    """Return the assumption about the body of a person whom nothing describes."""
    return f"whose body it was is not known: taken as that of {body.subject.code}, {_parts(joints)}"


def _simulated(source: AssessmentInput, record: HumanRecord) -> AssessedPerson:
    section = source.definition.get("human")
    settings = _settings(section, record.joints)
    body = settings.body()
    root = record.root
    if root is None and settings.walk is None:
        where = settings.root(body) if section is not None else _placed(source, record.name)
        root = None if where is None else RootRecord.still(where)
    topics = tuple(f"{record.name}/{end}" for end in ("joint_states", "joint_torque", "root"))
    return AssessedPerson(
        "simulated human",
        body,
        record.joints,
        record.time,
        known_angles(body, record.joints, record.position),
        root,
        root,
        tuple(topic for topic in source.recording.topics if topic in topics),
        () if section is not None else (_assumed(body, record.joints),),
        settings if section is not None else None,
        name=record.name,
        record=record,
    )


def _placed(source: AssessmentInput, name: str) -> Pose | None:
    """Return the pose of a root link from a static transform from the world; name: namespace of the person.

    The frame is `human_base` below the name of the person; without a name it is that of `human`, or of the only person.
    """
    frames = [f"{name.rpartition('/')[2]}/{ROOT_FRAME}"]
    frames += [ROOT_FRAME] if name.endswith("/human") or len(source.recording.humans) == 1 else []
    return next((pose for frame in frames if (pose := source.recording.static.get(("world", frame)))), None)


def _other(source: AssessmentInput, topic: str) -> AssessedPerson:
    states, name = source.recording.people[topic], topic.rpartition("/")[0]
    tracking_topic = f"{name}/tracking"
    tracked = source.recording.tracked.get(tracking_topic)
    section, assumptions = source.definition.get("person"), []
    if section is None:
        body = _settings(None, states.names).body()
        assumptions.append(_assumed(body, states.names))
    else:
        body, calibrated = PersonSettings.of(section, "person").known()
        if not calibrated:
            assumptions.append("the body was not fitted to the person in a still pose: lengths are those of the file")
    frame = None if tracked is None else _markers_frame(source, tracked.frame)
    attitude = None if tracked is None else _root(tracked, frame or Pose())
    if tracked is not None and attitude is not None and frame is None:
        assumptions.append(f"where the frame {tracked.frame} of the markers is, is not known: its z is taken as up")
    what = "tracked person" if tracked is not None else "person of whom joint states alone were recorded"
    signals = (topic,) if tracked is None else (topic, tracking_topic)
    return AssessedPerson(
        what,
        body,
        states.names,
        states.time,
        known_angles(body, states.names, states.values),
        None if frame is None else attitude,
        attitude,
        signals,
        tuple(assumptions),
        uncertainty=0.0 if tracked is None else _residual(tracked),
        uncertainty_from="distance of the markers from those of the body, 95 % of the time",
        name=name,
    )


def _residual(tracked: TrackedRoot) -> float:
    """Return the distance that 95 % of the residuals do not exceed [m]; infinite: none is known."""
    known = tracked.residual[np.isfinite(tracked.residual)]
    return float(np.percentile(known, 95.0)) if len(known) else float("inf")


def _root(tracked: TrackedRoot, T_frame_markers: Pose) -> RootRecord | None:
    """Return the pose of the root link in a frame; None: never known."""
    known = np.isfinite(tracked.pose).all(axis=1)
    if not known.any():
        return None
    rows = [(row[:3], row[3:]) for row in tracked.pose[known].tolist()]
    poses = [compose(T_frame_markers, Pose((x, y, z), normalized(q))) for (x, y, z), q in rows]
    return RootRecord(tracked.time[known], np.array([[*pose.position, *pose.orientation] for pose in poses]))


def _markers_frame(source: AssessmentInput, frame: str) -> Pose | None:
    """Return T_world_markers, from a fixed link of the robot or a static transform; None: not known."""
    if source.description:
        tree = urdf.read(source.description)
        root, T_root_link = tree.rigid_groups().get(frame, ("", np.eye(4)))
        if root == tree.root:
            x, y, z = T_root_link[:3, 3].tolist()
            return Pose((x, y, z), quaternion_from_rotation(T_root_link[:3, :3]))
    return source.recording.static.get(("world", frame))


def _parts(names: Sequence[str]) -> str:
    """Return the smallest choice of body parts that has all of these joints."""
    if any(name.endswith("knee_flex") for name in names):
        return "whole_body"
    if any(name.startswith(("trunk", "neck")) for name in names):
        return "upper_body"
    sides = {name.partition("_")[0] for name in names}
    return "both_arms" if {"right", "left"} <= sides else f"{'left' if 'left' in sides else 'right'}_arm"
