"""The values of one source at instants. No ROS."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_perception.sync.buffer import StampBuffer, Stamps, Values
from hric_perception.sync.interpolation import HOLD, LINEAR, SLERP, Bracket, bracket, hold, linear, nearest, slerp
from hric_perception.sync.layout import Source

Mask = npt.NDArray[np.bool_]


class Sampled(NamedTuple):
    """Values at instants.

    Attributes:
        values: shape (instants, columns), NaN where there is none.
        age: from the sample's stamp to the instant, shape (instants,) [s]; NaN where there is none.
        valid: whether all values are finite, shape (instants,).
        skew: distance in time from the value to the instant, shape (instants,) [s]; NaN where there is none. None: all values are of the instant.
    """

    values: Values
    age: Values
    valid: Mask
    skew: Values | None


Sampler = Callable[[StampBuffer, Stamps], Sampled]


def resampler(source: Source) -> Sampler:
    """Brings a source to instants by the interpolation of each column."""
    runs = []
    begin = 0
    for way, group in groupby(column.interpolation for column in source.columns):
        end = begin + len(list(group))
        # A run of slerp may be several quaternions.
        parts = range(begin, end, 4) if way == SLERP else (begin,)
        runs += [(_WAYS[way], slice(first, first + 4 if way == SLERP else end)) for first in parts]
        begin = end
    held = any(column.interpolation == HOLD for column in source.columns)
    reach, width = source.max_gap, len(source.columns)

    def sample(buffer: StampBuffer, instants: Stamps) -> Sampled:
        if not len(buffer):
            return _nothing(len(instants), width)
        at, values = bracket(buffer.stamps, instants), buffer.values
        parts = [way(values[:, columns], at, reach) for way, columns in runs]
        out = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        age = at.age if at.low[0] >= 0 else np.where(at.low < 0, np.nan, at.age)
        return Sampled(out, age, _finite(out), age if held else None)

    return sample


def picker(source: Source, tolerance: float) -> Sampler:
    """Takes the sample of a source that is nearest to each instant, where it is no further than tolerance [s] away; 0: of the very same stamp."""
    width = len(source.columns)

    def sample(buffer: StampBuffer, instants: Stamps) -> Sampled:
        if not len(buffer):
            return _nothing(len(instants), width)
        index, age = nearest(buffer.stamps, instants)
        far = np.abs(age) > tolerance
        out = np.where(far[:, None], np.nan, buffer.values[index])
        age = np.where(far, np.nan, age)
        return Sampled(out, age, _finite(out), np.abs(age))

    return sample


_WAYS: dict[str, Callable[[Values, Bracket, float], Values]] = {LINEAR: linear, HOLD: hold, SLERP: slerp}


def _finite(values: Values) -> Mask:
    """Whether all values of each row are: what is not finite stays so times 0. In fewer calls of numpy, whose number is what a look costs."""
    finite: Mask = ~np.isnan(values @ np.zeros(values.shape[1]))
    return finite


def _nothing(count: int, width: int) -> Sampled:
    none = np.full(count, np.nan)
    return Sampled(np.full((count, width), np.nan), none, np.zeros(count, bool), none)
