"""Steiner's theorem, triangle inequality and definiteness of rigid-body inertia tensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinkInertia:
    """Inertial parameters of a link, all in the axes of the link's frame.

    Args:
        mass: mass [kg].
        com: centre of mass from the link's origin, shape (3,) [m].
        inertia: tensor about the centre of mass, shape (3, 3) [kg m^2], off-diagonals as tensor elements (URDF's convention).
    """

    mass: float
    com: Array
    inertia: Array


@dataclass(frozen=True)
class Verdict:
    """Whether a tensor can belong to a body.

    Args:
        moments: principal moments, ascending, shape (3,) [kg m^2].
        triangle_margin: sum of the two smaller moments less the largest [kg m^2]; negative breaks the triangle inequality.
    """

    moments: Array
    triangle_margin: float

    @property
    def positive_definite(self) -> bool:
        """Whether every principal moment is above zero."""
        return bool(self.moments[0] > 0.0)

    @property
    def physical(self) -> bool:
        """Whether some distribution of mass has this tensor."""
        return self.positive_definite and self.triangle_margin >= 0.0

    def reasons(self) -> list[str]:
        """Why the tensor is not physical, one text per reason; empty if it is."""
        found = []
        if self.triangle_margin < 0.0:
            found.append(f"breaks the triangle inequality by {-self.triangle_margin:.6f} kg m^2")
        if not self.positive_definite:
            negative = ", ".join(f"{moment:.4f}" for moment in self.moments if moment <= 0.0)
            found.append(f"is not positive definite (eigenvalues {negative} kg m^2)")
        return found


def steiner_term(mass: float, com: Array) -> Array:
    """Inertia of the whole mass put at its centre, about the origin: m (q'q E - q q'), shape (3, 3) [kg m^2].

    Args:
        mass: mass [kg].
        com: q, centre of mass from the origin, shape (3,) [m]. Its sign does not matter.
    """
    q = np.asarray(com, dtype=np.float64)
    return mass * (q @ q * np.eye(3) - np.outer(q, q))


def com_to_origin(inertia_com: Array, mass: float, com: Array) -> Array:
    """Apply Steiner's theorem (thesis Eq. 1): the tensor about the centre of mass, seen about the origin, shape (3, 3) [kg m^2]."""
    return inertia_com + steiner_term(mass, com)


def origin_to_com(inertia_origin: Array, mass: float, com: Array) -> Array:
    """Undo Steiner's theorem (thesis Eq. 2): the tensor about the origin, seen about the centre of mass, shape (3, 3) [kg m^2]."""
    return inertia_origin - steiner_term(mass, com)


def judge(inertia: Array) -> Verdict:
    """Principal moments and triangle margin of a symmetric tensor, shape (3, 3) [kg m^2]."""
    moments = np.asarray(np.linalg.eigvalsh(inertia), dtype=np.float64)
    return Verdict(moments, float(moments[0] + moments[1] - moments[2]))


def tensor(xx: float, xy: float, xz: float, yy: float, yz: float, zz: float) -> Array:
    """Symmetric tensor of its six elements, shape (3, 3) [kg m^2]."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)
