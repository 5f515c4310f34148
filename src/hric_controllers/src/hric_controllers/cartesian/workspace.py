"""Workspace of the end effector, rotation of marker coordinates to the base, checks of equilibrium poses. No ROS."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hric_core.errors import CommandError, HricError
from hric_core.geometry import Pose, Vector, messages, quaternions
from hric_core.geometry.poses import difference
from hric_core.geometry.quaternions import is_rotation
from hric_core.parameters import Settings, number, numbers, refused

Rows = tuple[Vector, Vector, Vector]
ORTHONORMAL = 1e-6
"""Tolerance for the orthonormality of a rotation matrix; covers the rounding of numbers in YAML files."""


@dataclass(frozen=True)
class Box(Settings):
    """Workspace of the end effector: a box with axes along those of the base frame.

    Attributes:
        lower, upper: corners with the least and the largest coordinates, in the base frame [m].
    """

    lower: Vector = numbers(3, unit="m")
    upper: Vector = numbers(3, unit="m")

    def check(self, where: str) -> None:
        """Raise an error if the upper corner is not above the lower one on each axis."""
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise refused(f"{where}upper", self.upper, f"above lower, {self.lower}, on each axis [m]")

    def contains(self, p: Sequence[float]) -> bool:
        """Return True if a point, in the base frame [m], is inside the box or on its border."""
        return all(low <= x <= high for x, low, high in zip(p, self.lower, self.upper, strict=True))

    def nearest(self, p: Sequence[float]) -> Vector:
        """Return the point of the box that is nearest to the point `p`, both in the base frame [m]."""
        x, y, z = (min(max(value, low), high) for value, low, high in zip(p, self.lower, self.upper, strict=True))
        return x, y, z

    def __str__(self) -> str:
        return (
            ", ".join(
                f"{axis} {low:g} to {high:g}" for axis, low, high in zip("xyz", self.lower, self.upper, strict=True)
            )
            + " m"
        )


@dataclass(frozen=True)
class FrameRotation:
    """Rotation R_base_marker of vectors in a marker's frame into the base frame.

    Attributes:
        rows: rows of the rotation matrix, three numbers each.

    Raises:
        HricError: the matrix is not a rotation.
    """

    rows: Rows

    def __post_init__(self) -> None:
        if not is_rotation(*self.rows, ORTHONORMAL):
            raise HricError(
                f"frame rotation {[list(row) for row in self.rows]}; valid: a rotation matrix, orthonormal rows and "
                "determinant 1"
            )

    def rotated(self, v: Sequence[float]) -> Vector:
        """Return the vector v, given in the marker's frame, in the base frame."""
        x, y, z = self.rows
        return _dot(x, v), _dot(y, v), _dot(z, v)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@dataclass(frozen=True)
class JumpSettings(Settings):
    """Maximum distance and rotation between a new equilibrium pose and the present one."""

    largest_step: float = number(
        0.3, above=0.0, unit="m", text="largest distance of a new equilibrium from the present one"
    )
    largest_turn: float = number(
        1.6, above=0.0, unit="rad", text="largest rotation of a new equilibrium from the present one"
    )


def check_equilibrium(message: Any, base: str, present: Pose, limit: JumpSettings | None = None) -> Pose:
    """Return the equilibrium pose in a geometry_msgs/PoseStamped, after checking it.

    Args:
        message: message with a pose in the frame `base`; an empty frame name means this frame.
        base: name of the robot's base frame.
        present: present equilibrium.
        limit: maximum distance from the present equilibrium; None: no limit.

    Raises:
        CommandError: the frame is not `base`, a number is not finite, the quaternion has no unit norm, or the pose is
            too far from the present one; the text gives the valid values.
    """
    frame = message.header.frame_id.lstrip("/")
    if frame not in ("", base):
        raise CommandError(f"the pose is given in the frame {frame!r}; valid: {base}")
    p, o = message.pose.position, message.pose.orientation
    x, y, z = messages.finite("position", p.x, p.y, p.z)
    requested = Pose((x, y, z), messages.unit_quaternion(*messages.finite("orientation", o.x, o.y, o.z, o.w)))
    if limit is not None:
        _check_jump(difference(requested, present), limit)
    return requested


def new_equilibrium(message: Any, base: str, present: Pose, limit: JumpSettings, running: bool) -> Pose:
    """Return the equilibrium pose in a message to a controller, which must be running; see `check_equilibrium`."""
    if not running:
        raise CommandError("the controller is not running, the pose is ignored; start it first")
    try:
        return check_equilibrium(message, base, present, limit)
    except CommandError as error:
        raise CommandError(f"equilibrium pose refused, the present one is kept: {error}") from None


def check_target(message: Any, base: str, start: Pose, box: Box, largest_turn: float) -> tuple[Vector, Vector]:
    """Return the position [m] of a commanded pose, and its rotation vector from the pose at the start [rad].

    Args:
        message: geometry_msgs/PoseStamped in the frame `base`; an empty frame name means this frame.
        base: name of the robot's base frame.
        start: pose of the end effector at the start of the controller.
        box: workspace of the end effector.
        largest_turn: largest angle of the rotation [rad].

    Raises:
        CommandError: the message is not a pose in this frame, or the pose is outside the workspace or turned too far.
    """
    requested = check_equilibrium(message, base, start)
    if not box.contains(requested.position):
        x, y, z = requested.position
        raise CommandError(f"pose refused: ({x:.3f}, {y:.3f}, {z:.3f}) m is outside of the workspace; valid: {box}")
    rotation = quaternions.difference(requested.orientation, start.orientation)
    if math.hypot(*rotation) > largest_turn:
        raise CommandError(
            f"pose refused: rotated by {math.hypot(*rotation):.3g} rad from the orientation at the start; valid: up "
            f"to {largest_turn:g} rad (largest_turn)"
        )
    return requested.position, rotation


def _check_jump(error: list[float], limit: JumpSettings) -> None:
    step, angle = math.hypot(*error[:3]), math.hypot(*error[3:])
    for distance, largest, unit, name in (
        (step, limit.largest_step, "m", "largest_step"),
        (angle, limit.largest_turn, "rad", "largest_turn"),
    ):
        if distance > largest:
            raise CommandError(
                f"{distance:.3g} {unit} from the present equilibrium; valid: up to {largest:g} {unit} ({name})"
            )
