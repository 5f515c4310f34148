"""Rotor inertia, which the engine does not know, as an exact correction of the joint efforts.

A geared rotor adds B = diag(b) to the joint-space mass matrix M, and nothing to the bias h. Wanted is
    (M + B) qdd = tau + tau_ext + tau_eng - h,
and the engine solves  M qdd = tau' + tau_ext + tau_eng - h.  Both agree with  tau' = tau - B qdd.
Here tau_ext are the efforts of forces that the plant applies itself (known beforehand), and tau_eng those that the engine adds on its own (rigid
contact, joint stops). The latter show only afterwards, in a velocity that differs from the predicted one:
    tau_eng(k) = tau_eng(k-1) + M (v - v_predicted) / dt.
Joints whose acceleration is prescribed (brakes, drives) leave the balance: the engine's motor supplies what they need. Coulomb friction is the effort
within its bounds that comes nearest to stopping each joint in this step; the balance serves for it even where B is zero.
So a static press is exact, and at a joint stop or a fixed rigid object the impulse converges to that of M + B within a few steps. Against a free
rigid object it does not: the engine parts them after the impulse of the bare links. Penalty contact is known beforehand and exact in both cases.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet

from pybullet_ros_control.balance import Matrix, Vector, make_balance

_NOTICEABLE_VELOCITY = 1e-9
"""Below this a difference between predicted and engine velocity is rounding [rad/s]."""
_LOCKED = 1e9
"""Added to the inertia of a joint whose acceleration is prescribed [kg m^2]."""
_FRICTION_SWEEPS = 50
_FRICTION_TOLERANCE = 1e-12
"""Relative change of the friction at which its iteration ends."""
_NEGLIGIBLE_EFFORT = 1e-7
"""Below this, with no difference left, the engine is taken to add nothing [N m]."""


class RotorInertia:
    """The correction for one robot, by the engine's own M and h; remembers one step.

    Args:
        inertia: b, n floats [kg m^2].
        friction: Coulomb friction, n floats [N m].
        time_step: [s].
        client: the engine's client.

    Attributes:
        body_id: the engine's number of the robot; to be set whenever it was loaded.
    """

    def __init__(self, inertia: Sequence[float], friction: Sequence[float], time_step: float, client: int) -> None:
        self.inertia = list(inertia)
        self._friction = list(friction) if any(friction) else None
        self._dt, self._client = time_step, client
        self._zeros = [0.0] * len(self.inertia)
        self.body_id = -1
        self._balance = make_balance(len(self.inertia))
        self.forget()

    def forget(self) -> None:
        """The state was set from outside: the next step starts without memory."""
        self._predicted: list[float] | None = None
        self._engine_effort: list[float] | None = None
        self._M: Matrix = ()
        self._driven: list[bool] | None = None
        self._stuck = [0.0] * len(self.inertia)

    def _update_engine_effort(self, dq: Vector, predicted: Vector, quiet: bool) -> None:
        scaled = [(v - w) / self._dt for v, w in zip(dq, predicted, strict=True)]
        before = self._engine_effort or [0.0] * len(dq)
        effort = [e + sum(map(float.__mul__, row, scaled)) for e, row in zip(before, self._M, strict=True)]
        if self._driven is not None:
            # What the engine added there was its motor.
            effort = [0.0 if driven else e for driven, e in zip(self._driven, effort, strict=True)]
        gone = quiet and max(effort) < _NEGLIGIBLE_EFFORT and min(effort) > -_NEGLIGIBLE_EFFORT
        self._engine_effort = None if gone else effort

    def torque(self, q: Vector, dq: Vector, tau: Vector, external: Vector | None, prescribed: Sequence[float | None] | None = None) -> list[float]:
        """Efforts tau' for the engine [N m].

        Args:
            q, dq: the engine's present state, n floats [rad, rad/s].
            tau: efforts on the joints, damping included, n floats [N m].
            external: efforts of the forces that the plant applies in this step, n floats [N m].
            prescribed: acceleration that a motor of the engine enforces, None for the other joints, n values [rad/s^2].
        """
        if self._predicted is not None:
            quiet = math.dist(dq, self._predicted) < _NOTICEABLE_VELOCITY
            if not quiet or self._engine_effort is not None:
                self._update_engine_effort(dq, self._predicted, quiet)
        # Bare positional calls: this is the dearest part of a step.
        client, body = self._client, self.body_id
        M: Matrix = pybullet.calculateMassMatrix(body, q, 0, client)
        h: Vector = pybullet.calculateInverseDynamics(body, q, dq, self._zeros, 0, client)
        self._M = M
        if external is not None:
            h = [a - e for a, e in zip(h, external, strict=True)]
        if self._engine_effort is not None:
            h = [a - e for a, e in zip(h, self._engine_effort, strict=True)]
        inertia = self.inertia
        self._driven = None
        if prescribed is not None:
            inertia, h = self._prescribe(h, tau, prescribed)
        if self._friction is not None:
            friction = self._coulomb(M, inertia, [t - a for t, a in zip(tau, h, strict=True)], dq)
            tau = [t + f for t, f in zip(tau, friction, strict=True)]
        effort, self._predicted = self._balance(M, h, tau, inertia, dq, self._dt)
        return effort

    def _prescribe(self, h: Vector, tau: Vector, prescribed: Sequence[float | None]) -> tuple[list[float], list[float]]:
        """(inertia, h) with which the balance gives the prescribed accelerations."""
        self._driven = [a is not None for a in prescribed]
        inertia = [b if a is None else _LOCKED for a, b in zip(prescribed, self.inertia, strict=True)]
        h = [x if a is None else t - _LOCKED * a for a, x, t in zip(prescribed, h, tau, strict=True)]
        return inertia, h

    def _coulomb(self, M: Matrix, inertia: Vector, drive: Vector, dq: Vector) -> list[float]:
        """Friction f with |f_i| <= F_i that brings v = dq + dt (M+B)^-1 (drive + f) to zero where it can (projected Gauss-Seidel)."""
        assert self._friction is not None
        limits = [F if b < _LOCKED else 0.0 for F, b in zip(self._friction, inertia, strict=True)]
        gain = self._dt * np.linalg.inv(np.array(M) + np.diag(inertia))
        friction = [min(max(f, -F), F) for f, F in zip(self._stuck, limits, strict=True)]
        velocity = np.array(dq) + gain @ (np.array(drive) + friction)
        for _ in range(_FRICTION_SWEEPS):
            change = 0.0
            for i, F in enumerate(limits):
                new = min(max(friction[i] - float(velocity[i]) / float(gain[i, i]), -F), F)
                velocity += (new - friction[i]) * gain[:, i]
                change = max(change, abs(new - friction[i]))
                friction[i] = new
            if change <= _FRICTION_TOLERANCE * max(limits):
                break
        self._stuck = friction
        return friction
