"""The envelope of EMG, sample by sample: band-pass, notch, rectify, low-pass, share of the maximum voluntary contraction. No ROS."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy import signal

from hric_control.errors import ParameterError
from hric_perception.chunk import Chunk, FloatArray, Layout
from hric_perception.emg.settings import Settings, read_settings

__all__ = ["Envelope", "Settings", "band_sections", "low_sections", "read_settings"]

SHORT_GAP = 0.05
"""Filters go on over a gap that is not longer; after a longer one they begin anew [s] (our choice)."""


def band_sections(settings: Settings, rate: float) -> FloatArray:
    """Second-order sections of band-pass and notches at a rate [Hz].

    Raises:
        ParameterError: a frequency that the rate cannot hold.
    """
    half, (low, high) = rate / 2, settings.band
    for name, value in (("band", high), *(("notch", value) for value in settings.notch), ("lowpass", settings.lowpass)):
        if not 0 < value < half:
            raise ParameterError(f"envelope: {name} has {value:g} Hz, which samples at {rate:g} Hz cannot hold; valid: above 0, below {half:g} Hz")
    if not 0 < low < high:
        raise ParameterError(f"envelope: band is {low:g} to {high:g} Hz; valid: rising, above 0")
    parts = [signal.butter(settings.band_order, settings.band, "bandpass", fs=rate, output="sos")]
    parts += [signal.tf2sos(*signal.iirnotch(value, settings.notch_quality, fs=rate)) for value in settings.notch]
    return np.vstack(parts)


def low_sections(settings: Settings, rate: float) -> FloatArray:
    """Second-order sections of the low-pass."""
    found: FloatArray = signal.butter(settings.lowpass_order, settings.lowpass, fs=rate, output="sos")
    return found


class Envelope:
    """Filters with state: the sizes of the chunks make no difference.

    A value that is no number is left out by the filters (they take the one before) and gives NaN in its place.

    Args:
        settings: of the chain.
        layout: of the chunks; channels measured in seconds (time codes) have no envelope.

    Attributes:
        layout: of the envelope.

    Raises:
        ParameterError: the rate is too low for the filters, or no such channel for `mvc`.
    """

    def __init__(self, settings: Settings, layout: Layout) -> None:
        self._columns = [index for index, unit in enumerate(layout.units) if unit != "s"]
        self._band, self._low = band_sections(settings, layout.rate), low_sections(settings, layout.rate)
        self._decimate, self._rate = settings.decimate, layout.rate
        names, mvc = [layout.channels[index] for index in self._columns], dict(settings.mvc)
        for name in mvc:
            if name not in names:
                raise ParameterError(f"envelope: mvc names the channel {name!r}; valid: {', '.join(names)}")
        units = ["MVC" if name in mvc else layout.units[index] for name, index in zip(names, self._columns, strict=True)]
        self.layout = replace(layout, channels=tuple(names), units=tuple(units), rate=layout.rate / settings.decimate)
        self._scale = np.array([1.0 / mvc.get(name, 1.0) for name in names])
        self._next: int | None = None
        self._band_state = self._low_state = self._before = np.empty(0)
        self._clear()

    def add(self, chunk: Chunk) -> Chunk | None:
        """The envelope of a chunk; None where none of its samples is kept."""
        if self._next is None or not 0 <= chunk.first - self._next <= SHORT_GAP * self._rate:
            self._clear()
        self._next = chunk.after
        data = chunk.data[:, self._columns]
        bad = ~np.isfinite(data)
        if bad.any():
            data = self._filled(data, bad)
        self._before = data[-1]
        banded, self._band_state = signal.sosfilt(self._band, data, axis=0, zi=self._band_state)
        smooth, self._low_state = signal.sosfilt(self._low, np.abs(banded), axis=0, zi=self._low_state)
        smooth[bad] = np.nan
        skip = -chunk.first % self._decimate
        if skip >= len(smooth):
            return None
        kept = smooth[skip :: self._decimate] * self._scale
        return Chunk(self.layout, chunk.start + skip / chunk.rate, (chunk.first + skip) // self._decimate, kept, chunk.pace)

    def _filled(self, data: FloatArray, bad: Any) -> FloatArray:
        """Each value that is no number replaced by the one before."""
        rows = np.where(bad, -1, np.arange(len(data))[:, None])
        newest = np.maximum.accumulate(rows, axis=0)
        known = np.take_along_axis(data, np.maximum(newest, 0), axis=0)
        return np.where(newest >= 0, known, self._before)

    def _clear(self) -> None:
        count = len(self._columns)
        self._band_state = np.zeros((len(self._band), 2, count))
        self._low_state = np.zeros((len(self._low), 2, count))
        self._before = np.zeros(count)
