"""Space of a sweep's variables: maps points of the unit cube to values of the variables.

Correlations are defined between normal scores (Gaussian copula): they couple the ranks of two variables and do not
change their distributions. The axes of the cube are independent. A point u is mapped to normal scores z, then to L z
with L L^T the correlation matrix, then to cumulative probabilities, and to values by the inverse distribution functions
 (Nataf's transform; Lebrun & Dutfoy, Probab. Eng. Mech. 24:172, 2009).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.parameters import Mistakes, as_number, refused, unknown
from hric_sweep.variables import Variable

EDGE = 2.0**-53
"""Minimum distance of a coordinate from 0 and 1, at which an unbounded distribution has no finite quantile."""
SMALLEST = 1e-8
"""Minimum eigenvalue of a correlation matrix; below it, one variable is a function of the others."""


class Space:
    """Variables of a sweep with their distributions and correlations.

    Args:
        variables: variables by name.
        correlation: triples of two variable names and the correlation of their normal scores [1].
        where: key of the correlations in the sweep file, for error messages.

    Raises:
        HricError: there is no variable.
        ParameterError: an item does not name two different variables, a pair comes twice, a correlation is not within
            -1 and 1, or the matrix is not positive definite.
    """

    def __init__(
        self, variables: Mapping[str, Variable], correlation: Sequence[Any] = (), where: str = "sweep.correlation"
    ) -> None:
        if not variables:
            raise HricError("sweep.vary is empty; valid: at least one variable")
        self.variables = dict(variables)
        self.names = tuple(variables)
        matrix: FloatArray = np.eye(len(self.names))
        mistakes = Mistakes()
        for index, pair in enumerate(correlation):
            with mistakes.noted():
                self._enter(matrix, pair, f"{where}[{index}]")
        mistakes.raise_all()
        if (smallest := float(np.linalg.eigvalsh(matrix)[0])) < SMALLEST:
            raise refused(
                where, list(correlation), f"a positive definite matrix; the smallest eigenvalue is {smallest:.3g}"
            )
        self.independent = not np.any(matrix - np.eye(len(self.names)))
        self._factor: FloatArray = np.linalg.cholesky(matrix).astype(float)

    def _enter(self, matrix: FloatArray, pair: Any, where: str) -> None:
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 3 or pair[0] == pair[1]:
            raise refused(where, pair, "two different variables and the correlation of their normal scores")
        for name in pair[:2]:
            if name not in self.names:
                raise unknown("variable", name, self.names, where)
        try:
            value = as_number(pair[2])
        except ValueError:
            value = np.inf
        if not -1.0 < value < 1.0:
            raise refused(where, pair[2], "a correlation between -1 and 1")
        row, column = self.names.index(pair[0]), self.names.index(pair[1])
        if matrix[row, column] != 0.0:
            raise refused(where, pair[:2], "each pair only once")
        matrix[row, column] = matrix[column, row] = value

    def values(self, u: FloatArray) -> list[dict[str, object]]:
        """Return the values of the variables at points of the unit cube.

        Args:
            u: points of the unit cube, shape (m, n), n variables in the order of `names`.

        Returns:
            m mappings of name to value, in the variables' units.
        """
        shares = np.clip(np.asarray(u, dtype=float), EDGE, 1.0 - EDGE)
        if not self.independent:
            shares = np.clip(ndtr(ndtri(shares) @ self._factor.T), EDGE, 1.0 - EDGE)
        columns = [v.distribution.ppf(shares[:, i]) for i, v in enumerate(self.variables.values())]
        return [dict(zip(self.names, row, strict=True)) for row in zip(*columns, strict=True)]
