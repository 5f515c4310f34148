"""Poses as position and quaternion, on plain floats; poses as functions of time; change of the vertical axis."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from hric_core.errors import ParameterError
from hric_core.geometry import quaternions
from hric_core.geometry.quaternions import IDENTITY, Quaternion, Vector
from hric_core.geometry.transforms import FloatArray, homogeneous, quaternion_from_rotation, rotation_from_quaternion
from hric_core.native import load
from hric_core.parameters import Settings, numbers

_built = load("hric_quaternions")
ORIGIN: Vector = (0.0, 0.0, 0.0)
UP_AXES = ("y", "z")
"""Possible vertical axes of motion capture data: Motive streams y up by default or z up; c3d files have either."""


class Pose(NamedTuple):
    """Position [m] and orientation (unit quaternion x, y, z, w) of a frame in another."""

    position: Vector = ORIGIN
    orientation: Quaternion = IDENTITY

    @classmethod
    def of_column_major(cls, T_a_b: Sequence[float]) -> "Pose":
        """Return the pose of a column-major transform, 16 floats; its largest quaternion component is positive."""
        return cls(*_built.pose_of_column_major(T_a_b))

    def transform(self) -> FloatArray:
        """Return the pose as a homogeneous matrix, shape (4, 4)."""
        return homogeneous(rotation_from_quaternion(self.orientation), self.position)


def pose_of_transform(T_a_b: FloatArray) -> Pose:
    """Return the pose of a homogeneous transformation matrix, shape (4, 4)."""
    return Pose(tuple(T_a_b[:3, 3].tolist()), quaternion_from_rotation(T_a_b[:3, :3]))


def transformed(T_a_b: Pose, p_b: Vector) -> Vector:
    """Return the coordinates in frame a of a point that is given in frame b [m]."""
    x, y, z = quaternions.rotated(T_a_b.orientation, p_b)
    return T_a_b.position[0] + x, T_a_b.position[1] + y, T_a_b.position[2] + z


def compose(T_a_b: Pose, T_b_c: Pose) -> Pose:
    """Return T_a_c = T_a_b T_b_c, the pose of frame c in frame a."""
    return Pose(transformed(T_a_b, T_b_c.position), quaternions.product(T_a_b.orientation, T_b_c.orientation))


def inverse(T_a_b: Pose) -> Pose:
    """Return T_b_a, the pose of frame a in frame b."""
    x, y, z = T_a_b.position
    back = quaternions.inverse(T_a_b.orientation)
    return Pose(quaternions.rotated(back, (-x, -y, -z)), back)


difference: Callable[[Pose, Pose], list[float]] = _built.pose_difference
"""Function (a, b) that returns pose a minus pose b, both in one frame, in its axes: position [m], rotation vector
[rad], 6 floats."""


def interpolated(start: Pose, goal: Pose, share: float) -> Pose:
    """Return the pose at a fraction `share` (0 to 1) from start to goal: a straight line, and the shorter rotation."""
    return Pose(*_built.pose_interpolated(start, goal, share))


def minimum_jerk(u: float) -> float:
    """Return the fraction s of the path after the fraction u of the time, from rest to rest with minimum jerk.

    s = 10 u^3 - 15 u^4 + 6 u^5 (Flash and Hogan, J. Neurosci. 5:1688, 1985). ds/du is at most 1.875, at u = 0.5."""
    return u * u * u * (10 - 15 * u + 6 * u * u)


class Track:
    """Pose as a function of time, interpolated between given poses: linear position, shortest rotation.

    Before the first time it is the first pose, after the last time the last pose.

    Args:
        times: times of the poses, increasing [s].
        poses: one for each time.
        minimum_jerk: True if the motion between two poses begins and ends at rest, with minimum jerk.

    Raises:
        ParameterError: no poses, another number of times, times that do not increase, or values that are not finite.
    """

    def __init__(self, times: Sequence[float], poses: Sequence[Pose], minimum_jerk: bool = False) -> None:
        if not times or len(times) != len(poses):
            raise ParameterError(
                f"a motion needs one time for each pose, and at least one pose; got {len(times)} and {len(poses)}"
            )
        if wrong := [b for a, b in pairwise(times) if b <= a]:
            raise ParameterError(f"the times of a motion must increase; {wrong[0]:g} s does not")
        if not all(finite := [all(map(math.isfinite, (*pose.position, *pose.orientation))) for pose in poses]):
            raise ParameterError(f"the pose at {times[finite.index(False)]:g} s of a motion is not finite")
        self._times, self._poses, self._minimum_jerk = list(times), list(poses), minimum_jerk

    def __call__(self, time: float) -> Pose:
        """Return the interpolated pose at a time [s]."""
        after = bisect_right(self._times, time)
        if after == 0 or after == len(self._times):
            return self._poses[min(after, len(self._times) - 1)]
        begin, end = self._times[after - 1], self._times[after]
        u = (time - begin) / (end - begin)
        s = minimum_jerk(u) if self._minimum_jerk else u
        return interpolated(self._poses[after - 1], self._poses[after], s)


def z_up(up: str, v: Vector) -> Vector:
    """Return a vector in axes with z up; `up`: vertical axis of the given vector's axes, "y" or "z".

    The result is (x, -z, y) if y is up (thesis eq. of chapter 3.3: +90 degrees about x)."""
    return v if up == "z" else (v[0], -v[2], v[1])


def from_z_up(up: str, v: Vector) -> Vector:
    """Return a vector, given in axes with z up, in axes whose vertical axis is `up`, "y" or "z"."""
    return v if up == "z" else (v[0], v[2], -v[1])


def pose_z_up(up: str, pose: Pose) -> Pose:
    """Return a pose in axes with z up; `up`: vertical axis of the given pose's axes, "y" or "z".

    World and body axes are renamed alike (the vector part is mapped: q' = A q A^-1), as Motive does when its up axis is
    changed, so that a body that is aligned with the world stays aligned.
    """
    x, y, z, w = pose.orientation
    return pose if up == "z" else Pose(z_up(up, pose.position), (*z_up(up, (x, y, z)), w))


def pose_from_z_up(up: str, pose: Pose) -> Pose:
    """Return a pose, given in axes with z up, in axes whose vertical axis is `up`; the inverse of `pose_z_up`."""
    x, y, z, w = pose.orientation
    return pose if up == "z" else Pose(from_z_up(up, pose.position), (*from_z_up(up, (x, y, z)), w))


def _unit_quaternion(xyzw: Quaternion) -> Quaternion:
    if abs(math.hypot(*xyzw) - 1.0) > 1e-3:
        raise ValueError
    return quaternions.normalized(xyzw)


_XYZW: Any = numbers(4, IDENTITY, name="xyzw", made=_unit_quaternion, text="orientation, unit quaternion x, y, z, w")
_XYZW.accepts = "a unit quaternion, x, y, z, w"


@dataclass(frozen=True)
class PoseSettings(Settings):
    """Pose as two parameters: position `xyz` and quaternion `xyzw`."""

    xyz: Vector = numbers(3, ORIGIN, unit="m", text="position")
    xyzw: Quaternion = _XYZW

    @property
    def pose(self) -> Pose:
        """Position and orientation as one `Pose`."""
        return Pose(self.xyz, self.xyzw)
