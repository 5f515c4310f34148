"""Matching of an arm model's coordinates to the arm joints of `hric_human.body`, by bone motion and joint positions.

Only the bones are identified by name. Axes of bodies are assumed to be anatomical: computed axes are rounded to the
nearest body axis, and zero offsets to the nearest multiple of 90 deg.
"""

import logging
import math
from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.fitting.model import Coordinate
from hric_human.muscles.fitting.posture import (
    AXES,
    FAR,
    ModelPosture,
    circle_centre,
    nearest_axes,
    rotation_vector,
    unit,
)

LOG = logging.getLogger("hric.human.muscles")
SHOULDER, WRIST = ("sh_flex", "sh_abd", "sh_rot"), ("wr_flex", "wr_dev")
SMALLEST_CIRCLE = 0.004
"""Minimum usable radius of the circle on which the wrist centre moves about the pronation axis [m]; project default."""
_QUARTER = 0.5 * math.pi


class Hinge(NamedTuple):
    """Arm joint that corresponds to one coordinate of a model: joint angle = sign * coordinate + offset.

    Attributes:
        coordinate: coordinate of the model.
        sign: 1 or -1.
        offset: joint angle where the coordinate is 0 [rad].
    """

    coordinate: Coordinate
    sign: float
    offset: float

    @property
    def range(self) -> tuple[float, float]:
        """Range of the joint angle [rad]."""
        ends = [self.sign * end + self.offset for end in (self.coordinate.lower, self.coordinate.upper)]
        return min(ends), max(ends)

    def at(self, angle: float) -> dict[str, float]:
        """Return the coordinate's value for a joint angle [rad], by its name."""
        return {self.coordinate.name: self.sign * (angle - self.offset)}


