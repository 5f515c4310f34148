"""Checking equilibrium poses before they reach the loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hric_control import poses
from hric_control.errors import CommandError
from hric_controllers.cartesian_law import Pose


@dataclass(frozen=True)
class JumpLimit:
    """How far a new equilibrium may be from the one in force: translation [m], rotation [rad]."""

    translation: float
    rotation: float


def check_equilibrium(message: Any, base: str, present: Pose, limit: JumpLimit) -> Pose:
    """The pose of a geometry_msgs/PoseStamped.

    Args:
        message: in the frame `base`; an empty frame name means it.
        base: name of the base frame.
        present: equilibrium in force.
        limit: how far from that it may be.

    Raises:
        CommandError: another frame, not finite, no unit quaternion, or too far; says what would be valid.
    """
    frame = message.header.frame_id.lstrip("/")
    if frame not in ("", base):
        raise CommandError(f"it is given in the frame {frame!r}; valid: {base}")
    p, o = message.pose.position, message.pose.orientation
    x, y, z = poses.finite("position", p.x, p.y, p.z)
    a, b, c, w = poses.finite("orientation", o.x, o.y, o.z, o.w)
    norm = math.sqrt(a * a + b * b + c * c + w * w)
    if not abs(norm - 1.0) < 0.01:
        raise CommandError(f"orientation ({a:g}, {b:g}, {c:g}, {w:g}) is not a unit quaternion: its norm is {norm:g}")
    wanted = Pose((x, y, z), (a / norm, b / norm, c / norm, w / norm))
    _check_jump(wanted.error(present), limit)
    return wanted


def _check_jump(error: list[float], limit: JumpLimit) -> None:
    step, turn = math.hypot(*error[:3]), math.hypot(*error[3:])
    if step > limit.translation:
        raise CommandError(f"{step:.3g} m from the equilibrium in force; valid: up to {limit.translation:g} m (largest_step)")
    if turn > limit.rotation:
        raise CommandError(f"{turn:.3g} rad from the equilibrium in force; valid: up to {limit.rotation:g} rad (largest_turn)")


def fill_pose(message: Any, pose: Pose) -> None:
    """Write a pose into a geometry_msgs/Pose."""
    p, o = message.position, message.orientation
    p.x, p.y, p.z = pose.position
    o.x, o.y, o.z, o.w = pose.orientation
