"""Mass, centre of mass and inertia of rigid bodies: change of frame, sum of bodies, and check for consistency."""

import itertools
from dataclasses import dataclass, field

import numpy as np

from hric_core.geometry.transforms import FloatArray

_E = np.eye(3)


@dataclass(frozen=True)
class MassProperties:
    """Mass distribution of a rigid body in one frame; massless by default.

    Attributes:
        mass: [kg].
        com: centre of mass, shape (3,) [m].
        inertia: inertia tensor about the centre of mass in the axes of the frame (Ixy = -integral x y dm), shape (3, 3)
            [kg m^2]; may be physically inconsistent.
    """

    mass: float = 0.0
    com: FloatArray = field(default_factory=lambda: np.zeros(3))
    inertia: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))

    def moved(self, T_new_old: FloatArray) -> "MassProperties":
        """Return the properties in another frame; T_new_old: pose of the present frame in the new one, shape (4, 4)."""
        R = T_new_old[:3, :3]
        return MassProperties(self.mass, R @ self.com + T_new_old[:3, 3], R @ self.inertia @ R.T)

    def __add__(self, other: "MassProperties") -> "MassProperties":
        """Return the properties of two joined bodies, given in the same frame, by the parallel-axis theorem."""
        mass = self.mass + other.mass
        com = (self.mass * self.com + other.mass * other.com) / mass if mass != 0.0 else np.zeros(3)
        inertia = np.zeros((3, 3))
        for part in (self, other):
            inertia += part.inertia + steiner_term(part.mass, part.com - com)
        return MassProperties(mass, com, inertia)

    def principal(self) -> tuple[FloatArray, FloatArray]:
        """Return principal moments, shape (3,) [kg m^2], and rotation R, shape (3, 3): inertia = R diag(moments) R'.

        Of the possible orders of the axes, the one with the least rounding error in roll, pitch and yaw is chosen.
        """
        moments, axes = np.linalg.eigh(self.inertia)
        best: tuple[int, ...] = (0, 1, 2)
        heights = np.abs(axes[2]).tolist()
        for order in itertools.permutations(best):
            if heights[order[0]] < heights[best[0]] - 1e-9:
                best = order
        R = axes[:, best].copy()
        if np.linalg.det(R) < 0.0:
            R[:, 0] = -R[:, 0]
        return moments[list(best)], R


@dataclass(frozen=True)
class InertiaVerdict:
    """Result of the test of an inertia tensor for physical consistency.

    Attributes:
        moments: principal moments, ascending, shape (3,) [kg m^2].
        triangle_margin: sum of the two smaller moments less the largest [kg m^2]; negative breaks the triangle
            inequality.
    """

    moments: FloatArray
    triangle_margin: float

    @property
    def positive_definite(self) -> bool:
        """True if every principal moment is above zero."""
        return bool(self.moments[0] > 0.0)

    def reasons(self) -> list[str]:
        """Return why no real body can have this inertia tensor, one text per reason; empty if it is consistent."""
        reasons = []
        if self.triangle_margin < 0.0:
            reasons.append(f"breaks the triangle inequality by {-self.triangle_margin:.6f} kg m^2")
        if not self.positive_definite:
            negative = ", ".join(f"{moment:.4f}" for moment in self.moments if moment <= 0.0)
            reasons.append(f"is not positive definite (eigenvalues {negative} kg m^2)")
        return reasons


def judge(inertia: FloatArray) -> InertiaVerdict:
    """Return principal moments and triangle margin of an inertia tensor, shape (3, 3) [kg m^2]."""
    moments = np.asarray(np.linalg.eigvalsh(inertia), dtype=np.float64)
    return InertiaVerdict(moments, float(moments[0] + moments[1] - moments[2]))


def steiner_term(mass: float, com: FloatArray) -> FloatArray:
    """Return the inertia of a point mass about the origin: m (q'q E - q q'), shape (3, 3) [kg m^2].

    Args:
        mass: mass m [kg].
        com: position q of the mass, from the origin, shape (3,) [m]. Its sign does not matter.
    """
    return mass * (com @ com * _E - com[:, None] * com)


def tensor(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> FloatArray:
    """Return the symmetric inertia tensor with these six elements [kg m^2], shape (3, 3)."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)
