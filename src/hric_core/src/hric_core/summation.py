"""Sum of floats with the same bits in every version of Python."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def total(values: Iterable[float]) -> float:
    """Return the sum from the first to the last value; since Python 3.12, `sum` also adds up the rounding errors."""
    return reduce(add, values, 0.0)
