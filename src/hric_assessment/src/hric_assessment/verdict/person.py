"""Who was there, and how he moved."""

from dataclasses import dataclass

import numpy as np

from hric_assessment.verdict.given import Given
from hric_bags.records.recording import Tracked
from hric_bags.records.root_record import RootRecord
from hric_control import urdf
from hric_control.geometry import FloatArray, Pose, compose, quaternion_from_rotation
from hric_control.geometry.quaternions import normalized
from hric_human.body import Body, describe
from hric_human.participant.settings import HumanSettings
from hric_perception.person.settings import PersonSettings

ROOT_FRAME = "human_base"


@dataclass(frozen=True)
class Person:
    """The person whose posture and distance is assessed.

    Attributes:
        what: simulated human, tracked person, or joint states alone.
        body: his, or the one that is assumed.
        names: of joints whose angles are known.
        time: robot time, shape (n,) [s].
        q: shape (n, j) [rad]; NaN where not known.
        root: where his root link was in the world; None: not known.
        signals: topics.
        assumptions: sentences.
        settings: of a simulated human; None: of others.
        uncertainty: of where his body is, Z_d [m].
        uncertainty_from: what that is.
    """

    what: str
    body: Body
    names: tuple[str, ...]
    time: FloatArray
    q: FloatArray
    root: RootRecord | None
    signals: tuple[str, ...]
    assumptions: tuple[str, ...] = ()
    settings: HumanSettings | None = None
    uncertainty: float = 0.0
    uncertainty_from: str = "simulated, so exact"

    @property
    def sides(self) -> tuple[str, ...]:
        """Of the arms whose elbow is known."""
        return tuple(side for side in ("right", "left") if f"{side}_el_flex" in self.names)

    def about(self) -> dict[str, object]:
        """For the JSON."""
        subject = self.body.subject
        return {"what": self.what, "code": subject.code, "mass": float(subject.mass), "height": float(subject.height)}


def person_of(given: Given) -> Person | None:
    """The simulated human; else the tracked person; else whose joint states the recording has; None: nobody."""
    return _simulated(given) or _other(given)


def _simulated(given: Given) -> Person | None:
    record = given.recording.human
    if record is None:
        return None
    section, assumptions = given.definition.get("human"), []
    if section is None:
        parts = _parts(record.joints)
        assumptions.append(f"whose body it was is not known: taken as that of {HumanSettings().subject.code}, {parts}")
        settings = HumanSettings.of({"parts": parts}, "human")
    else:
        settings = HumanSettings.of(section, "human")
    body = describe(settings.person)
    root = record.root
    if root is None and (where := settings.root(body) if section is not None else _placed(given)) is not None:
        root = RootRecord.still(where)
    own = ("human/joint_states", "human/joint_torque", "human/root")
    signals = tuple(topic for topic in given.recording.topics if topic.endswith(own))
    return Person(
        "simulated human",
        body,
        record.joints,
        record.time,
        record.position,
        root,
        signals,
        tuple(assumptions),
        settings if section is not None else None,
    )


def _placed(given: Given) -> Pose | None:
    """Of a root link that a static transform places in the world."""
    for (parent, child), pose in given.recording.static.items():
        if child.endswith(ROOT_FRAME) and parent == "world":
            return pose
    return None


def _other(given: Given) -> Person | None:
    people = given.recording.people
    if not people:
        return None
    topic = next(iter(people))
    states, beside = people[topic], f"{topic.rpartition('/')[0]}/tracking"
    tracked = given.recording.tracked.get(beside)
    section, assumptions = given.definition.get("person"), []
    if section is None:
        parts = _parts(states.names)
        settings = HumanSettings.of({"parts": parts}, "person")
        body = describe(settings.person)
        assumptions.append(f"whose body it was is not known: taken as that of {body.subject.code}, {parts}")
    else:
        body, calibrated = PersonSettings.of(section, "person").known()
        if not calibrated:
            assumptions.append("the body was not fitted to the person in a still pose: lengths are those of his file")
    what = "tracked person" if tracked is not None else "person of whom joint states alone were recorded"
    signals = (topic,) if tracked is None else (topic, beside)
    return Person(
        what,
        body,
        states.names,
        states.time,
        states.values,
        _root(given, tracked),
        signals,
        tuple(assumptions),
        uncertainty=0.0 if tracked is None else float(np.nanpercentile(tracked.residual, 95.0)),
        uncertainty_from="distance of his markers from those of the body, 95 % of the time",
    )


def _root(given: Given, tracked: Tracked | None) -> RootRecord | None:
    T_world_markers = None if tracked is None else _markers_frame(given, tracked.frame)
    if tracked is None or T_world_markers is None:
        return None
    known = np.isfinite(tracked.pose).all(axis=1)
    if not known.any():
        return None
    rows = [(row[:3], row[3:]) for row in tracked.pose[known].tolist()]
    poses = [compose(T_world_markers, Pose((x, y, z), normalized(q))) for (x, y, z), q in rows]
    return RootRecord(tracked.time[known], np.array([[*pose.position, *pose.orientation] for pose in poses]))


def _markers_frame(given: Given, frame: str) -> Pose | None:
    """T_world_markers: of a link of the robot that does not move, else by a static transform; None: not known."""
    if given.description:
        tree = urdf.read(given.description)
        root, T_root_link = tree.rigid_groups().get(frame, ("", np.eye(4)))
        if root == tree.root:
            x, y, z = T_root_link[:3, 3].tolist()
            return Pose((x, y, z), quaternion_from_rotation(T_root_link[:3, :3]))
    return given.recording.static.get(("world", frame))


def _parts(names: tuple[str, ...]) -> str:
    """What of a body has all of these joints."""
    if any(name.endswith("knee_flex") for name in names):
        return "whole_body"
    if any(name.startswith(("trunk", "neck")) for name in names):
        return "upper_body"
    sides = {name.partition("_")[0] for name in names}
    return "both_arms" if {"right", "left"} <= sides else f"{'left' if 'left' in sides else 'right'}_arm"
