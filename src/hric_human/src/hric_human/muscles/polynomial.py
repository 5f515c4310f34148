"""Polynomials of joint angles, for the length of a muscle, its moment arms, and its force on a joint."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import numpy.typing as npt

from hric_core.geometry import FloatArray

IntArray = npt.NDArray[np.int64]


@cache
def exponents(variables: int, order: int) -> IntArray:
    """Return the exponents of all monomials up to an order, shape (terms, variables), the last variable fastest.

    This is the order of OpenSim's MultivariatePolynomialFunction.
    """
    powers = [power for power in product(range(order + 1), repeat=variables) if sum(power) <= order]
    return np.array(powers, dtype=np.int64)


def monomials(q: FloatArray, order: int) -> FloatArray:
    """Return all monomials up to an order, shape (samples, terms), for angles q of shape (samples, variables) [rad]."""
    return _products(q, exponents(q.shape[1], order))


def slopes(q: FloatArray, order: int) -> FloatArray:
    """Return the derivatives of `monomials` by each angle, shape (variables, samples, terms)."""
    power = exponents(q.shape[1], order)
    units = np.eye(q.shape[1], dtype=np.int64)
    return np.array([power[:, i] * _products(q, np.maximum(power - unit, 0)) for i, unit in enumerate(units)])


def _products(q: FloatArray, power: IntArray) -> FloatArray:
    made = np.ones((len(q), len(power)))
    for values, of in zip(q.T, power.T, strict=True):
        made *= (values[:, None] ** np.arange(power.max(initial=0) + 1))[:, of]
    return made


@dataclass(frozen=True)
class Polynomial:
    """Polynomial of joint angles: sum over terms t of c_t prod_i q_i^e_ti, with the exponents e of `exponents`.

    Attributes:
        joints: joints whose angles q are the variables, names without a side.
        order: highest sum of exponents of a term.
        coefficients: coefficients c in the unit of the value per power of rad.
    """

    joints: tuple[str, ...]
    order: int
    coefficients: tuple[float, ...]

    def powers(self, joints: Sequence[str]) -> IntArray:
        """Return each joint's exponent in each term, shape (terms, joints); `joints` includes all the polynomial's."""
        term_exponents = exponents(len(self.joints), self.order)
        spread = np.zeros((len(term_exponents), len(joints)), dtype=np.int64)
        spread[:, [joints.index(name) for name in self.joints]] = term_exponents
        return spread

    def values(self, q: FloatArray) -> FloatArray:
        """Return the values, shape (samples,), at angles q of `joints`, shape (samples, joints) [rad]."""
        return np.asarray(monomials(q, self.order) @ np.array(self.coefficients))

    def gradients(self, q: FloatArray) -> FloatArray:
        """Return the gradients, shape (samples, joints), at angles q of `joints`, shape (samples, joints) [rad]."""
        return np.asarray(slopes(q, self.order) @ np.array(self.coefficients)).T
