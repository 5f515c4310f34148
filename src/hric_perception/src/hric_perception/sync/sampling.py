"""Interpolation or selection of one source's values at common instants. No ROS."""

from collections.abc import Callable
from itertools import groupby
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from hric_perception.sync.buffer import StampBuffer, Stamps, Values
from hric_perception.sync.layout import HOLD, LINEAR, SLERP, SyncSource

Indices = npt.NDArray[np.intp]
NS = 1e-9
STRAIGHT = 1e-4
"""Angle below which quaternions are interpolated linearly [rad] (project default, unconfirmed).

The error is below the cube of this angle over 24, 1e-13 rad.
"""
Mask = npt.NDArray[np.bool_]


class Bracket(NamedTuple):
    """Samples before and after each instant; all arrays have shape (instants,).

    Attributes:
        low: index of the last sample at or before the instant; -1: there is none.
        high: index of the next sample; that of the last one if there is none.
        weight: weight of the high sample, from 0 at the low one to 1 at the high one.
        age: instant minus stamp of the low sample [s]; infinite if there is none.
        gap: time from low to high sample [s]; 0 if the low one is at the instant; infinite if one is missing.
    """

    low: Indices
    high: Indices
    weight: Values
    age: Values
    gap: Values


def bracket(stamps: Stamps, instants: Stamps) -> Bracket:
    """Find the samples around instants; stamps: sorted, shape (n > 0,) [ns]; instants: sorted, shape (m,) [ns]."""
    last = len(stamps) - 1
    low = stamps.searchsorted(instants, side="right") - 1
    inside = low[0] >= 0 and low[-1] < last
    first, second = (low, low + 1) if inside else (np.maximum(low, 0), np.minimum(low + 1, last))
    before = stamps[first]
    # Differences are taken in whole nanoseconds, since stamps are too large for the digits of a float.
    age: Values = (instants - before) * np.float64(NS)
    span: Values = (stamps[second] - before) * np.float64(NS)
    hit = age == 0.0
    if inside:
        return Bracket(low, second, age / span, age, np.where(hit, 0.0, span) if hit.any() else span)
    outside = (low < 0) | ((low == last) & ~hit)
    weight = np.where(hit | outside, 0.0, age / np.where(span > 0.0, span, 1.0))
    return Bracket(
        low, second, weight, np.where(low < 0, np.inf, age), np.where(outside, np.inf, np.where(hit, 0.0, span))
    )


def linear(values: Values, at: Bracket, reach: float) -> Values:
    """Interpolate linearly between samples at most `reach` [s] apart; NaN elsewhere and after the last sample."""
    return _between(values, at, reach, _straight)


def hold(values: Values, at: Bracket, reach: float) -> Values:
    """Return the last sample at or before each instant; NaN if it is older than `reach` [s]."""
    out = values[at.low]
    out[at.age > reach] = np.nan
    return out


def slerp(quaternions: Values, at: Bracket, reach: float) -> Values:
    """Interpolate quaternions along the shorter rotation at constant angular velocity; NaN as `linear` has it.

    Args:
        quaternions: x, y, z, w, shape (n, 4); each is normalised, and is NaN if its norm is 0.
        at: samples around the instants.
        reach: longest time between samples [s].
    """
    return _between(quaternions, at, reach, _rotate)


def _between(values: Values, at: Bracket, reach: float, mix: Callable[[Values, Values, Values], Values]) -> Values:
    """Interpolate with `mix`; an instant at a sample gets exactly that sample, even if the next one is NaN."""
    out = mix(values[at.low], values[at.high], at.weight[:, None])
    hit = at.weight == 0.0
    if hit.any():
        low = values[at.low[hit]]
        out[hit] = low if mix is _straight else _unit(low)
    if at.gap.max() > reach:
        out[at.gap > reach] = np.nan
    return out


def _straight(low: Values, high: Values, weight: Values) -> Values:
    return low * (1.0 - weight) + high * weight


