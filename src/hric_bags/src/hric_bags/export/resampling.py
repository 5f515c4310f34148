"""Resampling of a topic's samples to an even time grid."""

from collections.abc import Sequence

import numpy as np

from hric_bags.export.table import FloatArray, TopicTable

ALMOST = 1e-3
"""Share of a sample period that is negligible [1]."""
SAME = 1e-6
"""Largest distance between samples and the times of the grid with which samples are used unchanged [s]."""
GAP = 3.0
"""Time between samples beyond which samples were lost, so that a straight line bridges the gap [periods]."""
DRIFT = 0.1
"""Largest drift with which the frame rate counts as a whole number [periods] (default chosen by this project)."""


class SampledTopic:
    """Samples of a topic that can be evaluated at other times.

    Args:
        table: table of the topic, with at least two times.

    Attributes:
        time: rising times, shape (n,) [s].
        rate: sample rate [Hz].
    """

    def __init__(self, table: TopicTable) -> None:
        self._table = table
        self.time, self._rows = np.unique(table.time, return_index=True)
        # Within a chunk, samples have the spacing of the source, whatever the pace of the run between chunks.
        rate = 1.0 / float(np.median(np.diff(self.time))) if len(self.time) > 1 else 1.0
        self.rate = float(round(rate)) if abs(rate - round(rate)) < ALMOST else rate
        self.gaps = int(np.sum(np.diff(self.time) * self.rate > GAP))

    def values(self, names: Sequence[str], times: FloatArray) -> FloatArray:
        """Return columns at `times`, shape (times, names): as recorded if the times match, else by cubic splines."""
        columns = {column.name: column.values for column in self._table.columns}
        data = np.column_stack([np.asarray(columns[name], dtype=float)[self._rows] for name in names])
        nearest = self._nearest(times)
        if len(times) and np.abs(self.time[nearest] - times).max() < SAME:
            return np.asarray(data[nearest])
        return np.column_stack([self._spline(column, times) for column in data.T])

    def how(self, times: FloatArray) -> str:
        """Return a text on how `values` computes its result at `times`."""
        same = len(times) and np.abs(self.time[self._nearest(times)] - times).max() < SAME
        how = "as recorded" if same else f"from {self.rate:g} Hz by cubic splines"
        return f"{self._table.topic} {how}" + (f", straight lines over {self.gaps} gaps" if self.gaps else "")

    def newest(self, names: Sequence[str], times: FloatArray) -> FloatArray:
        """Return the newest sample at or before each of `times`, shape (times, names), whatever follows."""
        columns = self._table.named()
        data = np.column_stack([np.asarray(columns[name].values, dtype=float)[self._rows] for name in names])
        return np.asarray(data[self._before(times)])

    def how_old(self, times: FloatArray) -> str:
        """Return a text on the samples that `newest` returns."""
        age = float(np.max(times - self.time[self._before(times)], initial=0.0))
        newest = f"from {self.rate:g} Hz: the newest sample at or before each frame, at most {age:.3g} s old"
        return f"{self._table.topic} {'as recorded' if age < SAME else newest}"

    def _before(self, times: FloatArray) -> FloatArray:
        return np.maximum(np.searchsorted(self.time, times + SAME, "right") - 1, 0)

    def _nearest(self, times: FloatArray) -> FloatArray:
        after = (
            np.clip(np.searchsorted(self.time, times), 1, max(len(self.time) - 1, 1))
            if len(self.time) > 1
            else np.zeros(len(times), dtype=int)
        )
        before = np.maximum(after - 1, 0)
        return np.where(np.abs(self.time[before] - times) <= np.abs(self.time[after] - times), before, after)

    def _spline(self, values: FloatArray, times: FloatArray) -> FloatArray:
        from scipy.interpolate import CubicSpline

        good = np.isfinite(values)
        if good.sum() < 2:
            return np.full(len(times), np.nan)
        time, finite = self.time[good], values[good]
        wide = np.flatnonzero(np.diff(time) * self.rate > GAP)
        if len(wide):
            fill = np.concatenate(
                [np.arange(time[k] + 1 / self.rate, time[k + 1] - 0.5 / self.rate, 1 / self.rate) for k in wide]
            )
            time, finite = np.concatenate([time, fill]), np.concatenate([finite, np.interp(fill, time, finite)])
            order = np.argsort(time)
            time, finite = time[order], finite[order]
        return np.asarray(CubicSpline(time, finite)(np.clip(times, time[0], time[-1])))


def frame_grid(time: FloatArray, numbers: FloatArray) -> tuple[float, float]:
    """Return (rate [Hz], time of one of its frames [s]) of the even time grid on which cameras took frames.

    Args:
        time: rising times of the frames, shape (n,) [s].
        numbers: frame numbers, shape (n,); if empty or not rising, only the times are used.
    """
    if len(time) < 2:
        return 1.0, float(time[0])
    if len(numbers) == len(time) and np.all(np.diff(numbers) > 0):
        rate = 1.0 / float(np.polyfit(numbers - numbers[0], time - time[0], 1)[0])
    else:
        rate = 1.0 / float(np.median(np.diff(time)))
    span = float(time[-1] - time[0])
    if round(rate) and abs(rate - round(rate)) * span < DRIFT:
        rate = float(round(rate))
    rate = float(np.float32(rate))  # precision of the file
    first = np.median(time - np.rint((time - time[0]) * rate) / rate)
    return rate, float(first)
