"""Persons of a recording, with their bodies and motions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from hric_assessment.typed_json import Content
from hric_assessment.verdict.inputs import WORLD, AssessmentInput
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.recording import TrackedRoot
from hric_bags.records.root_record import RootRecord
from hric_core import urdf
from hric_core.geometry import FloatArray, Pose, compose, pose_of_transform
from hric_core.geometry.quaternions import normalized
from hric_human.body import Body
from hric_human.participant.settings import HumanSettings
from hric_perception.person.settings import PersonSettings

ROOT_FRAME = "human_base"
BEYOND = np.radians(30.0)
"""Angle beyond a joint's range at which its value counts as not known [rad] (project default, unconfirmed)."""


@dataclass(frozen=True)
class PersonSummary:
    """Description of a person in the verdict.

    Attributes:
        what: kind of recording, such as "simulated human".
        code: pseudonym of the subject.
        mass: mass of the subject [kg].
        height: height of the subject [m].
    """

    what: str
    code: str
    mass: Annotated[float, "[kg]"]
    height: Annotated[float, "[m]"]


@dataclass(frozen=True)
class AssessedPerson:
    """Person whose contacts, distance and posture are assessed.

    Attributes:
        what: kind of recording: simulated human, tracked person, or only joint states.
        body: body of the person, or an assumed one.
        names: names of joints with known angles.
        time: robot time of the samples, shape (n,) [s].
        q: joint angles, shape (n, j) [rad]; NaN where not known.
        root: pose of the root link in the world; None: not known.
        attitude: pose of the root link in a frame whose z axis points up, of which only the orientation counts; None:
            not known.
        signals: topics from which the person was recorded.
        assumptions: assumptions about the person, one sentence each.
        settings: settings of a simulated human; None for others.
        uncertainty: uncertainty Z_d of the body's position [m].
        uncertainty_from: explanation of the uncertainty.
        name: namespace of the person.
        record: recorded signals of a simulated human, with grips and torques; None for others.
        deviation: standard deviations of the joint angles, shape (n, j) [rad]; None: not known for each frame.
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
    deviation: FloatArray | None = None

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of the arms that the body has, even if none of their angles is known."""
        joints = {*self.body.joints, *self.names}
        return tuple(side for side in ("right", "left") if any(name.startswith(f"{side}_sh_") for name in joints))

    def summary(self) -> PersonSummary:
        """Return the description of the person for the verdict."""
        subject = self.body.subject
        return PersonSummary(self.what, subject.code, float(subject.mass), float(subject.height))


def people_of(source: AssessmentInput) -> list[AssessedPerson]:
    """Return the simulated persons that have joint states, and the tracked persons.

    A tracked person is left out if it is the simulated one, seen by the emulated cameras of the run.
    """
    people = [_simulated(source, record) for record in source.recording.humans.values() if len(record.time)]
    if people and (source.definition.get("mocap") or {}).get("human"):
        return people
    return people + [_other(source, topic) for topic in source.recording.people]


def known_angles(body: Body, names: tuple[str, ...], q: FloatArray) -> FloatArray:
    """Return joint angles, shape (n, j) [rad], with NaN where a joint is out of its range by more than BEYOND."""
    ranges = [body.joints[name].range if name in body.joints else (-np.inf, np.inf) for name in names]
    lower, upper = np.array(ranges).reshape(-1, 2).T
    with np.errstate(invalid="ignore"):
        return np.where((q >= lower - BEYOND) & (q <= upper + BEYOND), q, np.nan)


def body_of(source: AssessmentInput, record: HumanRecord) -> Body | None:
    """Return the body of a simulated person; None: neither the run nor joint states define it."""
    section = source.definition.get("human")
    return None if section is None and not record.joints else _settings(section, record.joints).body()


def _settings(section: Content | None, joints: Sequence[str]) -> HumanSettings:
    """Return the settings of a section `human`; without one, those of the default subject with these joints."""
    return HumanSettings.of({"parts": _parts(joints)} if section is None else section, "human")


def _assumed(body: Body, joints: Sequence[str]) -> str:
    """Return the assumption about the body of a person without a description, as a sentence."""
    return f"the person's body is not known: assumed to be that of {body.subject.code}, {_parts(joints)}"


