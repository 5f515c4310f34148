"""Cartesian impedance law: spring and damper to an equilibrium pose, and a posture in the null space. No ROS.

With e the pose error in base axes (position, then rotation vector), J the Jacobian of the end effector, M the mass
matrix and B the rotor inertia:

    F   = -K e - D (J dq - v)               K, D diagonal;  D = 2 zeta sqrt(K)  (zeta = 1: critical for a unit inertia)
    tau = J^T F + N tau_0 + C dq            tau_0 = k_n (q_n - q) - 2 sqrt(k_n) dq
    N   = 1 - J^T (J (M+B)^-1 J^T)^-1 J (M+B)^-1

q and dq are the joint positions and velocities, C dq is the Coriolis torque, q_n the posture, k_n the null-space
stiffness, v the velocity of an equilibrium on a planned motion (otherwise zero). The rules for D and tau_0 are those of
franka_ros's CartesianImpedanceExampleController. N is the dynamically consistent projector (Khatib 1987, "A unified
approach for motion and force control of robot manipulators"): the posture torque does not accelerate the end effector.
For singular poses 1e-6/kg is added to the diagonal of J (M+B)^-1 J^T, so near them N does not protect the directions in
which the joints cannot move the end effector.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_core.geometry import poses
from hric_core.native import load, vectors

FloatArray = npt.NDArray[np.float64]

_compiled = load("hric_cartesian_law")
_NEAR = [1e-9] * 6
"""Differences up to which a pose has reached its target [m], [rad]."""


class Compliance(NamedTuple):
    """Stiffnesses and damping ratios, adjustable while the controller runs.

    Attributes:
        translational_stiffness: stiffness of the end effector's position [N/m].
        rotational_stiffness: stiffness of the end effector's orientation [N m/rad].
        translational_damping_ratio, rotational_damping_ratio: damping ratios zeta of position and orientation [1].
        nullspace_stiffness: stiffness k_n of the posture in the null space [N m/rad].
    """

    translational_stiffness: float
    rotational_stiffness: float
    translational_damping_ratio: float
    rotational_damping_ratio: float
    nullspace_stiffness: float

    def towards(self, goal: "Compliance", share: float) -> "Compliance":
        """Return the gains at the fraction `share` (0 to 1) between these and `goal`."""
        return Compliance(
            *[b if share >= 1.0 or abs(b - a) < 1e-6 else a + share * (b - a) for a, b in zip(self, goal, strict=True)]
        )

    def softened(self, stiffness: float) -> "Compliance":
        """Return these gains with a translational stiffness of at most `stiffness` [N/m]."""
        return self._replace(translational_stiffness=min(self.translational_stiffness, stiffness))

    def stiffness(self) -> list[float]:
        """Return the diagonal of the stiffness matrix K, 6 floats [N/m], [N m/rad]."""
        return [self.translational_stiffness] * 3 + [self.rotational_stiffness] * 3

    def damping(self) -> list[float]:
        """Return the diagonal of the damping matrix D, 6 floats [N s/m], [N m s/rad]."""
        translational = 2.0 * self.translational_damping_ratio * math.sqrt(self.translational_stiffness)
        rotational = 2.0 * self.rotational_damping_ratio * math.sqrt(self.rotational_stiffness)
        return [translational] * 3 + [rotational] * 3


def _spring_energy(stiffness: float, error: float, limit: float) -> float:
    """Return the energy of a spring whose force stays the same beyond the error `limit` [J]."""
    inside = min(error, limit)
    return stiffness * inside * (error - 0.5 * inside)


class CartesianArmState(NamedTuple):
    """Measured joint state and dynamic model of the arm in one cycle.

    Attributes:
        q, dq: joint positions and velocities, n floats each [rad], [rad/s].
        jacobian: Jacobian of the end effector in base axes, shape (6, n), linear rows above angular ones.
        mass: mass matrix with rotor inertia, shape (n, n) [kg m^2].
        coriolis: Coriolis torque C dq, shape (n,) [N m].
    """

    q: Sequence[float]
    dq: Sequence[float]
    jacobian: FloatArray
    mass: FloatArray
    coriolis: FloatArray


class LawSetting(NamedTuple):
    """Part of a law's state that determines the energy of its spring.

    Attributes:
        pose: present equilibrium.
        compliance: present gains.
        force_limit: maximum force of the translational spring [N].
    """

    pose: poses.Pose
    compliance: Compliance
    force_limit: float


class CartesianLaw:
    """Cartesian impedance law with its state: the present equilibrium and gains, and their targets.

    Args:
        compliance: gains at the start.
        filter_time: time constant with which equilibrium and gains approach their targets [s]; 0: at once.

    Attributes:
        pose, target: present equilibrium pose, and the pose that it moves to.
        force_limit: maximum force of the translational spring [N].
        error_limits: maximum deflection of the spring, position [m] and rotation [rad]; beyond it the spring force
            stays the same.
        compliance, target_compliance: present gains, and the gains that they approach.
        posture: joint positions q_n that the null-space torque pulls to, n floats [rad].
        twist: velocity v of the equilibrium, 6 floats [m/s], [rad/s]; zero unless the caller sets it.
        wrench: wrench F of spring and damper in the last cycle, 6 floats [N], [N m].
    """

    def __init__(self, compliance: Compliance, filter_time: float) -> None:
        self.compliance = self.target_compliance = compliance
        self._filter_time = filter_time
        self._share = (0.0, 1.0)  # (period, filter coefficient for that period)
        self.pose = self.target = poses.Pose()
        self.posture: Sequence[float] = ()
        self.twist, self.wrench, self.force_limit = [0.0] * 6, [0.0] * 6, math.inf
        self.error_limits = (math.inf, math.inf)
        self._take_gains()

    def start(self, pose: poses.Pose, posture: Sequence[float]) -> None:
        """Set equilibrium and null-space posture (n floats [rad]), and the gains to their targets, all at once."""
        self.pose = self.target = pose
        self.twist = [0.0] * 6
        self.posture = list(posture)
        self.compliance = self.target_compliance
        self._take_gains()

    def _take_gains(self) -> None:
        self._stiffness, self._damping = self.compliance.stiffness(), self.compliance.damping()

    @property
    def setting(self) -> LawSetting:
        """Equilibrium, gains and limit of force of the spring."""
        return LawSetting(self.pose, self.compliance, self.force_limit)

    @setting.setter
    def setting(self, setting: LawSetting) -> None:
        self.pose, self.compliance, self.force_limit = setting
        self._take_gains()

    def energy(self, measured: poses.Pose) -> float:
        """Return the energy that the spring stores at a pose of the end effector [J]."""
        error, gains = poses.difference(measured, self.pose), self.compliance
        k, limit = gains.translational_stiffness, self.error_limits[0]
        return _spring_energy(k, math.hypot(*error[:3]), min(limit, self.force_limit / max(k, 1e-9))) + _spring_energy(
            gains.rotational_stiffness, math.hypot(*error[3:]), self.error_limits[1]
        )

    def _error(self, measured: poses.Pose) -> list[float]:
        """Return the pose error within `error_limits`, base axes, 6 floats [m], [rad]."""
        error = poses.difference(measured, self.pose)
        for first, limit in zip((0, 3), self.error_limits, strict=True):
            size = math.hypot(*error[first : first + 3])
            if size > limit:
                error[first : first + 3] = [limit / size * x for x in error[first : first + 3]]
        return error

    def advance(self, period: float, scale: float = 1.0) -> None:
        """Move equilibrium and gains towards their targets for one period [s].

        The equilibrium moves at the fraction `scale` (0 to 1) of its speed; the gains are not slowed down.
        """
        if self.pose is self.target and self.compliance is self.target_compliance:
            return
        if self._share[0] != period:
            self._share = period, 1.0 - math.exp(-period / self._filter_time) if self._filter_time > 0.0 else 1.0
        share = self._share[1]
        if self.pose is not self.target:
            moved = scale * share
            pose = poses.interpolated(self.pose, self.target, moved)
            self.pose = (
                self.target if moved >= 1.0 or vectors.smaller(poses.difference(pose, self.target), _NEAR) else pose
            )
        if self.compliance is not self.target_compliance:
            gains = self.compliance.towards(self.target_compliance, share)
            self.compliance = self.target_compliance if gains == self.target_compliance else gains
            self._take_gains()

    def torque(self, measured: poses.Pose, arm: CartesianArmState) -> list[float]:
        """Return the joint torques of the law without gravity, n floats [N m]; `measured`: end-effector pose."""
        tau: list[float]
        tau, self.wrench = _compiled.torque(
            self._stiffness,
            self._damping,
            self._error(measured),
            self.twist,
            self.force_limit,
            self.compliance.nullspace_stiffness,
            self.posture,
            arm.q,
            arm.dq,
            *map(np.ascontiguousarray, arm[2:]),
        )
        return tau


def limited(tau: list[float], last: list[float], step: float) -> list[float]:
    """Return `tau`, n floats [N m], changed by at most `step` [N m] from `last`; a `step` of 0 or less: not limited."""
    if step <= 0.0 or vectors.near(tau, last, [step] * len(tau)):
        return tau
    return [min(max(value, before - step), before + step) for value, before in zip(tau, last, strict=True)]


def null_space(J: FloatArray, mass: FloatArray, tau_0: FloatArray) -> FloatArray:
    """Return N tau_0, shape (n,) [N m]: the part of a joint torque that does not accelerate the end effector.

    Args:
        J: Jacobian of the end effector, shape (6, n).
        mass: mass matrix with rotor inertia, shape (n, n) [kg m^2].
        tau_0: joint torque, shape (n,) [N m].
    """
    return np.array(_compiled.null_space(*map(np.ascontiguousarray, (J, mass)), tau_0))
