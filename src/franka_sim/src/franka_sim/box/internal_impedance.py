"""Internal joint and Cartesian impedance of the control box: torques that move the arm along its desired motion.

Gravity is compensated elsewhere. Gains too high for a stable loop at the control period are lowered; the bounds are in
config/internal_impedance.yaml.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import RobotState
from franka_sim.box.config import read_config
from franka_sim.box.kinematics import ArmKinematics, twist_between
from hric_core.errors import CommandError
from hric_core.geometry import FloatArray
from hric_core.native.vectors import near


def defaults() -> dict[str, Any]:
    """Return the default gains and their bounds from config/internal_impedance.yaml."""
    return read_config("internal_impedance")


def _legal_poses(limits: FrankaLimits) -> FloatArray:
    """Return random poses within the position limits, always the same, shape (poses, 7) [rad]."""
    return np.random.default_rng(0).uniform(limits.lower, limits.upper, (defaults()["poses"], 7))


def _checked(values: Sequence[float], range_name: str, what: str) -> list[float]:
    low, high = defaults()[range_name]
    result = [float(x) for x in values]
    if not all(low <= x <= high for x in result):
        raise CommandError(f"{what} must be from {low:g} to {high:g}; got {result}")
    return result


@dataclass(frozen=True)
class JointImpedance:
    """Joint impedance law tau = K (q_d - q) + D (dq_d - dq), with each torque clipped to its limit.

    Attributes:
        stiffness: K, n floats [N m/rad].
        damping: D, n floats [N m s/rad].
        max_torque: torque limits, n floats [N m].
    """

    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    max_torque: tuple[float, ...]

    def torque(
        self, q_d: Sequence[float], dq_d: Sequence[float], q: Sequence[float], dq: Sequence[float]
    ) -> list[float]:
        """Return the torques without gravity, n floats [N m]; positions [rad], velocities [rad/s]."""
        rows = zip(self.stiffness, self.damping, self.max_torque, q_d, dq_d, q, dq, strict=True)
        return [min(max(k * (x_d - x) + d * (v_d - v), -limit), limit) for k, d, limit, x_d, v_d, x, v in rows]


def joint_inertia(mass_matrices: FloatArray, rotor_inertia: Sequence[float]) -> FloatArray:
    """Return the minimum of 1/((M+B)^-1)_ii of each joint over the poses, shape (n,) [kg m^2].

    This is the inertia at a joint if all others are free. mass_matrices: shape (poses, n, n) [kg m^2]; rotor_inertia:
    diagonal of B, n floats [kg m^2].
    """
    inverse = np.linalg.inv(mass_matrices + np.diag(rotor_inertia))
    inertia: FloatArray = 1.0 / np.diagonal(inverse, axis1=1, axis2=2).max(axis=0)
    return inertia


class JointImpedanceLaw:
    """Joint impedance with adjustable stiffness: tau = K (q_d - q) + D (dq_d - dq), within torque limits.

    The damping follows the stiffness so that the damping ratio of the default gains K0, D0 stays: D = D0 sqrt(K / K0).

    Attributes:
        stiffness, damping: present gains, 7 floats each [N m/rad], [N m s/rad].

    Args:
        model: model of the arm.
        limits: limits of the arm.
        rotor_inertia: 7 floats [kg m^2].
        time_step: control period [s].
    """

    def __init__(
        self, model: KdlFrankaModel, limits: FrankaLimits, rotor_inertia: Sequence[float], time_step: float
    ) -> None:
        self._inertia = joint_inertia(np.array([model.mass(q) for q in _legal_poses(limits)]), rotor_inertia)
        self._effort, self._dt = limits.effort, time_step
        self.set_stiffness(defaults()["stiffness"])

    def set_stiffness(self, stiffness: Sequence[float]) -> None:
        """Set K_theta of libfranka's setJointImpedance, 7 floats [N m/rad].

        Raises:
            CommandError: out of libfranka's range; the old stiffness remains.
        """
        requested, rule = _checked(stiffness, "joint_stiffness_range", "joint stiffness [N m/rad]"), defaults()
        if len(requested) != 7:
            raise CommandError(f"joint stiffness has {len(requested)} values; it needs 7")
        damping = [d * (k / k0) ** 0.5 for k, k0, d in zip(requested, rule["stiffness"], rule["damping"], strict=True)]
        max_stiffness = (rule["frequency_limit"] / self._dt) ** 2 * self._inertia
        max_damping = rule["damping_limit"] / self._dt * self._inertia
        self.stiffness: list[float] = np.minimum(requested, max_stiffness).tolist()
        self.damping: list[float] = np.minimum(damping, max_damping).tolist()
        self._law = JointImpedance(tuple(self.stiffness), tuple(self.damping), self._effort)

    def torque(self, state: RobotState) -> list[float]:
        """Return the torques without gravity, 7 floats [N m]."""
        return self._law.torque(state.q_d, state.dq_d, state.q, state.dq)


def modal_damping(mass: FloatArray, stiffness: FloatArray, ratio: float) -> FloatArray:
    """Return D that gives each mode of mass ddx + D dx + stiffness x = 0 the damping ratio, shape (n, n).

    With mass = L L' and w^2, U the eigenvalues and eigenvectors of L^-1 stiffness L^-T: D = 2 ratio L U diag(w) U' L'.
    mass: shape (n, n), positive definite; stiffness: shape (n, n), positive semidefinite.
    """
    factor = np.linalg.cholesky(mass)
    inverse = np.linalg.inv(factor)
    squares, modes = np.linalg.eigh(inverse @ stiffness @ inverse.T)
    shapes = factor @ modes
    damping: FloatArray = (shapes * (2.0 * ratio * np.sqrt(np.maximum(squares, 0.0)))) @ shapes.T
    return damping


def space_inertia(
    model: KdlFrankaModel, kinematics: ArmKinematics, poses: FloatArray, rotor_inertia: Sequence[float]
) -> list[float]:
    """Return minimum inertias: translation [kg] and rotation [kg m^2] of the stiffness frame, self-motion [kg m^2].

    In each pose it is that of the direction with the smallest inertia, all others being free: 1 / (largest eigenvalue
    of A (M+B)^-1 A') with the Jacobian A of the motion; for the self-motion A = n', the unit null vector of the full
    Jacobian.

    Args:
        model: model of the arm; its mass matrix M.
        kinematics: kinematics with the stiffness frame.
        poses: joint positions over which the minimum is taken, shape (poses, 7) [rad].
        rotor_inertia: diagonal of B, 7 floats [kg m^2].
    """
    inertias = []
    for q in poses:
        J = kinematics.stiffness_frame(q.tolist()).jacobian()
        inverse = np.linalg.inv(model.mass(q) + np.diag(rotor_inertia))
        null = np.linalg.svd(J)[2][-1:]
        inertias.append([1.0 / np.linalg.eigvalsh(A @ inverse @ A.T)[-1] for A in (J[:3], J[3:], null)])
    minima: list[float] = np.min(inertias, axis=0).tolist()
    return minima


class CartesianImpedanceLaw:
    """Cartesian impedance: a spring and damper between measured and desired stiffness frame, and along the self-motion.

    In the axes of the measured stiffness frame: F = K e, e the position and rotation vector from the measured to the
    desired frame. tau = J' F + n k_n n'(q_d - q) + D (dq_d - dq), n the unit null vector of J, which does not move the
    end effector. D, shape (7, 7), damps each mode of the arm with its rotors on these springs (`modal_damping`); it is
    computed again when a joint has moved by `damping_step` [rad] (config/internal_impedance.yaml).

    Attributes:
        stiffness: present gains, 3 floats [N/m] and 3 [N m/rad].

    Args:
        model: model of the arm.
        limits: limits of the arm.
        rotor_inertia: 7 floats [kg m^2].
        time_step: control period [s].
    """

    def __init__(
        self, model: KdlFrankaModel, limits: FrankaLimits, rotor_inertia: Sequence[float], time_step: float
    ) -> None:
        self._model, self._limits, self._rotor_inertia, self._dt = model, limits, list(rotor_inertia), time_step
        self._effort, self._rotors = limits.effort, np.diag(self._rotor_inertia)
        rule = defaults()
        self._ratio, self._step = rule["damping_ratio"], (rule["damping_step"],) * 7
        self._kinematics = ArmKinematics(model)
        self._null, self._matrix = np.ones(7), np.empty((7, 7))
        self._requested: list[float] = rule["cartesian_stiffness"]
        self.update_frames()

    def update_frames(self) -> None:
        """Read the end effector and stiffness frame from the model and recompute the gains (some milliseconds)."""
        self._kinematics.update()
        self._inertia = space_inertia(self._model, self._kinematics, _legal_poses(self._limits), self._rotor_inertia)
        self.set_stiffness(self._requested)

    def set_stiffness(self, stiffness: Sequence[float]) -> None:
        """Set K_x of libfranka's setCartesianImpedance, 6 floats, axes of the stiffness frame [N/m], [N m/rad].

        Raises:
            CommandError: out of libfranka's range; the old stiffness remains.
        """
        if len(stiffness) != 6:
            raise CommandError(f"Cartesian stiffness has {len(stiffness)} values; it needs 6")
        linear = _checked(stiffness[:3], "translation_stiffness_range", "translational stiffness [N/m]")
        angular = _checked(stiffness[3:], "rotation_stiffness_range", "rotational stiffness [N m/rad]")
        self._requested = linear + angular
        rule = defaults()
        requested = [*self._requested, rule["self_motion_stiffness"]]
        maximum = (rule["cartesian_frequency_limit"] / self._dt) ** 2 * np.repeat(self._inertia, (3, 3, 1))
        *self.stiffness, self._k_null = np.minimum(requested, maximum).tolist()
        self._K = np.reshape(self.stiffness, (2, 3))
        self._damped_at = [math.inf] * 7

    def torque(self, state: RobotState) -> list[float]:
        """Return the torques without gravity, 7 floats [N m]."""
        measured = self._kinematics.stiffness_frame(state.q)
        desired = self._kinematics.stiffness_frame(state.q_d)
        J = measured.jacobian()
        null = self._null_vector(J)
        dq_error = np.subtract(state.dq_d, state.dq)
        # Rows: translation and rotation; R: from the axes of the stiffness frame to those of the base.
        R = np.array([measured.T[0:3], measured.T[4:7], measured.T[8:11]]).T
        error = np.array(twist_between(measured.T, desired.T, 1.0)).reshape(2, 3) @ R
        wrench = ((self._K * error) @ R.T).ravel()
        along = self._k_null * (null @ np.subtract(state.q_d, state.q))
        if not near(state.q, self._damped_at, self._step):
            self._damped_at, self._D = state.q[:], self._damping(state.q, J, R, null)
        tau = (wrench @ J + null * along + self._D @ dq_error).tolist()
        return [min(max(x, -limit), limit) for x, limit in zip(tau, self._effort, strict=True)]

    def _damping(self, q: Sequence[float], J: FloatArray, R: FloatArray, null: FloatArray) -> FloatArray:
        """Return damping D at q, shape (7, 7) [N m s/rad]; J: (6, 7); R: axes of the stiffness frame; null: (7,)."""
        A = (R.T @ J.reshape(2, 3, 7)).reshape(6, 7)
        stiffness = (A.T * self.stiffness) @ A + self._k_null * np.outer(null, null)
        return modal_damping(self._model.mass(q) + self._rotors, stiffness, self._ratio)

    def _null_vector(self, J: FloatArray) -> FloatArray:
        """Return the unit null vector of J, shape (7,), by one step from the last one, or by an SVD if that fails."""
        self._matrix[:6], self._matrix[6] = J, self._null
        try:
            null = np.linalg.solve(self._matrix, _LAST)
            length = math.sqrt(null @ null)
        except np.linalg.LinAlgError:
            length = math.inf
        self._null = null / length if length < _TURNED else np.linalg.svd(J)[2][-1]
        return self._null


_LAST = np.array([0.0] * 6 + [1.0])
_TURNED = 1e3
"""Maximum ratio of the null vector's length to its component along the last one; beyond it an SVD is computed."""

ImpedanceLaw = JointImpedanceLaw | CartesianImpedanceLaw
