"""Static optimisation: the muscle activations with the smallest sum of squares that produce a required joint torque.

    min sum a_i^2   with   sum_i arms_i gain_i a_i = torque,   minimum_i <= a_i <= 1

Crowninshield & Brand, J. Biomech. 14:793, 1981, but with activations instead of stresses, as in OpenSim's
StaticOptimization with exponent 2. The problem is strictly convex and has one solution. Its dual is solved in C
(`static_optimization.h`): a_i is b_i . x clipped to its bounds, with b_i = gain_i arms_i; x has one number per joint
and minimises a convex, piecewise quadratic function, by Newton's method with a line search. Starting from the last
solution saves steps and does not change the result.
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
        shortfall: required torque minus the nearest torque that activations within the bounds can produce, shape (m,)
            [N m]; zero if the torque can be produced.
        iterations: number of steps of Newton's method.
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
        HricError: no muscles, no joints or more than 32, or a minimum activation that is not from 0 to below 1.
    """

    def __init__(self, muscles: int, joints: int, minimum: float = MINIMUM) -> None:
        if muscles < 1 or not 1 <= joints <= 32 or not 0.0 <= minimum < 1.0:
            raise HricError(
                f"static optimisation of {muscles} muscles on {joints} joints with a minimum activation of {minimum}; "
                "valid: 1 or more muscles, 1 to 32 joints, a minimum activation from 0 to below 1"
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
        """Return the activations for a required torque, or for the nearest torque that the muscles can produce.

        Args:
            arms: moment arms [m], +1 or -1 for an ideal actuator, shape (k, m).
            gain: force per activation [N], torque for an ideal actuator [N m], shape (k,).
            torque: required torque of the active muscle forces, without the passive part, shape (m,) [N m].
            co_contraction: increase of each muscle's minimum activation, from 0 to 1, shape (k,) [1]. Opposing muscles
                compensate it, so the torque remains as required.

        Raises:
            HricError: an array has a wrong shape, a number is not finite, or a co-contraction is not from 0 to 1.
        """
        lower = self._lower if co_contraction is None else self.raised(co_contraction)
        arrays = [np.ascontiguousarray(values, np.float64) for values in (arms, gain, lower, torque)]
        activation, shortfall = np.empty(len(self._lower)), np.empty(len(self._start))
        if tuple(array.shape for array in arrays) != self._shapes:
            raise HricError(
                f"static optimisation got arrays of shapes {_shapes(arrays)}; valid: {_NAMES} of shapes {self._shapes}"
            )
        try:
            iterations = _solve(*arrays, self._start, activation, shortfall)
        except ValueError as error:
            raise HricError(f"static optimisation: {_not_finite(arrays)} not finite") from error
        return ActivationSolution(activation, shortfall, iterations)

    def raised(self, co_contraction: FloatArray) -> FloatArray:
        """Return the minimum activation of each muscle with a co-contraction of shape (k,) [1]. Raises HricError."""
        added = np.asarray(co_contraction, np.float64)
        if not bool(np.all((added >= 0.0) & (added <= 1.0))):
            raise HricError(f"static optimisation: the co-contraction is {added.tolist()}; valid: from 0 to 1")
        return np.asarray(np.minimum(self._lower + added, 1.0))


_NAMES = ("arms", "gain", "minimum activation", "torque")


def _shapes(arrays: list[FloatArray]) -> str:
    return ", ".join(f"{name} {array.shape}" for name, array in zip(_NAMES, arrays, strict=True))


def _not_finite(arrays: list[FloatArray]) -> str:
    names = [name for name, array in zip(_NAMES, arrays, strict=True) if not np.isfinite(array).all()]
    return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"