def _simulated(source: AssessmentInput, record: HumanRecord) -> AssessedPerson:
    section = source.definition.get("human")
    settings = _settings(section, record.joints)
    body = settings.body()
    root = record.root
    if root is None and settings.walk is None:
        where = settings.root(body) if section is not None else _placed(source, record.name)
        root = None if where is None else RootRecord.still(where)
    elif root is not None and root.frame != WORLD:
        T_world_frame = source.placed(root.frame)
        root = None if T_world_frame is None else _placed_poses(root.time, root.pose, T_world_frame)
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
    """Return the pose of a person's root link by static transforms; None: not known.

    The frame is `NAME/human_base` with the last part of the person's namespace `name`; for `human` and for a single
    person also `human_base`.
    """
    frames = [f"{name.rpartition('/')[2]}/{ROOT_FRAME}"]
    frames += [ROOT_FRAME] if name.endswith("/human") or len(source.recording.humans) == 1 else []
    return next((pose for frame in frames if (pose := source.placed(frame))), None)


def _other(source: AssessmentInput, topic: str) -> AssessedPerson:
    states, name = source.recording.people[topic], topic.rpartition("/")[0]
    tracking_topic = f"{name}/tracking"
    tracked = source.recording.tracked.get(tracking_topic)
    section, assumptions = source.definition.get("person"), []
    if tracked is not None and tracked.body is not None:
        body = tracked.body
    elif section is None:
        body = _settings(None, states.names).body()
        assumptions.append(_assumed(body, states.names))
    else:
        body, calibrated = PersonSettings.of(section, "person").known()
        if not calibrated:
            assumptions.append(
                "the body was not fitted to the person in a still pose: its lengths are those of the subject's file"
            )
    frame = None if tracked is None else _markers_frame(source, tracked.frame)
    attitude = None if tracked is None else _placed_poses(tracked.time, tracked.pose, frame or Pose())
    if tracked is not None and attitude is not None and frame is None:
        assumptions.append(
            f"the pose of the markers' frame {tracked.frame} in the world is not known: its z axis is assumed to be up"
        )
    what = "tracked person" if tracked is not None else "person of whom only joint states were recorded"
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
        uncertainty_from="95th percentile of the distance between measured markers and those of the body",
        name=name,
        deviation=None if tracked is None else tracked.deviation,
    )


def _residual(tracked: TrackedRoot) -> float:
    """Return the 95th percentile of the tracker's residuals [m]; infinite if none is known. A residual of 0 is not known."""
    known = tracked.residual[np.isfinite(tracked.residual) & (tracked.residual > 0.0)]
    return float(np.percentile(known, 95.0)) if len(known) else float("inf")


def _placed_poses(time: FloatArray, pose: FloatArray, T_goal_frame: Pose) -> RootRecord | None:
    """Return poses of a root link, shape (n, 7), in another frame; None: no pose is known."""
    known = np.isfinite(pose).all(axis=1) & pose[:, 3:].any(axis=1)
    if not known.any():
        return None
    rows = [(row[:3], row[3:]) for row in pose[known].tolist()]
    poses = [compose(T_goal_frame, Pose((x, y, z), normalized(q))) for (x, y, z), q in rows]
    return RootRecord(time[known], np.array([[*pose.position, *pose.orientation] for pose in poses]))


def _markers_frame(source: AssessmentInput, frame: str) -> Pose | None:
    """Return the pose of the markers' frame in the world; None: not known.

    It is known if the frame is a fixed link of the robot, or has a static transform.
    """
    if source.description:
        tree = urdf.read(source.description)
        root, T_root_link = tree.rigid_groups().get(frame, ("", np.eye(4)))
        if root == tree.root and (base := source.base(root)) is not None:
            return compose(base, pose_of_transform(T_root_link))
    return source.placed(frame)


def _parts(names: Sequence[str]) -> str:
    """Return the smallest value of `parts` (see `Subject`) that has all of these joints."""
    if any(name.endswith("knee_flex") for name in names):
        return "whole_body"
    if any(name.startswith(("trunk", "neck")) for name in names):
        return "upper_body"
    sides = {name.partition("_")[0] for name in names}
    return "both_arms" if {"right", "left"} <= sides else f"{'left' if 'left' in sides else 'right'}_arm"
