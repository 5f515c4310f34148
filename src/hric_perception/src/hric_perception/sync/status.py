"""Figures of the last second. No ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_perception.sync.buffer import Values

Mask = npt.NDArray[np.bool_]
SPAN = 1_000_000_000
"""[ns]"""


class _Row(NamedTuple):
    stamp: int
    skews: Sequence[Values | None]
    valid: Mask
    waited: int


class Window:
    """Skew of each source, and how long instants waited, over the last second. What is told of it is computed when it is asked for.

    Args:
        sources: how many.
    """

    def __init__(self, sources: int) -> None:
        self._sources = sources
        self._rows: deque[_Row] = deque()

    def add(self, stamp: int, skews: Sequence[Values | None], valid: Mask, waited: int) -> None:
        """A batch.

        Args:
            stamp: its last instant [ns].
            skews: per source, at each instant [s]; NaN where there is no sample; None: all values are of the instant.
            valid: whether each source is, shape (instants, sources).
            waited: of the first of them [ns].
        """
        self._rows.append(_Row(stamp, skews, valid, waited))
        while self._rows[0].stamp < stamp - SPAN:
            self._rows.popleft()

    def clear(self) -> None:
        """Forget all of it."""
        self._rows.clear()

    def mean(self) -> list[float]:
        """Mean skew of each source [s]; 0 where there was no sample."""
        return [float(skews.mean()) if len(skews) else 0.0 for skews in map(self._skews, range(self._sources))]

    def largest(self) -> list[float]:
        """Largest skew of each source [s]."""
        return [float(self._skews(index).max(initial=0.0)) for index in range(self._sources)]

    def valid(self) -> list[float]:
        """Share of the instants at which each source was valid [1]; 1 where there was none."""
        if not self._rows:
            return [1.0] * self._sources
        shares: list[float] = np.concatenate([row.valid for row in self._rows]).mean(axis=0).tolist()
        return shares

    def delay(self) -> float:
        """The longest that an instant waited [s]."""
        return max((row.waited for row in self._rows), default=0) * 1e-9

    def _skews(self, index: int) -> Values:
        known = [row.skews[index] for row in self._rows]
        skews: Values = np.concatenate([np.zeros(0), *(one for one in known if one is not None)])
        finite: Values = skews[~np.isnan(skews)]
        return finite
