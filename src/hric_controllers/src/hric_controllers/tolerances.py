"""Tolerances of a trajectory goal: how far a joint may be from the desired state on the way, and how near it must be at the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from hric_control.errors import CommandError


class JointToleranceLike(Protocol):
    """The fields of control_msgs/JointTolerance."""

    name: str
    position: float
    velocity: float
    acceleration: float


@dataclass(frozen=True)
class Tolerance:
    """Largest allowed error of one joint; zero means no limit.

    Attributes:
        position: [rad or m].
        velocity: [rad/s or m/s].
    """

    position: float = 0.0
    velocity: float = 0.0

    def violation(self, position_error: float, velocity_error: float) -> str:
        """What is wrong with these errors, with the numbers; empty if nothing is."""
        if self.position > 0.0 and abs(position_error) > self.position:
            return f"position error {position_error:.6g} exceeds {self.position:.6g}"
        if self.velocity > 0.0 and abs(velocity_error) > self.velocity:
            return f"velocity error {velocity_error:.6g} exceeds {self.velocity:.6g}"
        return ""


@dataclass(frozen=True)
class GoalTolerances:
    """All tolerances of one goal.

    Attributes:
        path: per joint, checked on the way.
        goal: per joint, checked from the end of the trajectory on.
        goal_time: how long after its end the goal may still be reached [s]; negative means no limit.
    """

    path: tuple[Tolerance, ...]
    goal: tuple[Tolerance, ...]
    goal_time: float = 0.0

    def overridden(
        self, joints: Sequence[str], path: Sequence[JointToleranceLike], goal: Sequence[JointToleranceLike], goal_time: float
    ) -> GoalTolerances:
        """These, with what a goal message says: 0 keeps the default, a negative value removes the limit.

        Raises:
            CommandError: a tolerance for a joint that the controller does not have.
        """
        return GoalTolerances(
            tuple(_override(joints, self.path, path, "path_tolerance")),
            tuple(_override(joints, self.goal, goal, "goal_tolerance")),
            self.goal_time if goal_time == 0.0 else goal_time,
        )

    def only(self, named: Sequence[bool]) -> GoalTolerances:
        """These, without limits for the joints that a goal does not name."""
        path, goal = (tuple(item if wanted else Tolerance() for item, wanted in zip(items, named, strict=True)) for items in (self.path, self.goal))
        return GoalTolerances(path, goal, self.goal_time)


def _override(joints: Sequence[str], defaults: Sequence[Tolerance], given: Sequence[JointToleranceLike], field: str) -> list[Tolerance]:
    by_name: Mapping[str, JointToleranceLike] = {item.name: item for item in given}
    unknown = sorted(set(by_name) - set(joints))
    if unknown:
        raise CommandError(f"{field} names {', '.join(unknown)}; valid: {', '.join(joints)}")
    result = []
    for joint, default in zip(joints, defaults, strict=True):
        item = by_name.get(joint)
        if item is None:
            result.append(default)
        else:
            result.append(replace(default, position=_pick(item.position, default.position), velocity=_pick(item.velocity, default.velocity)))
    return result


def _pick(value: float, default: float) -> float:
    if value == 0.0:
        return default
    return max(value, 0.0)


def first_violation(
    joints: Sequence[str], tolerances: Sequence[Tolerance], position_errors: Sequence[float], velocity_errors: Sequence[float]
) -> str:
    """The first joint outside its tolerance and by how much, as text; empty if all are inside."""
    for joint, tolerance, position, velocity in zip(joints, tolerances, position_errors, velocity_errors, strict=True):
        text = tolerance.violation(position, velocity)
        if text:
            return f"{joint}: {text}"
    return ""
