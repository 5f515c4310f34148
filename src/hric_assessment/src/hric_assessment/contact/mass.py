"""Masses with which an arm hits: the reflected mass, the estimate of ISO/TS 15066, and the mass with locked joints.

For a contact at the point p along the unit normal n:

- reflected: 1 / (n' J (M + B)^-1 J' n), with the Jacobian J of the point, mass matrix M and rotor inertias B. All
  joints yield freely.
- standard: M/2 + m_L, half of the moving mass plus tool and load, at any point (`half_mass`).
- locked: 1 / (1/m + (r x n)' I^-1 (r x n)), where all moving links are one free rigid body of mass m, with the inertia
  tensor I about its centre of mass c, and r = p - c. No joint yields, and the base does not hold the body. This mass
  predicted the measured impacts of a Panda better than the reflected mass (Wang, Dehio, Kheddar, IEEE RA-L 2022, arXiv
  2109.04756). Rotors have no part in it: their masses are those of the links.

None of them is an upper limit of the others in every pose.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hric_assessment.contact.speed import half_mass
from hric_core import urdf
from hric_core.geometry import FloatArray, MassProperties
from hric_core.geometry.transforms import inverse
from hric_core.summation import total
from hric_dynamics.tree import Tree

LARGEST, REFLECTED, STANDARD, LOCKED = ROBOT_MASSES = ("largest", "reflected", "standard", "locked")
"""Masses with which a contact can be judged; the first is the default, and safe if it is not known which is right."""


class RobotMasses(NamedTuple):
    """Masses of an arm at a point along a direction [kg]; infinite: the arm does not yield, NaN: not known."""

    reflected: float
    standard: float
    locked: float

    def judged(self, which: str = LARGEST) -> float:
        """Return the mass for an assessment [kg]; `which`: one of ROBOT_MASSES."""
        return float(np.max(self)) if which == LARGEST else float(getattr(self, which))


class Mechanism:
    """Mechanism of a URDF, placed in the world, with its Jacobian and reflected mass at a point.

    Args:
        tree: URDF of the mechanism.
        joints: joints that move; all others are fixed at zero.
        rotors: rotor inertia at each joint [kg m^2].
        T_world_root: pose of the root link in the world, shape (4, 4).
        payloads: mass properties of payloads that the tree lacks, by link, in its frame.
    """

    def __init__(
        self,
        tree: urdf.Robot,
        joints: Sequence[str],
        rotors: Sequence[float],
        T_world_root: FloatArray | None = None,
        payloads: Mapping[str, MassProperties] = MappingProxyType({}),
    ) -> None:
        self.tree, self.joints, self._rotors = tree, tuple(joints), np.diag(rotors)
        self._links = dict(tree.links)
        for name, payload in payloads.items():
            link = self._links[name]
            self._links[name] = replace(link, mass=payload + (link.mass or MassProperties()))
        self._dynamics = Tree(replace(tree, links=self._links), joints)
        self._T_root_world = np.eye(4) if T_world_root is None else inverse(T_world_root)

    def at(self, q: FloatArray, link: str, point: Sequence[float]) -> tuple[FloatArray, FloatArray]:
        """Return the Jacobian J of a point of a link, and the inverse of M + B, shapes (3, n) and (n, n).

        J is in axes of the world; M: mass matrix, B: rotor inertias.

        Args:
            q: joint positions, shape (n,) [rad].
            link: link of the mechanism.
            point: point in the world, 3 floats [m].
        """
        R, p = self._T_root_world[:3, :3], self._T_root_world[:3, :3] @ point + self._T_root_world[:3, 3]
        J = np.asarray(R.T @ self._dynamics.point_jacobian(q.tolist(), link, p.tolist()))
        return J, np.asarray(np.linalg.inv(self._dynamics.mass_matrix(q.tolist()) + self._rotors))

    def reflected_mass(self, q: FloatArray, link: str, point: Sequence[float], normal: Sequence[float]) -> float:
        """Return the reflected mass 1 / (n' J (M + B)^-1 J' n) [kg] of a link at a point along a normal n.

        J: Jacobian of the point, M: mass matrix, B: rotor inertias. The mass is infinite if no joint lets the link
        yield along the normal, and NaN if M + B is singular. Point and normal are in the world frame.
        """
        try:
            J, inverse_mass = self.at(q, link, point)
        except np.linalg.LinAlgError:  # a description without masses
            return math.nan
        row = np.array(normal) @ J
        mobility = float(row @ inverse_mass @ row)
        return 1.0 / mobility if mobility > 0.0 else math.inf

    def balanced(
        self, q: FloatArray, link: str, point: Sequence[float], normal: Sequence[float], tau: FloatArray
    ) -> float:
        """Return the force along a normal with which static joint torques tau [N m] press at a point [N].

        It is n' (J W J')^-1 J W tau with W = (M + B)^-1; for tau = J' f this equals n' f.
        """
        J, W = self.at(q, link, point)
        return float(np.array(normal) @ np.linalg.solve(J @ W @ J.T, J @ W @ tau))

    def chain_of(self, link: str) -> tuple[str, ...]:
        """Return the joints beyond the first joint that moves a link, with this: those of one of several arms.

        They are all joints if none moves the link.
        """
        above = {joint.name for joint in self.tree.path(self.tree.root, link)}
        first = next((joint for joint in self.joints if joint in above), None)
        if first is None:
            return self.joints
        beyond = set(_beyond(self.tree, self.tree.joints[first].child))
        return tuple(joint for joint in self.joints if self.tree.joints[joint].child in beyond)

    def locked_mass(
        self, q: FloatArray, point: Sequence[float], normal: Sequence[float], joints: Sequence[str] | None = None
    ) -> float:
        """Return the mass at a point along a normal with all joints locked [kg]; NaN if the links have no mass.

        All links beyond the first joint are one free rigid body. Point and normal are in the world frame. The mass is
        infinite if a joint position is not known (NaN). `joints`: those of one of several arms; None: all.
        """
        moving = {link for joint in joints or self.joints for link in _beyond(self.tree, self.tree.joints[joint].child)}
        if not np.isfinite(q).all():
            return math.inf
        T = self.tree.poses(dict(zip(self.joints, q, strict=True)))
        links = [(link.mass, T[name]) for name, link in self._links.items() if name in moving]
        body = sum((mass.moved(T_link) for mass, T_link in links if mass is not None), MassProperties())
        if not body.mass > 0.0:
            return math.nan
        R, p = self._T_root_world[:3, :3], self._T_root_world[:3, 3]
        n = R @ normal
        lever = np.cross(R @ point + p - body.com, n)
        turning = float(lever @ np.linalg.pinv(body.inertia, hermitian=True) @ lever)  # point masses do not turn
        return 1.0 / (1.0 / body.mass + max(turning, 0.0))

    def robot_masses(
        self, q: FloatArray, link: str, point: Sequence[float], normal: Sequence[float], load: float = 0.0
    ) -> RobotMasses:
        """Return the masses of an arm at a point of a link along a normal, both in the world frame.

        load: mass that the arm holds, for the standard's estimate; the other two have the `payloads` [kg].
        """
        joints = self.chain_of(link)
        moving, tool = moving_masses(self.tree, joints)
        reflected, locked = self.reflected_mass(q, link, point, normal), self.locked_mass(q, point, normal, joints)
        return RobotMasses(reflected, half_mass(moving - tool, tool + load), locked)


def moving_masses(tree: urdf.Robot, joints: Sequence[str]) -> tuple[float, float]:
    """Return the moving mass of an arm, and the part of it that is the tool [kg].

    The moving mass is that of all links beyond the first of the joints; the tool is all that is attached to the link
    of the last one.
    """
    ordered = [joint for name, joint in tree.joints.items() if name in joints]

    def mass(links: Sequence[str]) -> float:
        return total(body.mass for link in links if (body := tree.links[link].mass) is not None)

    first, last = (_beyond(tree, joint.child) for joint in (ordered[0], ordered[-1]))
    return mass(first), mass(last[1:])


def _beyond(tree: urdf.Robot, link: str) -> list[str]:
    return [link, *(joint.child for joint, _ in tree.beyond(link))]
