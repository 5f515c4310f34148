"""What emulated muscles do: which there are, and programs of their activation. No ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from hric_control.errors import ParameterError
from hric_perception.section import Section

FloatArray = npt.NDArray[np.float64]

AMPLITUDE = 1e-3
"""Root mean square at full activation [V]; surface EMG has 0 to 10 mV peak to peak (textbook)."""
MUSCLES = ("deltoid_anterior", "deltoid_middle", "deltoid_posterior", "pectoralis_major", "biceps", "triceps", "brachioradialis", "wrist_flexors")
"""Eight of a working arm (our choice)."""
PROGRAMS = ("bursts", "constant", "points", "topic", "c3d")

Activation = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> activation from 0 to 1, shape (n, muscles)."""


def read_program(section: Section, names: Sequence[str]) -> Activation:
    """The activation that a mapping describes; `topic` and `c3d` are not among them.

    Raises:
        HricError: a value that cannot be.
    """
    kind, count = section.text("program", "bursts", PROGRAMS), len(names)
    if kind == "constant":
        section.only("program", "level")
        level = section.number("level", 0.3, 0.0, 1.0)
        return lambda times: np.full((len(times), count), level)
    if kind == "points":
        return _points(section, count)
    section.only("program", "period", "share", "level")
    period, share = section.number("period", 4.0, 0.1, 3600.0), section.number("share", 0.5, 0.0, 1.0, above=True)
    level = section.number("level", 0.5, 0.0, 1.0)
    shift = np.arange(count) / count

    def bursts(times: FloatArray) -> FloatArray:
        """A half-cosine swell in each period, one muscle after the other."""
        phase = (times[:, None] / period - shift) % 1.0
        return np.asarray(np.where(phase < share, level * 0.5 * (1 - np.cos(2 * np.pi * phase / share)), 0.0))

    return bursts


def _points(section: Section, count: int) -> Activation:
    """Rows of time and activation of all muscles, or of each; straight between them."""
    section.only("program", "points")
    rows = np.array(section.rows("points", 2, count + 1))
    if not len(rows) or (np.diff(rows[:, 0]) <= 0).any() or rows[:, 1:].min() < 0 or rows[:, 1:].max() > 1:
        raise ParameterError(f"{section.where}.points: valid: rows of rising time [s] and activation, 0 to 1, of all muscles or of each of {count}")
    values = np.broadcast_to(rows[:, 1:], (len(rows), count))
    return lambda times: np.column_stack([np.interp(times, rows[:, 0], column) for column in values.T])
