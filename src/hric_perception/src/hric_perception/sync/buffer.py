"""Buffer of a source's latest samples, sorted by time, so that they can be searched by bisection. No ROS."""

import numpy as np
import numpy.typing as npt

NS = 1_000_000_000
"""Nanoseconds per second."""
Stamps = npt.NDArray[np.int64]
"""Robot time [ns]: integers, because a float has steps of 0.2 us at today's wall time."""
Values = npt.NDArray[np.float64]


class StampBuffer:
    """Buffer of the last `capacity` samples of one source, sorted by stamp.

    The samples are contiguous in an array of twice the capacity; only when that is full are they moved to its front.

    Args:
        capacity: number of stored samples.
        width: number of values per sample.
    """

    def __init__(self, capacity: int, width: int) -> None:
        self.capacity = capacity
        self._stamps: Stamps = np.zeros(2 * capacity, np.int64)
        self._values: Values = np.zeros((2 * capacity, width))
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    @property
    def first(self) -> int | None:
        """Stamp of the oldest sample [ns]; None if there is none."""
        return int(self._stamps[self._begin]) if len(self) else None

    @property
    def last(self) -> int | None:
        """Stamp of the newest sample [ns]; None if there is none."""
        return int(self._stamps[self._end - 1]) if len(self) else None

    @property
    def stamps(self) -> Stamps:
        """Sorted stamps, shape (n,) [ns]; valid until the next `extend`."""
        return self._stamps[self._begin : self._end]

    @property
    def values(self) -> Values:
        """Values, shape (n, width); valid until the next `extend`."""
        return self._values[self._begin : self._end]

    def extend(self, stamps: Stamps, values: Values) -> None:
        """Add samples, sorted and later than all others.

        Args:
            stamps: stamps of the samples, shape (n,) [ns].
            values: values, shape (n, width).
        """
        count = min(len(stamps), self.capacity)
        if not count:
            return
        if self._end + count > len(self._stamps):
            stored = min(len(self), self.capacity)
            self._stamps[:stored] = self._stamps[self._end - stored : self._end]
            self._values[:stored] = self._values[self._end - stored : self._end]
            self._begin, self._end = 0, stored
        self._stamps[self._end : self._end + count] = stamps[-count:]
        self._values[self._end : self._end + count] = values[-count:]
        self._end += count
        self._begin = max(self._begin, self._end - self.capacity)

    def clear(self) -> None:
        """Remove all samples."""
        self._begin = self._end = 0
