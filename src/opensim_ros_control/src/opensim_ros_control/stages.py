"""Views of OpenSim's vectors and array arithmetic in C for a step, without conversions.

For a few numbers, numpy's type dispatch takes longer than the arithmetic. Arrays are of float64 and contiguous. The
results equal those of numpy's and scipy's own functions to the last bit: the order of operations is the same, and the
equations go to scipy's BLAS and LAPACK.
"""

from collections.abc import Callable, Sequence

import opensim

from hric_control.plant import FloatArray
from hric_core.native import load

_built = load("hric_stages")

cut: Callable[[Sequence[float], Sequence[float], Sequence[float]], tuple[list[float], FloatArray]] = _built.cut
"""Function (values, low, high) -> values clamped to low and high, as list and as array, shape (n,); a NaN stays."""
rubbed: Callable[[FloatArray, FloatArray, FloatArray], FloatArray] = _built.rubbed
"""Function (tau, u, rows) -> tau - a (tanh(b (u + c)) - d), shapes (n,), (n,), (n, 4).

The rows a, b, c, d are those of `hric_control.plants.moving_joints`.
"""
gripped: Callable[
    [FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float, float], tuple[FloatArray, FloatArray]
] = _built.gripped
"""Function (tau, rotors, u, bend, rows, before, step) -> (efforts, inertia) with the bristles, shape (n,) each.

tau are the efforts and u the speeds at the start of the step; the inertia is that of the rotors plus an equivalent of
the bristle forces that depend on the end of the step. The bends, shape (n,), are first advanced in place over the step
`before`, 0 s after a reset; rows: of `Losses.bristle_row`, shape (n, 3).
"""
balance: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]] = _built.balance
"""Function (M, b, a, tau) -> (M + diag(b), M a + tau), shapes (n, n), (n,), (n,), (n,); M symmetric."""
solve: Callable[[FloatArray, FloatArray], FloatArray | None] = _built.solve
"""Function (A, b) -> x of A x = b by Cholesky, shapes (n, n), (n,) or (n, k); None if not positive definite."""
rate: Callable[[FloatArray, FloatArray], FloatArray] = _built.rate
"""Function (y, x) -> dy/dt of positions, speeds and z, shape (2 n + z,), with du/dt = x, dq/dt = u, dz/dt = 0."""
advanced: Callable[[FloatArray, float, FloatArray], FloatArray] = _built.advanced
"""Function (y, step, rate) -> y + step rate."""
ralston: Callable[[FloatArray, float, FloatArray, FloatArray, FloatArray], FloatArray] = _built.ralston
"""Function (y, step, rate1, rate2, rate3) -> y + step (2 rate1 + 3 rate2 + 4 rate3) / 9."""


def view(values: opensim.Vector | opensim.Matrix) -> FloatArray:
    """Return OpenSim's memory of a vector, shape (n,), or of a symmetric matrix, shape (n, n), without a copy.

    The caller must keep OpenSim's object alive as long as the view, and prevent its resizing.

    Raises:
        ValueError: the numbers are not contiguous.
    """
    rows, columns = values.nrow(), values.ncol()
    # OpenSim's Python exposes only the addresses of elements.
    first, last = int(values.updElt(0, 0)), int(values.updElt(rows - 1, columns - 1))
    memory: FloatArray = _built.memory(first, last, rows * columns)
    return memory if columns == 1 else memory.reshape(rows, columns)
