"""Contacts of a human with a robot as they began and how hard they were, and what a supervisor did meanwhile."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from hric_assessment.contact.limits import Limits
from hric_assessment.supervisor.arm import ArmShape, ArmState
from hric_assessment.supervisor.separation import STANDING
from hric_assessment.tables import limit_table
from hric_bags.reader import ControlRecord
from hric_control.geometry import FloatArray

BEFORE = 0.002
"""Before a contact the arm's speed is looked at [s]: the contact has not changed it yet."""
MOVING, STANDING_ARM, PUSHED = "moving", "standing", "pushed"
"""How the arm was as a contact began: moving; standing; or to stand, and moved by a contact before."""


@dataclass(frozen=True)
class Met:
    """A contact.

    Attributes:
        time: of its begin [s].
        link, other: that met.
        region: of ISO/TS 15066.
        arm: moving, standing or pushed.
        arm_speed: of the arm's fastest place 2 ms before [m/s].
        speed: at which both met [m/s].
        peak: force [N].
        share: of the limit of a transient contact; infinite where none is permitted; NaN: the region has no limit.
    """

    time: float
    link: str
    other: str
    region: str
    arm: str
    arm_speed: float
    speed: float
    peak: float
    share: float

    @property
    def above(self) -> bool:
        """Whether it is above the limit, or has none that could be held against it."""
        return not self.share <= 1.0


def of(contacts: Sequence[Any], log: ControlRecord, description: str) -> list[Met]:
    """Contacts in the order in which they began.

    Args:
        contacts: of messages hric_msgs/RegionContacts, in order; of a contact the last one is taken.
        log: of the robot.
        description: its URDF.
    """
    last = {(one.link, one.other, round(one.begin, 6)): one for one in contacts}
    if not last:
        return []
    arm, found, first = Arm(log, description), [], math.inf
    for contact in sorted(last.values(), key=lambda one: float(one.begin)):
        speed = arm.speed(contact.begin - BEFORE)
        state = STANDING_ARM if speed < STANDING else MOVING
        if state == MOVING and first < contact.begin - BEFORE and arm.speed(first - BEFORE) < STANDING:
            state = PUSHED  # it moves because of what touched it then
        first = min(first, contact.begin)
        found.append(_met(contact, state, speed))
    return found


def listed(messages: Sequence[Any]) -> list[Any]:
    """The contacts of messages hric_msgs/RegionContacts, in order."""
    return [contact for message in messages for contact in (*message.touching, *message.ended)]


class Arm:
    """How fast an arm was.

    Args:
        log: its control log.
        description: its URDF.
    """

    def __init__(self, log: ControlRecord, description: str) -> None:
        self._log, self._shape = log, shape(description, log.joint_names)

    def speed(self, time: float) -> float:
        """Of its fastest place at a time [s], [m/s]."""
        log = self._log
        at = int(np.clip(np.searchsorted(log.time, time), 0, len(log.time) - 1))
        velocities: FloatArray = self._shape.at(ArmState(time, log.position[at], log.velocity[at])).velocities
        return float(np.linalg.norm(velocities, axis=2).max())


@cache
def shape(description: str, joints: tuple[str, ...]) -> ArmShape:
    """Of a description, made once."""
    return ArmShape(description, joints)


@cache
def _limits() -> Limits:
    return Limits(limit_table())


def _met(contact: Any, arm: str, arm_speed: float) -> Met:
    regions = list(contact.regions)
    limit = _limits().at(regions, dominant=contact.dominant) if regions else None
    if limit is None or not math.isfinite(contact.peak):
        share = math.nan
    else:
        transient = limit.force.transient if limit.permitted else None
        share = math.inf if transient is None else contact.peak / transient
    return Met(
        contact.begin,
        contact.link,
        contact.other,
        ", ".join(regions),
        arm,
        arm_speed,
        contact.begin_speed,
        contact.peak,
        share,
    )


def supervision(states: Sequence[Any]) -> dict[str, float] | None:
    """What messages hric_msgs/SafetyState say: smallest separation [m], decisions in which the arm moved nearer than it
    should, shares of the time stopped and slowed; None: nobody supervised."""
    if not states:
        return None
    return {
        "separation": float(np.nanmin([state.separation for state in states])),
        "violations": float(sum(state.violation for state in states)),
        "stopped": float(np.mean([state.state == "stopped" for state in states])),
        "slowed": float(np.mean([state.state == "slowed" for state in states])),
    }
