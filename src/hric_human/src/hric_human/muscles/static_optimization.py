"""Static optimisation: the activations with the least sum of squares that produce a joint torque.

    min sum a_i^2   with   sum_i arms_i gain_i a_i = torque,   minimum_i <= a_i <= 1

Crowninshield & Brand, J. Biomech. 14:793, 1981, with activations in place of stresses, as in OpenSim's
StaticOptimization with its exponent of 2. The problem is strictly convex and has one solution. It is solved through its
dual, in C (`static_optimization.c`): a_i is b_i . x clipped to its bounds, with b_i = gain_i arms_i, and x, one number
per joint, minimises a convex function that is quadratic between kinks: Newton's step with a line search. Starting from
the last solution saves steps and does not change the result.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load

MINIMUM = 0.01
"""Minimum activation [1], as in OpenSim's muscles and its StaticOptimization tool."""

_solve: Callable[..., int]
_solve = load("hric_static_optimization").solve


class ActivationSolution(NamedTuple):
    """Activations for a joint torque.

    Attributes:
        activation: activations, shape (k,) [1].
        shortfall: part of the torque that no activation within the bounds can produce; the shortest vector, zero if the
            torque can be produced, shape (m,) [N m].
        iterations: steps of Newton's method.
    """

    activation: FloatArray
    shortfall: FloatArray
    iterations: int


class StaticOptimization:
    """Solver that shares joint torques among muscles; not thread-safe.

    Args:
        muscles: number k of muscles, ideal actuators included.
        joints: number m of joints.
        minimum: minimum of all activations [1].

    Raises:
        HricError: no muscle, no or too many joints, or a minimum activation that is not from 0 to below 1.
    """

    def __init__(self, muscles: int, joints: int, minimum: float = MINIMUM) -> None:
        if muscles < 1 or not 1 <= joints <= 32 or not 0.0 <= minimum < 1.0:
            raise HricError(
                f"static optimisation of {muscles} muscles on {joints} joints with activations from {minimum}: valid "
                "are 1 and more muscles on 1 to 32 joints, and a minimum activation from 0 to below 1"
            )
        self._shapes = ((muscles, joints), (muscles,), (muscles,), (joints,))
        self._lower = np.full(muscles, float(minimum))
        self._start = np.zeros(joints)

    def solve(
        self,
        arms: FloatArray,
        gain: FloatArray,
        torque: Sequence[float] | FloatArray,
        co_contraction: FloatArray | None = None,
    ) -> ActivationSolution:
        """Return the activations for a torque; if it is out of reach, those for the nearest reachable one.

        Args:
            arms: moment arms [m], +1 or -1 for an ideal actuator, shape (k, m).
            gain: force per activation [N], torque for an ideal actuator [N m], shape (k,).
            torque: torque from activation, without the passive part, shape (m,) [N m].
            co_contraction: added to the minimum activation of each muscle, from 0 to 1, shape (k,) [1]. The others
                compensate: the torque remains as requested.

        Raises:
            HricError: a wrong shape, a number that is not finite, or a co-contraction not from 0 to 1.
        """
        lower = self._lower if co_contraction is None else self._raised(co_contraction)
        arrays = [np.ascontiguousarray(values, np.float64) for values in (arms, gain, lower, torque)]
        activation, shortfall = np.empty(len(self._lower)), np.empty(len(self._start))
        if tuple(array.shape for array in arrays) != self._shapes:
            raise HricError(f"static optimisation: {_shapes(arrays)}; valid: {_NAMES} of shapes {self._shapes}")
        try:
            iterations = _solve(*arrays, self._start, activation, shortfall)
        except ValueError as error:
            raise HricError(f"static optimisation: {_not_finite(arrays)} not finite") from error
        return ActivationSolution(activation, shortfall, iterations)

    def _raised(self, co_contraction: FloatArray) -> FloatArray:
        added = np.asarray(co_contraction, np.float64)
        if not bool(np.all((added >= 0.0) & (added <= 1.0))):
            raise HricError(f"static optimisation: co-contraction {added.tolist()}; valid: from 0 to 1")
        return np.asarray(np.minimum(self._lower + added, 1.0))


_NAMES = ("arms", "gain", "minimum activation", "torque")


def _shapes(arrays: list[FloatArray]) -> str:
    return ", ".join(f"{name} {array.shape}" for name, array in zip(_NAMES, arrays, strict=True))


def _not_finite(arrays: list[FloatArray]) -> str:
    names = [name for name, array in zip(_NAMES, arrays, strict=True) if not np.isfinite(array).all()]
    return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"