def _rotate(low: Values, high: Values, weight: Values) -> Values:
    low, high = _unit(low), _unit(high)
    high = np.where(_dot(low, high) < 0.0, -high, high)
    # The angle is computed from the chord: arccos loses half of the digits for nearly equal quaternions.
    chord = high - low
    angle = 2.0 * np.arcsin(np.minimum(0.5 * np.sqrt(_dot(chord, chord)), 1.0))
    straight = ~(angle > STRAIGHT)
    sine = np.sin(angle)
    sine[straight] = angle[straight] = 1.0
    a, b = np.sin((1.0 - weight) * angle) / sine, np.sin(weight * angle) / sine
    if straight.any():
        a, b = np.where(straight, 1.0 - weight, a), np.where(straight, weight, b)
    return _unit(a * low + b * high)


def nearest(stamps: Stamps, instants: Stamps) -> tuple[Indices, Values]:
    """Return, per instant, the index of the nearest (or earlier) sample, and instant minus its stamp [s]."""
    high = np.minimum(np.searchsorted(stamps, instants, side="left"), len(stamps) - 1)
    low = np.maximum(high - 1, 0)
    index = np.where(np.abs(instants - stamps[low]) <= np.abs(stamps[high] - instants), low, high)
    return index, (instants - stamps[index]).astype(np.float64) * NS


def _dot(a: Values, b: Values) -> Values:
    return np.asarray(np.einsum("ij,ij->i", a, b)[:, None])


def _unit(quaternions: Values) -> Values:
    norm = np.sqrt(_dot(quaternions, quaternions))
    return quaternions / np.where(norm > 0.0, norm, np.nan)


class SampledValues(NamedTuple):
    """Values of one source at instants.

    Attributes:
        values: values, shape (instants, columns); NaN if there is none.
        age: instant minus the sample's stamp, shape (instants,) [s]; NaN if there is none.
        valid: True if all values are finite, shape (instants,).
        skew: time between value and instant, shape (instants,) [s]; NaN without a value. None: all values are
            interpolated at the instants.
    """

    values: Values
    age: Values
    valid: Mask
    skew: Values | None


Sampler = Callable[[StampBuffer, Stamps], SampledValues]


def resampler(source: SyncSource) -> Sampler:
    """Return a sampler that interpolates each column of a source at instants."""
    runs = []
    begin = 0
    for interpolation, group in groupby(column.interpolation for column in source.columns):
        end = begin + len(list(group))
        # Consecutive slerp columns may be several quaternions.
        parts = range(begin, end, 4) if interpolation == SLERP else (begin,)
        function = _INTERPOLATIONS[interpolation]
        runs += [(function, slice(first, first + 4 if interpolation == SLERP else end)) for first in parts]
        begin = end
    held = any(column.interpolation == HOLD for column in source.columns)
    reach, width = source.max_gap, len(source.columns)

    def sample(buffer: StampBuffer, instants: Stamps) -> SampledValues:
        if not len(buffer):
            return _nothing(len(instants), width)
        at, values = bracket(buffer.stamps, instants), buffer.values
        parts = [function(values[:, columns], at, reach) for function, columns in runs]
        out = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)
        age = at.age if at.low[0] >= 0 else np.where(at.low < 0, np.nan, at.age)
        return SampledValues(out, age, _finite(out), age if held else None)

    return sample


def picker(source: SyncSource, tolerance: float) -> Sampler:
    """Return a sampler that takes the sample nearest to each instant, within `tolerance` [s]; 0: equal stamps."""
    width = len(source.columns)

    def sample(buffer: StampBuffer, instants: Stamps) -> SampledValues:
        if not len(buffer):
            return _nothing(len(instants), width)
        index, age = nearest(buffer.stamps, instants)
        far = np.abs(age) > tolerance
        out = np.where(far[:, None], np.nan, buffer.values[index])
        age = np.where(far, np.nan, age)
        return SampledValues(out, age, _finite(out), np.abs(age))

    return sample


_INTERPOLATIONS: dict[str, Callable[[Values, Bracket, float], Values]] = {LINEAR: linear, HOLD: hold, SLERP: slerp}


def _finite(values: Values) -> Mask:
    """Return a mask of the rows whose values are all finite, shape (n,).

    A row times 0 sums to NaN if a value is not finite. This needs one call of numpy; calls dominate the cost.
    """
    return np.asarray(~np.isnan(values @ np.zeros(values.shape[1])))


def _nothing(count: int, width: int) -> SampledValues:
    none = np.full(count, np.nan)
    return SampledValues(np.full((count, width), np.nan), none, np.zeros(count, bool), none)
