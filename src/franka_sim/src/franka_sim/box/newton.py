"""Newton's method for the arm's inverse kinematics: by compiled code, and the same by numpy where there is no compiler."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt

from franka_sim.box.compiled_kinematics import compiled
from franka_sim.box.kinematics import ArmKinematics, Placement
from franka_sim.box.pose_lists import twist_between

FloatArray = npt.NDArray[np.float64]

ELBOW_JOINT = 2
"""Index of the joint that libfranka reports as the elbow's position."""
ELBOW_ROW = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
_LARGEST_STEP = 0.5
"""A step that turns a joint by more leaves the branch it began on: there is no solution near [rad]."""


class Newton(Protocol):
    """Seven equations: position, rotation, and a row that the six of the Jacobian leave free."""

    def solve(self, T: Sequence[float], row: Sequence[float], q3: float | None, guess: Sequence[float]) -> list[float] | None:
        """Steps until the pose and, where it is given, the elbow are met.

        Args:
            T: O_T_EE, 16 floats, column-major.
            row: the seventh row, 7 floats; the elbow's where q3 is given.
            q3: position of joint 3 [rad], or None: whatever it is.
            guess: 7 floats [rad].

        Returns:
            7 floats [rad], or None: out of reach, singular, or not near.
        """
        ...

    def first_step(self, T: Sequence[float], row: Sequence[float], guess: Sequence[float]) -> tuple[list[float], list[float]] | None:
        """(q after one step that the row does not feel, unit vector x with J x = 0 and a positive product with the row), or None."""
        ...


class CompiledNewton:
    """By kinematics.c.

    Args:
        module: what `compiled` gives.
        kinematics: of the arm.
        tolerance: remaining error (m and rad mixed).
        steps: at most so many.
    """

    def __init__(self, module: Any, kinematics: ArmKinematics, tolerance: float, steps: int) -> None:
        self._solve, self._first_step, self._kinematics = module.solve_pose, module.first_step, kinematics
        self._free = (tolerance, _LARGEST_STEP, float(steps), -1.0)
        self._held = (tolerance, _LARGEST_STEP, float(steps), float(ELBOW_JOINT))

    def solve(self, T: Sequence[float], row: Sequence[float], q3: float | None, guess: Sequence[float]) -> list[float] | None:
        """See `Newton`."""
        options, elbow = (self._free, 0.0) if q3 is None else (self._held, q3)
        found: list[float] | None = self._solve(self._kinematics.arm, T, row, elbow, options, guess)
        return found

    def first_step(self, T: Sequence[float], row: Sequence[float], guess: Sequence[float]) -> tuple[list[float], list[float]] | None:
        """See `Newton`."""
        found: tuple[list[float], list[float]] | None = self._first_step(self._kinematics.arm, T, row, self._free, guess)
        return found


class NumpyNewton:
    """By numpy; arguments as `CompiledNewton`'s."""

    def __init__(self, kinematics: ArmKinematics, tolerance: float, steps: int) -> None:
        self._kinematics, self._tolerance, self._steps = kinematics, tolerance, steps
        self._matrix, self._right = np.empty((7, 7)), np.zeros((7, 2))
        self._right[6, 1] = 1.0

    def solve(self, T: Sequence[float], row: Sequence[float], q3: float | None, guess: Sequence[float]) -> list[float] | None:
        """See `Newton`."""
        q = list(guess)
        for _ in range(self._steps + 1):
            placement = self._kinematics.end_effector(q)
            error = [*twist_between(placement.T, T, 1.0), 0.0 if q3 is None else q3 - q[ELBOW_JOINT]]
            if max(map(abs, error)) <= self._tolerance:
                return q
            solution = self._step(placement, row, error)
            if solution is None:
                return None
            q = [x + dx for x, dx in zip(q, solution.tolist(), strict=True)]
        return None

    def first_step(self, T: Sequence[float], row: Sequence[float], guess: Sequence[float]) -> tuple[list[float], list[float]] | None:
        """See `Newton`."""
        placement = self._kinematics.end_effector(guess)
        self._right[:6, 0] = twist_between(placement.T, T, 1.0)
        solution = self._step(placement, row, self._right)
        if solution is None:
            return None
        direction = solution[:, 1]
        return (np.asarray(guess) + solution[:, 0]).tolist(), (direction / math.sqrt(direction @ direction)).tolist()

    def _step(self, placement: Placement, row: Sequence[float], right: FloatArray | list[float]) -> FloatArray | None:
        """Solution of [J; row] x = right, shape (7,) or (7, 2); None if there is none whose first column is a small step."""
        self._matrix[:6], self._matrix[6] = placement.jacobian(), row
        try:
            solution = cast(FloatArray, np.linalg.solve(self._matrix, right))
        except np.linalg.LinAlgError:
            return None
        step = solution if solution.ndim == 1 else solution[:, 0]
        return solution if float(np.abs(step).max()) <= _LARGEST_STEP else None


def make_newton(kinematics: ArmKinematics, tolerance: float, steps: int) -> Newton:
    """The compiled one, or numpy's where it cannot be compiled."""
    module = compiled()
    return NumpyNewton(kinematics, tolerance, steps) if module is None else CompiledNewton(module, kinematics, tolerance, steps)
