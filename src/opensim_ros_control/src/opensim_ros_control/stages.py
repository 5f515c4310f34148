"""What a step needs beside OpenSim, without conversions: views of OpenSim's vectors, and arithmetic in C, since numpy
takes longer to see what it is given than to add seven numbers.

Arrays are of float64 and contiguous. The results are those of numpy's and scipy's own functions to the last bit: the
order of operations is the same, and the equations go to scipy's BLAS and LAPACK.
"""

from collections.abc import Callable, Sequence

import opensim

from hric_control.native import load
from hric_control.plant import FloatArray

_built = load("hric_stages")

cut: Callable[[Sequence[float], Sequence[float], Sequence[float]], tuple[list[float], FloatArray]] = _built.cut
"""(values, low, high): the values within low and high, as a list and as an array, shape (n,); a NaN stays."""
rubbed: Callable[[FloatArray, FloatArray, FloatArray], FloatArray] = _built.rubbed
"""(tau, u, rows): tau - a (tanh(b (u + c)) - d) with the rows a, b, c, d of `hric_control.plants.moving_joints`, shapes
(n,), (n,), (n, 4)."""
gripped: Callable[
    [FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, float, float], tuple[FloatArray, FloatArray]
] = _built.gripped
"""(tau, rotors, u, bend, rows, before, step): the efforts tau that the bristles leave over a step that begins with
speeds u, and the inertia of the rotors with what represents the bristles' part that follows from the step's end, shape
(n,) each. The bends, shape (n,), are first brought over the step before, of 0 s after a reset, in place; rows: of
`Losses.bristle_row`, shape (n, 3)."""
balance: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray]] = _built.balance
"""(M, b, a, tau): (M + diag(b), M a + tau), shapes (n, n), (n,), (n,), (n,); M symmetric."""
solve: Callable[[FloatArray, FloatArray], FloatArray | None] = _built.solve
"""(A, b): x of A x = b by Cholesky's factors, shapes (n, n), (n,) or (n, k); None where A is not positive definite."""
rate: Callable[[FloatArray, FloatArray], FloatArray] = _built.rate
"""(y, x): dy/dt of positions, speeds and what follows them, shape (2 n + z,), with du/dt = x, shape (n,), and
dq/dt = u; zero for what follows."""
advanced: Callable[[FloatArray, float, FloatArray], FloatArray] = _built.advanced
"""(y, step, rate): y + step rate."""
ralston: Callable[[FloatArray, float, FloatArray, FloatArray, FloatArray], FloatArray] = _built.ralston
"""(y, step, rate1, rate2, rate3): y + step (2 rate1 + 3 rate2 + 4 rate3) / 9."""


def view(values: opensim.Vector | opensim.Matrix) -> FloatArray:
    """OpenSim's own memory of a vector, shape (n,), or of a symmetric matrix, shape (n, n), without a copy.

    Whoever keeps the view keeps OpenSim's object, too, and lets nobody resize it.

    Raises:
        ValueError: the numbers are not in a row.
    """
    rows, columns = values.nrow(), values.ncol()
    # Addresses of elements are all that OpenSim's Python shows.
    first, last = int(values.updElt(0, 0)), int(values.updElt(rows - 1, columns - 1))
    found: FloatArray = _built.memory(first, last, rows * columns)
    return found if columns == 1 else found.reshape(rows, columns)
