"""What acts on the arm from outside, estimated from joint positions, velocities and torques."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import PyKDL

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import Frame
from franka_sim.box.compiled_arm import CompiledArm, Update
from franka_sim.box.config import BoxConfig
from franka_sim.box.state import BoxState

Vector = Sequence[float]
_ROW = tuple(range(7))
_PUT = PyKDL.JntArray.__setitem__  # the unbound method is faster than the bound one


class _InverseDynamics:
    """M(q) ddq + C(q, dq) dq + g(q) by KDL's recursive Newton-Euler solver, on containers made once."""

    def __init__(self, model: KdlFrankaModel) -> None:
        self._chain = model.chain._solvers.chain  # kept: the solver refers to it
        self._solver = PyKDL.ChainIdSolver_RNE(self._chain, PyKDL.Vector(*model.gravity_base.tolist()))
        self._q, self._dq, self._ddq, self._tau = (PyKDL.JntArray(7) for _ in range(4))
        self._wrenches = [PyKDL.Wrench() for _ in range(self._chain.getNrOfSegments())]
        self._take = self._tau.__getitem__

    def torque(self, q: Vector, dq: Vector, ddq: Vector) -> list[float]:
        put, take, a, b, c = _PUT, self._take, self._q, self._dq, self._ddq
        for i, x, v, w in zip(_ROW, q, dq, ddq, strict=True):
            put(a, i, x)
            put(b, i, v)
            put(c, i, w)
        self._solver.CartToJnt(a, b, c, self._wrenches, self._tau)
        return [take(0), take(1), take(2), take(3), take(4), take(5), take(6)]


class ExternalTorque:
    """tau_ext_hat_filtered: the part of the measured torque that the model does not explain, low-pass filtered.

    r' = w (tau_J - M(q) ddq - C(q, dq) dq - g(q) - tau_f(dq) - r),   w = 2 pi cut-off

    In continuous time this is the momentum observer of De Luca et al. (IROS 2006), r = w (integral of (tau_J + C^T dq - g - tau_f - r) dt - p): both
    give the external torque behind one first-order low-pass. Here the acceleration is the difference of two measured velocities, the mean over the
    cycle, so that the observer's transpose of C is not needed. tau_f: friction as far as the box knows it. The rotors are not in it: tau_J is
    measured on the link's side of them.

    Sign as in libfranka, whose RobotState calls it the error between tau_J and the torques that the model expects: a torque that the arm exerts on
    its environment is positive, and a force F that pushes the arm shows as -J^T F.

    Attributes:
        value: 7 floats [N m].
    """

    def __init__(self, model: KdlFrankaModel, config: BoxConfig, compiled: CompiledArm | None = None) -> None:
        self._compiled = compiled
        self._model = model
        self._rate = 1.0 / config.time_step
        self._gain = 1.0 - math.exp(-2.0 * math.pi * config.external_torque_cutoff * config.time_step)
        self.value = [0.0] * 7
        self._update: Update = self._update_by_kdl if compiled is None else compiled.estimator(self._rate, self._gain)
        self.take_model()

    def take_model(self) -> None:
        """The load was told anew."""
        if self._compiled is None:
            self._expected = _InverseDynamics(self._model).torque
        else:
            self._compiled.take_model(self._model)

    def reset(self) -> None:
        """Forget the past."""
        self.value[:] = [0.0] * 7

    def update(self, q: Vector, dq: Vector, q_now: Vector, dq_now: Vector, tau: Vector, friction: Vector | None) -> list[float]:
        """One cycle.

        Args:
            q, dq: position and velocity at the beginning of the cycle, 7 floats [rad], [rad/s].
            q_now, dq_now: at its end.
            tau: torque during the cycle, 7 floats [N m].
            friction: at dq, 7 floats [N m], or None: nothing known.

        Returns:
            g(q_now), 7 floats [N m]: the next thing that the box needs of the same model.
        """
        return self._update(self.value, q, dq, q_now, dq_now, tau, friction)

    def _update_by_kdl(
        self, value: list[float], q: Vector, dq: Vector, q_now: Vector, dq_now: Vector, tau: Vector, friction: Vector | None
    ) -> list[float]:
        rate, gain = self._rate, self._gain
        ddq = [rate * (b - a) for a, b in zip(dq, dq_now, strict=True)]
        expected = self._expected(q, dq, ddq)
        value[:] = [r + gain * (t - e - r) for r, t, e in zip(value, tau, expected, strict=True)]
        if friction is not None:
            value[:] = [r - gain * f for r, f in zip(value, friction, strict=True)]
        return self._model.gravity_list(q_now)


def wrench_estimator(model: KdlFrankaModel, least_singular_value: float) -> Callable[[BoxState], tuple[list[float], list[float]]]:
    """state -> (O_F_ext_hat_K, K_F_ext_hat_K), 3 forces [N] and 3 moments [N m] each.

    The wrench of least squares in tau_ext = J_K(q)^T F with the Jacobian of the stiffness frame; zero where the least singular value of J_K is below
    `least_singular_value`. Sign as tau_ext_hat_filtered: what the arm exerts on its environment is positive. The state's `wrench_noise` is added.
    """

    def estimate(state: BoxState) -> tuple[list[float], list[float]]:
        jacobian = model.zero_jacobian(Frame.STIFFNESS, state.q)
        U, s, Vt = np.linalg.svd(jacobian, full_matrices=False)
        if s[-1] < least_singular_value:
            return [0.0] * 6, [0.0] * 6
        F = U @ ((Vt @ np.array(state.tau_ext_hat_filtered)) / s)
        if state.wrench_noise is not None:
            F += state.wrench_noise
        R = model.pose(Frame.STIFFNESS, state.q)[:3, :3]
        return F.tolist(), [*(R.T @ F[:3]).tolist(), *(R.T @ F[3:]).tolist()]

    return estimate
