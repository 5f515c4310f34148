"""Compiled array arithmetic for the steps of the OpenSim plant, and views of OpenSim's vectors without copies.

For arrays of a few numbers, numpy's type dispatch takes longer than the arithmetic. Arrays must be contiguous float64.
The results equal those of numpy and scipy to the last bit: the order of operations is the same, and linear algebra is
done by scipy's BLAS and LAPACK.
"""

from collections.abc import Callable, Sequence

import opensim

from hric_control.plant import FloatArray
from hric_core.native import load

_built = load("hric_stages")

cut: Callable[[Sequence[float], Sequence[float], Sequence[float]], tuple[list[float], FloatArray]] = _built.cut
"""Function (values, low, high) -> values clamped to low and high, as list and as array, shape (n,); a NaN stays."""
rubbed: Callable[[FloatArray, FloatArray, FloatArray], FloatArray] = _built.rubbed
"""Function (tau, u, rows) that returns the efforts tau less sigmoid friction: tau - a (tanh(b (u + c)) - d).

Shapes (n,), (n,), (n, 4); u: speeds; each row has a, b, c, d of a joint, from `Losses.sigmoid_row`.
"""
gripped: Callable[
    [FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float, float], tuple[FloatArray, FloatArray]
] = _built.gripped
"""Function (tau, rotors, u, bend, rows, before, step) that applies friction at rest (bristle model).

Returns (efforts, inertia), shape (n,) each: tau less the friction, and the rotor inertia plus the part of the friction
that depends on the speed at the end of the step. u: speeds at the start of the step. bend: deflections of the bristles,
first advanced in place over the previous step of duration `before` [s] (0 after a reset). rows: `Losses.bristle_row` of
each joint, shape (n, 3). step: duration of the coming step [s].
"""
balance: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]] = _built.balance
"""Function (M, b, a, tau) that returns M + diag(b) and M a + tau; shapes (n, n), (n,), (n,), (n,); M symmetric.

M: mass matrix, b: rotor inertias, a: OpenSim's acceleration, tau: efforts.
"""
solve: Callable[[FloatArray, FloatArray], FloatArray | None] = _built.solve
"""Function (A, b) that solves A x = b by Cholesky; shapes (n, n), (n,) or (n, k); None if not positive definite."""
rate: Callable[[FloatArray, FloatArray], FloatArray] = _built.rate
"""Function (y, x) that returns dy/dt of the state y = (q, u, z), with dq/dt = u, du/dt = x, dz/dt = 0.

y: shape (2 n + z,); x: accelerations, shape (n,).
"""
advanced: Callable[[FloatArray, float, FloatArray], FloatArray] = _built.advanced
"""Function (y, step, rate) that returns the state after an Euler step, y + step rate."""
ralston: Callable[[FloatArray, float, FloatArray, FloatArray, FloatArray], FloatArray] = _built.ralston
"""Function (y, step, rate1, rate2, rate3) that returns y + step (2 rate1 + 3 rate2 + 4 rate3) / 9.

This is the last stage of Ralston's third-order Runge-Kutta method.
"""


def view(values: opensim.Vector | opensim.Matrix) -> FloatArray:
    """Return an array over OpenSim's memory of a vector, shape (n,), or of a symmetric matrix, shape (n, n).

    The caller must keep OpenSim's object alive as long as the array is used, and must not resize the object.

    Raises:
        ValueError: the numbers are not contiguous in memory.
    """
    rows, columns = values.nrow(), values.ncol()
    # OpenSim's Python exposes only the addresses of elements.
    first, last = int(values.updElt(0, 0)), int(values.updElt(rows - 1, columns - 1))
    memory: FloatArray = _built.memory(first, last, rows * columns)
    return memory if columns == 1 else memory.reshape(rows, columns)
