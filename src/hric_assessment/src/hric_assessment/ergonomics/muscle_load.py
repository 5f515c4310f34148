"""Load of a person's muscles over a recorded motion, with the grip forces on the hands."""

from collections.abc import Iterable, Sequence

import numpy as np

from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_core.errors import HricError
from hric_core.geometry import FloatArray, Pose, Vector
from hric_human.body import Body
from hric_human.control.kinematics import GRAVITY
from hric_human.control.whole_body import ExternalLoad, RootMotion
from hric_human.muscles.after_run import RATE, AfterRun, MuscleLoad, RecordedMotion, of_root_too, smoothed
from hric_human.muscles.anatomy import Anatomy
from hric_human.muscles.muscle_set import MuscleSet

OWN = "human::"
"""Prefix of the names of the person's links."""


def grip_loads(grips: Iterable[GripRecord], time: FloatArray) -> list[ExternalLoad]:
    """Return the loads that grips exert on the person's links; zero before a grip's first message and after its last.

    Args:
        grips: grips of a run.
        time: instants of the result, shape (n,) [s].
    """
    loads = []
    for grip in grips:
        for body, sign in ((grip.holder, 1.0), (grip.held, -1.0)):
            if body.startswith(OWN):
                loads.append(_load(grip, body.removeprefix(OWN), sign, time))
    return loads


def _load(grip: GripRecord, link: str, sign: float, time: FloatArray) -> ExternalLoad:
    def at(values: FloatArray, outside: float | None) -> FloatArray:
        return np.stack([np.interp(time, grip.time, column, outside, outside) for column in values.T], axis=1)

    return ExternalLoad(link, sign * at(grip.force, 0.0), sign * at(grip.torque, 0.0), at(grip.point, None))


def motion_of(
    record: HumanRecord, joints: Sequence[str], still: Pose, cutoff: float, rate: float = RATE
) -> tuple[RecordedMotion, Pose | RootMotion]:
    """Return the smoothed motion of the joints, and the motion of the root link, or its pose if it is at rest.

    Args:
        record: recording of a run, or a part of it.
        joints: names of all joints of a body.
        still: pose of the root link in the world, used if the recording has none.
        cutoff: cut-off of the low-pass filter [Hz].
        rate: rate of the result [Hz].

    Raises:
        HricError: a joint is not in the recording, or the recording cannot be smoothed.
    """
    missing = [name for name in joints if name not in record.joints]
    if missing:
        raise HricError(f"the recorded motion has no joint {missing[0]}; valid: {', '.join(record.joints)}")
    q = record.position[:, [record.joints.index(name) for name in joints]]
    if record.root is None:
        return smoothed(record.time, q, cutoff, rate), still
    walked = smoothed(record.time, np.hstack([q, record.root.at(record.time)]), cutoff, rate)
    return of_root_too(walked, len(joints))


def load_of(
    body: Body,
    anatomy: Anatomy,
    root: Pose | RootMotion,
    motion: RecordedMotion,
    loads: Sequence[ExternalLoad] = (),
    strength: float = 1.0,
    gravity: Vector = GRAVITY,
) -> MuscleLoad:
    """Return the load of a body's muscles during a motion of all its joints.

    Args:
        body: body of the person.
        anatomy: fitted muscles of an arm.
        root: pose of a root link at rest in the world, or its motion at the instants of `motion`.
        motion: motion of the joints.
        loads: external loads on the links.
        strength: factor on the muscle strength [1].
        gravity: gravity vector in the world [m/s^2].
    """
    still, moved = (root, None) if isinstance(root, Pose) else (Pose(), root)
    return AfterRun(body, MuscleSet(body, anatomy, strength), anatomy, still, gravity).of(motion, loads, moved)
