"""Posture of an arm model: positions of its bones and joint centres, and rotation axes of its coordinates.

Axes in this file are x right, y up, z back of an arm that hangs with its thumb forward, see `hric_human.body.joints`.
"""

import math
from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body.joints import ARM
from hric_human.muscles.fitting.bones import chain, find_bones
from hric_human.muscles.fitting.model import ArmModel, Coordinate
from hric_human.muscles.fitting.sample import R_LINK_OPENSIM

AXES = {row.name: np.array(row.axis, np.float64) @ R_LINK_OPENSIM for row in ARM}
"""Unit axis of each arm joint of `hric_human.body`, in axes x right, y up, z back, shape (3,)."""
STEP = 1e-4
"""Step of numerical differences [rad]."""
FAR = math.radians(30.0)
"""Maximum angle between an axis or offset of the model and the joint matched to it [rad]; project default."""
SLOW = 1e-3
"""Angular rate of a bone per rate of a coordinate; below it the coordinate counts as not rotating the bone [1]."""


class ModelPosture:
    """Arm model together with the current angles of its coordinates.

    Attributes:
        model: model, moved to these angles.
        bones: bones of the model's right arm.
        angles: current angles of the model's coordinates [rad].

    Raises:
        HricError: the model has no right arm.
    """

    def __init__(self, model: ArmModel) -> None:
        self.model, self.bones = model, find_bones(model)
        self.angles = {coordinate.name: coordinate.default for coordinate in model.coordinates}
        self.model.put(self.angles)

    def put(self, angles: Mapping[str, float]) -> None:
        """Set some of the coordinates [rad]; the others do not change."""
        self.angles |= angles
        self.model.put(angles)

    def frame(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return rotation, shape (3, 3), and origin [m] of a body in the ground frame; body "" is the ground."""
        return self.model.frame(body) if body else (np.eye(3), np.zeros(3))

    @property
    def shoulder(self) -> FloatArray:
        """Shoulder joint centre in the ground frame, shape (3,) [m]."""
        return self.model.centre(self.bones.shoulder)

    @property
    def elbow(self) -> FloatArray:
        """Elbow joint centre in the ground frame, shape (3,) [m]."""
        return self.model.centre(self.bones.forearm)

    @property
    def wrist(self) -> FloatArray:
        """Wrist joint centre in the ground frame, shape (3,) [m]; without a hand, the forearm's centre of mass."""
        bones = self.bones
        return self.model.centre(bones.wrist) if bones.wrist else self.model.mass_centre(bones.radius)

    def between(self, proximal: str, distal: str) -> list[Coordinate]:
        """Return the coordinates between two bodies of a chain that rotate the distal body."""
        bodies = chain(self.model, proximal, distal)
        coordinates = [
            coordinate
            for coordinate in self.model.coordinates
            if coordinate.body in bodies and self.axis(coordinate, distal).any()
        ]
        return sorted(coordinates, key=lambda coordinate: bodies.index(coordinate.body))

    def axis(self, coordinate: Coordinate, body: str) -> FloatArray:
        """Return the unit axis about which a coordinate rotates a body in the ground, shape (3,); 0 if it does not."""
        at, frames = self.angles[coordinate.name], []
        for angle in (at + STEP, at - STEP):
            self.put({coordinate.name: angle})
            frames.append(self.frame(body)[0])
        self.put({coordinate.name: at})
        rate = small_rotation(frames[0] @ frames[1].T) / (2.0 * STEP)
        return unit(rate) if np.linalg.norm(rate) > SLOW else np.zeros(3)


def unit(vector: FloatArray) -> FloatArray:
    """Return the vector scaled to length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def rotation_vector(R: FloatArray) -> FloatArray:
    """Return the rotation vector (axis times angle [rad]) of a rotation matrix R, shape (3, 3)."""
    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def small_rotation(R: FloatArray) -> FloatArray:
    """Return axis times sine of the angle of a rotation matrix R, shape (3, 3); if small, the rotation vector [rad]."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


def nearest_axes(axes: FloatArray, what: str) -> FloatArray:
    """Return the rotation by multiples of 90 deg that is nearest to axes of shape (3, 3).

    Raises:
        HricError: the nearest rotation is more than FAR away.
    """
    quarters = Rotation.create_group("O").as_matrix().round() + 0.0
    nearest = quarters[np.argmax((quarters * axes).sum(axis=(1, 2)))]
    off = float(np.linalg.norm(rotation_vector(axes @ nearest.T)))
    if off > FAR:
        raise HricError(
            f"{what}: the axes of the model's body are {math.degrees(off):.0f} deg away from right, up and back of the "
            f"bone; valid: along these directions, in any order, within {math.degrees(FAR):.0f} deg"
        )
    return np.asarray(nearest)


def circle_centre(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the centre of the circle through three points of shape (3,); point a if they lie on one line."""
    ab, ac = b - a, c - a
    n = np.cross(ab, ac)
    if not np.linalg.norm(n) > 0.0:
        return a
    return np.asarray(a + (np.cross(n, ab) * (ac @ ac) + np.cross(ac, n) * (ab @ ab)) / (2.0 * (n @ n)))
