"""Rotor inertia, which the engine does not know, as an exact correction of the joint efforts.

A geared rotor adds B = diag(b) to the joint-space mass matrix M, and nothing to the bias h. Wanted is
    (M + B) qdd = tau + tau_ext + tau_eng - h,
and the engine solves  M qdd = tau' + tau_ext + tau_eng - h.  Both agree with  tau' = tau - B qdd.
Here tau_ext are the efforts of forces that the plant applies itself (known beforehand), and tau_eng those that the engine adds on its own (rigid
contact, joint stops). The latter show only afterwards, in a velocity that differs from the predicted one:
    tau_eng(k) = tau_eng(k-1) + M (v - v_predicted) / dt.
Joints whose acceleration is prescribed (brakes, drives) leave the balance: the engine's motor supplies what they need. Coulomb friction is the effort
within its bounds that comes nearest to stopping each joint in this step.
So a static press is exact, and an impact passes on the full momentum of M + B within the few steps in which the sum of corrections converges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

Matrix = Sequence[Sequence[float]]
Solver = Callable[[Matrix, Sequence[float], Sequence[float]], list[float]]

_NOTICEABLE_VELOCITY = 1e-9
"""Below this a difference between predicted and engine velocity is rounding [rad/s]."""
_LOCKED = 1e9
"""Added to the inertia of a joint whose acceleration is prescribed [kg m^2]."""
_FRICTION_SWEEPS = 50
_FRICTION_TOLERANCE = 1e-12
"""Relative change of the friction at which its iteration ends."""
_NEGLIGIBLE_EFFORT = 1e-7
"""Below this, with no difference left, the engine is taken to add nothing [N m]."""


def _solver_lines(n: int) -> list[str]:
    lines = []
    for i in range(n):
        for j in range(i + 1):
            entry = f"m{i}[{j}]" + (f" + b[{i}]" if i == j else "")
            entry += "".join(f" - l{i}_{k} * l{j}_{k}" for k in range(j))
            lines.append(f"l{i}_{i} = 1.0 / sqrt({entry})" if i == j else f"l{i}_{j} = ({entry}) * l{j}_{j}")
    for i in range(n):
        lines.append(f"y{i} = (r[{i}]" + "".join(f" - l{i}_{k} * y{k}" for k in range(i)) + f") * l{i}_{i}")
    for i in reversed(range(n)):
        lines.append(f"x{i} = (y{i}" + "".join(f" - l{k}_{i} * x{k}" for k in range(i + 1, n)) + f") * l{i}_{i}")
    return lines


def make_solver(n: int) -> Solver:
    """A function (M, b, r) -> x with (M + diag(b)) x = r, for symmetric positive definite n x n matrices, on plain floats.

    It is Cholesky's method written out line by line for this n: for seven joints 6 us, where numpy and LAPACK need 15 us, most of it for
    turning tuples into arrays and back. Only the lower triangle of M is read; a matrix that is not positive definite raises ValueError.
    """
    names = ", ".join(f"m{i}" for i in range(n))
    body = "\n    ".join([f"{names}, = M", *_solver_lines(n), "return [" + ", ".join(f"x{i}" for i in range(n)) + "]"])
    scope: dict[str, Solver] = {}
    exec(f"def solve(M, b, r, sqrt=sqrt):\n    {body}", {"sqrt": math.sqrt}, scope)
    return scope["solve"]


class RotorInertia:
    """The correction for one robot; remembers one step.

    Args:
        inertia: b, n floats [kg m^2].
        friction: Coulomb friction, n floats [N m].
        time_step: [s].
        mass_matrix: the engine's M at q.
        bias: the engine's h (gravity, Coriolis) at q, dq.
    """

    def __init__(
        self,
        inertia: Sequence[float],
        friction: Sequence[float],
        time_step: float,
        mass_matrix: Callable[[list[float]], Matrix],
        bias: Callable[[list[float], list[float]], Sequence[float]],
    ) -> None:
        self.inertia = list(inertia)
        self._friction = list(friction) if any(friction) else None
        self._dt, self._mass_matrix, self._bias = time_step, mass_matrix, bias
        self._solve = make_solver(len(self.inertia))
        self.forget()

    def forget(self) -> None:
        """The state was set from outside: the next step starts without memory."""
        self._predicted: list[float] | None = None
        self._engine_effort: list[float] | None = None
        self._M: Matrix = ()
        self._stuck = [0.0] * len(self.inertia)

    def _update_engine_effort(self, dq: list[float], predicted: list[float]) -> None:
        surprise = [v - w for v, w in zip(dq, predicted, strict=True)]
        quiet = max(surprise) < _NOTICEABLE_VELOCITY and min(surprise) > -_NOTICEABLE_VELOCITY
        before = self._engine_effort
        if quiet and before is None:
            return
        if before is None:
            before = [0.0] * len(dq)
        scaled = [d / self._dt for d in surprise]
        effort = [e + sum(map(float.__mul__, row, scaled)) for e, row in zip(before, self._M, strict=True)]
        gone = quiet and max(effort) < _NEGLIGIBLE_EFFORT and min(effort) > -_NEGLIGIBLE_EFFORT
        self._engine_effort = None if gone else effort

    def torque(
        self,
        q: list[float],
        dq: list[float],
        tau: Sequence[float],
        external: Sequence[float] | None,
        prescribed: Sequence[float | None] | None = None,
    ) -> list[float]:
        """Efforts tau' for the engine [N m].

        Args:
            q, dq: the engine's present state, n floats [rad, rad/s].
            tau: efforts on the joints, damping included, n floats [N m].
            external: efforts of the forces that the plant applies in this step, n floats [N m].
            prescribed: acceleration that a motor of the engine enforces, None for the other joints, n values [rad/s^2].
        """
        if self._predicted is not None:
            self._update_engine_effort(dq, self._predicted)
        M = self._M = self._mass_matrix(q)
        drive = [t - h for t, h in zip(tau, self._bias(q, dq), strict=True)]
        if external is not None:
            drive = [d + e for d, e in zip(drive, external, strict=True)]
        if self._engine_effort is not None:
            drive = [d + e for d, e in zip(drive, self._engine_effort, strict=True)]
        inertia = self.inertia
        if prescribed is not None:
            inertia, drive = self._prescribe(drive, prescribed)
        if self._friction is not None:
            friction = self._coulomb(M, inertia, drive, dq)
            drive = [d + f for d, f in zip(drive, friction, strict=True)]
            tau = [t + f for t, f in zip(tau, friction, strict=True)]
        acceleration = self._solve(M, inertia, drive)
        dt = self._dt
        self._predicted = [v + dt * a for v, a in zip(dq, acceleration, strict=True)]
        return [t - b * a for t, b, a in zip(tau, self.inertia, acceleration, strict=True)]

    def _prescribe(self, drive: list[float], prescribed: Sequence[float | None]) -> tuple[list[float], list[float]]:
        """(inertia, drive) with which the solver gives the prescribed accelerations; what the engine adds there is its motor, not a contact."""
        inertia = [b if a is None else _LOCKED for a, b in zip(prescribed, self.inertia, strict=True)]
        drive = [d if a is None else _LOCKED * a for a, d in zip(prescribed, drive, strict=True)]
        if self._engine_effort is not None:
            self._engine_effort = [e if a is None else 0.0 for a, e in zip(prescribed, self._engine_effort, strict=True)]
        return inertia, drive

    def _coulomb(self, M: Matrix, inertia: Sequence[float], drive: Sequence[float], dq: Sequence[float]) -> list[float]:
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
