"""Shoulder girdle: orientation of clavicle and scapula as functions of the arm's direction, by a smoothed regression.

De Groot & Brand, A three-dimensional regression model of the shoulder rhythm, Clin. Biomech. 16(9):735-743, 2001, as
used by the authors of the Dynamic Arm Simulator: the angles of clavicle and scapula are linear in the arm's plane of
elevation and elevation. For a hanging arm the plane is undefined, and so is the regression; it is therefore replaced by
a quadratic in the direction of the humerus, fitted to the regression in its valid range. Axes are those of the thorax
in the Delft model: x right, y up, z back.
"""

import math

import numpy as np

from hric_core.geometry import FloatArray
from hric_core.geometry.transforms import rotation_about

CLAVICLE_AT_REST = (-28.573324, 11.679804, 7.482095)
SCAPULA_AT_REST = (32.047376, 10.6691, -10.320259)
"""Rotations about y, z and x at rest [deg]: means over subjects, taken from the Dynamic Arm Simulator."""
REGRESSION = {
    "clavicle_y": (-4.983, 0.120, -0.242, 0.851, CLAVICLE_AT_REST[0]),
    "clavicle_z": (3.917, -0.046, 0.123, 0.493, CLAVICLE_AT_REST[1]),
    "scapula_y": (-1.203, 0.140, -0.049, 0.901, SCAPULA_AT_REST[0]),
    "scapula_z": (3.095, -0.079, 0.396, 0.414, SCAPULA_AT_REST[1]),
    "scapula_x": (0.659, -0.028, 0.184, 0.886, SCAPULA_AT_REST[2]),
}
"""Regression of each angle: constant [deg]; slopes with plane of elevation, elevation, angle at rest; angle at rest.

The angle at rest is in degrees.
"""
ELEVATIONS, PLANES = np.arange(20.0, 121.0, 5.0), np.arange(-20.0, 121.0, 5.0)
"""Elevations and planes of elevation at which the quadratic is fitted [deg]; plane 0 is sideward, 90 forward.

Project default, unconfirmed.
"""
_X, _Y, _Z = np.eye(3)


def about_yzx(y: float, z: float, x: float) -> FloatArray:
    """Return the rotation Ry(y) Rz(z) Rx(x), shape (3, 3), for angles [rad]."""
    return rotation_about(_Y, y) @ rotation_about(_Z, z) @ rotation_about(_X, x)


def angles_yzx(R: FloatArray) -> tuple[float, float, float]:
    """Return the angles y, z, x [rad] of a rotation R = Ry(y) Rz(z) Rx(x) of shape (3, 3)."""
    return math.atan2(-R[2, 0], R[0, 0]), math.asin(max(-1.0, min(1.0, R[1, 0]))), math.atan2(-R[1, 2], R[1, 1])


def angles_yzy(R: FloatArray) -> tuple[float, float, float]:
    """Return the angles y, z, yy [rad] of a rotation R = Ry(y) Rz(z) Ry(yy) of shape (3, 3); z is from 0 to pi."""
    z = math.acos(max(-1.0, min(1.0, R[1, 1])))
    if math.sin(z) < 1e-9:
        return math.atan2(R[0, 2], R[2, 2]), z, 0.0
    return math.atan2(R[2, 1], -R[0, 1]), z, math.atan2(R[1, 2], R[1, 0])


class Girdle:
    """Shoulder rhythm: orientation of clavicle and scapula for a direction of the humerus.

    Attributes:
        rms: root mean square difference of the quadratic from the published regression, by angle [deg].
    """

    def __init__(self) -> None:
        plane, elevation = (grid.ravel() for grid in np.meshgrid(PLANES, ELEVATIONS))
        a, b = np.radians(plane), np.radians(elevation)
        directions = np.stack([np.cos(a) * np.sin(b), -np.cos(b), -np.sin(a) * np.sin(b)], axis=1)
        terms = _quadratic(directions)
        self.rms: dict[str, float] = {}
        self._coefficients: list[FloatArray] = []
        for name, (constant, of_plane, of_elevation, of_rest, rest) in REGRESSION.items():
            angle = constant + of_plane * plane + of_elevation * elevation + of_rest * rest
            solution, *_ = np.linalg.lstsq(terms, angle)
            self.rms[name] = float(np.sqrt(np.mean((terms @ solution - angle) ** 2)))
            self._coefficients.append(solution)

    def rotations(self, humerus: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rotations of clavicle and scapula in the thorax, shape (3, 3) each.

        Args:
            humerus: unit vector along the humerus, from shoulder to elbow, in axes of the thorax, shape (3,).
        """
        terms = _quadratic(humerus[None])[0]
        clavicle_y, clavicle_z, *scapula = (math.radians(terms @ row) for row in self._coefficients)
        R_thorax_scapula = about_yzx(*scapula)
        return _turned(about_yzx(clavicle_y, clavicle_z, 0.0), R_thorax_scapula), R_thorax_scapula


def _quadratic(d: FloatArray) -> FloatArray:
    """Return all monomials up to second order of unit vectors d, shape (samples, 3), but z^2 = 1 - x^2 - y^2."""
    x, y, z = d.T
    return np.stack([np.ones(len(d)), x, y, z, x * x, y * y, x * y, x * z, y * z], axis=1)


def _turned(R_thorax_clavicle: FloatArray, R_thorax_scapula: FloatArray) -> FloatArray:
    """Return the clavicle, rotated about its axis so that its rotation relative to the scapula since rest is minimal.

    The minimal angle of the rotation (maximal trace) is used instead of van der Helm's sum of three angles.
    """
    at_rest = about_yzx(*np.radians(CLAVICLE_AT_REST))
    relative = at_rest.T @ about_yzx(*np.radians(SCAPULA_AT_REST))
    y, z, _ = angles_yzx(at_rest.T @ R_thorax_clavicle)
    turned = at_rest @ about_yzx(y, z, 0.0)
    M = turned.T @ R_thorax_scapula @ relative.T
    return np.asarray(turned @ rotation_about(_X, math.atan2(M[2, 1] - M[1, 2], M[1, 1] + M[2, 2])))
