"""What the arm is commanded by: one joint interface for all seven joints, or nothing."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from hric_control.errors import HricError, ResourceConflictError
from hric_control.hardware_interface import EffortJointInterface, PositionJointInterface, VelocityJointInterface
from hric_control.robot_hw import ControllerInfo


class Mode(Enum):
    """Kind of command; the value is its name in the control log."""

    HOLD = "none"
    EFFORT = "effort"
    VELOCITY = "velocity"
    POSITION = "position"


_BY_INTERFACE = {
    EffortJointInterface.cpp_name: Mode.EFFORT,
    VelocityJointInterface.cpp_name: Mode.VELOCITY,
    PositionJointInterface.cpp_name: Mode.POSITION,
}


def claimed_mode(controller: ControllerInfo, joint_names: Sequence[str]) -> Mode:
    """The mode that a controller needs; HOLD if it claims nothing of the arm.

    Raises:
        HricError: it claims some joints only, or through two interfaces; the message names what is missing.
    """
    claims = {interface: joints & set(joint_names) for interface, joints in controller.claims.items() if joints & set(joint_names)}
    if not claims:
        return Mode.HOLD
    if len(claims) > 1:
        raise HricError(f"{controller.name} claims joints through {' and '.join(sorted(claims))}; the arm takes one kind of command at a time")
    interface, joints = next(iter(claims.items()))
    missing = [name for name in joint_names if name not in joints]
    if missing:
        some = f"{len(joints)} of the arm's {len(joint_names)} joints"
        raise HricError(f"{controller.name} claims {some}; it must claim all of them: missing {', '.join(missing)}")
    if interface not in _BY_INTERFACE:
        raise HricError(f"{controller.name} claims the arm through {interface}; valid: {', '.join(sorted(_BY_INTERFACE))}")
    return _BY_INTERFACE[interface]


def check_one_commander(controllers: Sequence[ControllerInfo], joint_names: Sequence[str]) -> None:
    """Refuse controllers that would command the arm together.

    Raises:
        ResourceConflictError: names two of them.
        HricError: a partial claim.
    """
    commanding = [(controller.name, mode) for controller in controllers if (mode := claimed_mode(controller, joint_names)) is not Mode.HOLD]
    if len(commanding) > 1:
        (first, first_mode), (second, second_mode) = commanding[:2]
        raise ResourceConflictError(
            f"{joint_names[0]} to {joint_names[-1]} are claimed by both {first} ({first_mode.value}) and {second} ({second_mode.value})"
        )