class Matching:
    """Correspondence between a model's coordinates and the joints of an arm.

    Attributes:
        posture: posture of the model.
        hinges: joints that correspond to one coordinate, by name of the joint.
        shoulder: the three coordinates that rotate the humerus; empty if the shoulder is a hinge.

    Raises:
        HricError: the coordinates do not match the joints of an arm.
    """

    def __init__(self, posture: ModelPosture) -> None:
        self.posture, self._name = posture, posture.model.name
        self._thorax = self._axes_of_thorax()
        self.hinges = dict[str, Hinge]()
        elbow, sign = self._bending()
        self._humerus = self._axes_of_humerus(elbow, sign)
        self._add("el_flex", elbow, sign, self._bent())
        posture.put(self.hinges["el_flex"].at(0.0))
        self._match_pronation()
        self._match_wrist()
        self.shoulder = self._match_shoulder()

    def R_ground_thorax(self) -> FloatArray:
        """Return the rotation of the thorax in the ground, with thorax axes right, up, back, shape (3, 3)."""
        return np.asarray(self.posture.frame(self.posture.bones.thorax)[0] @ self._thorax)

    def R_ground_humerus(self) -> FloatArray:
        """Return the rotation of the humerus in the ground, with humerus axes right, up, back, shape (3, 3)."""
        return np.asarray(self.posture.frame(self.posture.bones.humerus)[0] @ self._humerus)

    def R_thorax_humerus(self) -> FloatArray:
        """Return the rotation of the humerus in the thorax, with axes right, up, back of both, shape (3, 3)."""
        return np.asarray(self.R_ground_thorax().T @ self.R_ground_humerus())

    def _axes_of_thorax(self) -> FloatArray:
        """Return right, up and back of the thorax in axes of its body, shape (3, 3).

        Up is against gravity, right is from the body's origin towards the right shoulder.
        """
        R_ground_body, origin = self.posture.frame(self.posture.bones.thorax)
        up = self.posture.model.up
        to_shoulder = self.posture.shoulder - origin
        right = unit(to_shoulder - up * (up @ to_shoulder))
        axes = np.array([right, up, np.cross(right, up)]).T
        return nearest_axes(R_ground_body.T @ axes, f"{self._name}, thorax")

    def _bending(self) -> tuple[Coordinate, float]:
        """Return the coordinate that flexes the elbow, and 1.0 if it rises with flexion, else -1.0."""
        posture, bones = self.posture, self.posture.bones
        forearm = unit(posture.wrist - posture.elbow)
        across = {
            coordinate: float(np.linalg.norm(np.cross(posture.axis(coordinate, bones.ulna), forearm)))
            for coordinate in posture.between(bones.humerus, bones.ulna)
        }
        if not across:
            raise HricError(f"{self._name} has no coordinate that bends the elbow")
        elbow = max(across, key=lambda coordinate: across[coordinate])
        bent = []
        for end in (elbow.lower, elbow.upper):
            posture.put({elbow.name: max(-math.pi, min(math.pi, end))})
            upper_arm, forearm = posture.elbow - posture.shoulder, posture.wrist - posture.elbow
            bent.append(math.acos(max(-1.0, min(1.0, float(unit(upper_arm) @ unit(forearm))))))
        posture.put({elbow.name: elbow.default})
        return elbow, 1.0 if bent[1] > bent[0] else -1.0

    def _axes_of_humerus(self, elbow: Coordinate, sign: float) -> FloatArray:
        """Return right, up and back of the humerus in axes of its body, shape (3, 3).

        Up is along the bone, right along the axis of elbow flexion.
        """
        posture = self.posture
        up = unit(posture.shoulder - posture.elbow)
        axis = sign * posture.axis(elbow, posture.bones.ulna)
        right = unit(axis - up * (up @ axis))
        axes = np.array([right, up, np.cross(right, up)]).T
        return nearest_axes(posture.frame(posture.bones.humerus)[0].T @ axes, f"{self._name}, humerus")

    def _bent(self) -> float:
        """Return the current flexion angle of the elbow [rad], in the plane perpendicular to its axis."""
        _, y, z = self.R_ground_humerus().T @ (self.posture.wrist - self.posture.elbow)
        return math.atan2(-z, -y)

    def _match_pronation(self) -> None:
        """Match joint pro_sup to the coordinate that rotates the forearm about its long axis at a straight elbow."""
        posture, bones = self.posture, self.posture.bones
        for coordinate in reversed(posture.between(bones.humerus, bones.radius)):
            along = float((self.R_ground_humerus().T @ posture.axis(coordinate, bones.radius))[1])
            if abs(along) > math.cos(FAR):
                self._add(
                    "pro_sup",
                    coordinate,
                    math.copysign(1.0, along),
                    self._pronated(coordinate, math.copysign(1.0, along)),
                )
                posture.put(self.hinges["pro_sup"].at(0.0))
                return

    def _pronated(self, coordinate: Coordinate, sign: float) -> float:
        """Return the current angle of pronation [rad], 0 with the thumb forward.

        The thumb is assumed forward where the wrist centre is forward of the pronation axis, or, if the centre is on
        the axis, in the middle of the coordinate's range.
        """
        at, wrist = self.posture.angles[coordinate.name], []
        for angle in (at, at + 1.0, at - 1.0):
            self.posture.put({coordinate.name: angle})
            wrist.append(self.R_ground_humerus().T @ self.posture.wrist)
        self.posture.put({coordinate.name: at})
        x, _, z = wrist[0] - circle_centre(*wrist)
        if math.hypot(x, z) > SMALLEST_CIRCLE:
            return math.atan2(-x, -z)
        return sign * (at - 0.5 * (coordinate.lower + coordinate.upper))

    def _match_wrist(self) -> None:
        """Match coordinates of the hand to wr_flex and wr_dev, both 0 with a straight wrist and the thumb forward."""
        posture, bones = self.posture, self.posture.bones
        if not bones.hand:
            return
        R = self.R_ground_humerus().T
        axes = {
            coordinate: R @ posture.axis(coordinate, bones.hand)
            for coordinate in posture.between(bones.radius, bones.hand)
        }
        for joint in WRIST:
            along = {coordinate: float(axis @ AXES[joint]) for coordinate, axis in axes.items()}
            if not along:
                return
            coordinate = max(along, key=lambda coordinate: abs(along[coordinate]))
            if abs(along[coordinate]) > math.cos(FAR):
                sign = math.copysign(1.0, along[coordinate])
                self._add(joint, coordinate, sign, sign * posture.angles[coordinate.name])
                del axes[coordinate]
            else:
                off = math.degrees(math.acos(abs(along[coordinate])))
                LOG.warning(
                    "%s: joint %s gets no muscles, since the axis of the nearest coordinate of the hand, %s, is "
                    "%.0f deg away from the joint's; valid: up to %.0f deg",
                    self._name,
                    joint,
                    coordinate.name,
                    off,
                    math.degrees(FAR),
                )

    def _match_shoulder(self) -> tuple[Coordinate, ...]:
        """Return the three coordinates nearest to the humerus; match a shoulder with one coordinate as a hinge."""
        bones = self.posture.bones
        coordinates = self.posture.between(bones.thorax, bones.humerus)
        if len(coordinates) == 1:
            self._match_shoulder_hinge(coordinates[0])
            return ()
        if len(coordinates) < len(SHOULDER):
            raise HricError(
                f"{self._name} has {len(coordinates)} independent coordinates at the shoulder; valid: one, or three "
                "that rotate the humerus to any orientation"
            )
        if resting := [coordinate.name for coordinate in coordinates[: -len(SHOULDER)]]:
            LOG.warning(
                "%s: the shoulder coordinates %s keep their default values, since no coupler lets them follow the arm",
                self._name,
                ", ".join(resting),
            )
        return tuple(coordinates[-len(SHOULDER) :])

    def _match_shoulder_hinge(self, coordinate: Coordinate) -> None:
        axis = self.R_ground_thorax().T @ self.posture.axis(coordinate, self.posture.bones.humerus)
        joint = max(SHOULDER, key=lambda name: abs(float(axis @ AXES[name])))
        along = float(axis @ AXES[joint])
        if abs(along) < math.cos(FAR):
            raise HricError(
                f"{self._name}: the axis of the shoulder's only coordinate, {coordinate.name}, is more than "
                f"{math.degrees(FAR):.0f} deg away from the axes of {', '.join(SHOULDER)}"
            )
        angle = float(rotation_vector(self.R_thorax_humerus()) @ AXES[joint])
        self._add(joint, coordinate, math.copysign(1.0, along), angle)

    def _add(self, joint: str, coordinate: Coordinate, sign: float, angle: float) -> None:
        """Match a joint to a coordinate as a hinge; angle: current joint angle [rad]."""
        offset = math.remainder(angle - sign * self.posture.angles[coordinate.name], 2.0 * math.pi)
        nearest = _QUARTER * round(offset / _QUARTER)
        if abs(offset - nearest) > FAR:
            raise HricError(
                f"{self._name}: where {coordinate.name} is 0, {joint} is {math.degrees(offset):.0f} deg; valid: within "
                f"{math.degrees(FAR):.0f} deg of a multiple of 90 deg"
            )
        self.hinges[joint] = Hinge(coordinate, sign, nearest)
        LOG.info("%s: %s = %+.0f * %s %+.0f deg", self._name, joint, sign, coordinate.name, math.degrees(nearest))
