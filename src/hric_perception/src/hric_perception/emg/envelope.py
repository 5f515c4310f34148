"""Envelope of EMG: band-pass, notch, rectification, low-pass, share of the maximum voluntary contraction. No ROS."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from hric_core.errors import ParameterError
from hric_core.parameters import Settings as Base
from hric_core.parameters import mapping, number, numbers, whole
from hric_perception.chunk import Chunk, FloatArray, Layout

SHORT_GAP = 0.05
"""Longest gap in the samples across which the filters keep their state [s] (project default, unconfirmed).

After a longer gap they restart.
"""

GRID = 16384
"""Number of frequencies at which the group delay of the band-pass is computed."""


@dataclass(frozen=True)
class EnvelopeSettings(Base):
    """Settings of the filter chain from raw EMG to its envelope."""

    band: tuple[float, ...] = numbers(
        2,
        (20.0, 450.0),
        unit="Hz",
        text="edges of the band-pass; 20 to 450 Hz is usual for surface EMG (SENIAM, ISEK; textbook)",
    )
    band_order: int = whole(
        2, minimum=1, maximum=8, text="order of the Butterworth prototype; the band-pass has twice as many poles"
    )
    notch: tuple[float, ...] = numbers(
        range(9), (50.0,), unit="Hz", text="frequencies removed by notch filters; 50 Hz: the mains"
    )
    notch_quality: float = number(30.0, above=0.0, text="quality of the notch filters: frequency over width at -3 dB")
    lowpass: float = number(
        6.0, above=0.0, unit="Hz", text="cut-off of the low-pass of the rectified signal; 3 to 6 Hz is usual (textbook)"
    )
    lowpass_order: int = whole(4, minimum=1, maximum=8, text="order of the Butterworth low-pass")
    mvc: Mapping[str, float] = mapping(
        number(above=0.0),
        {},
        unit="unit of the channel",
        text="envelope at maximum voluntary contraction, by channel; other channels are not normalised",
    )
    decimate: int = whole(10, minimum=1, maximum=10000, text="number of EMG samples per sample of the envelope")


def band_sections(settings: EnvelopeSettings, rate: float) -> FloatArray:
    """Return the second-order sections of band-pass and notches at a sample rate [Hz], shape (sections, 6).

    Raises:
        ParameterError: a frequency is not between 0 and half the rate, or the band does not rise.
    """
    half, (low, high) = rate / 2, settings.band
    for name, value in (("band", high), *(("notch", value) for value in settings.notch), ("lowpass", settings.lowpass)):
        if not 0 < value < half:
            raise ParameterError(
                f"envelope: {name} is {value:g} Hz; valid with {rate:g} samples per second: above 0, below {half:g} Hz"
            )
    if not 0 < low < high:
        raise ParameterError(f"envelope: band is {low:g} to {high:g} Hz; valid: two rising frequencies above 0")
    parts = [scipy.signal.butter(settings.band_order, settings.band, "bandpass", fs=rate, output="sos")]
    parts += [
        scipy.signal.tf2sos(*scipy.signal.iirnotch(value, settings.notch_quality, fs=rate)) for value in settings.notch
    ]
    return np.vstack(parts)


def low_sections(settings: EnvelopeSettings, rate: float) -> FloatArray:
    """Return the second-order sections of the low-pass at a sample rate [Hz], shape (sections, 6)."""
    return np.asarray(scipy.signal.butter(settings.lowpass_order, settings.lowpass, fs=rate, output="sos"))


def lag(settings: EnvelopeSettings, rate: float) -> float:
    """Return the delay of the envelope behind a slow change of the EMG amplitude [s], at a sample rate [Hz].

    It is the group delay of the low-pass at frequency 0, sum over its sections of (sum k b_k / sum b_k - sum k a_k /
    sum a_k) samples, plus the mean group delay of band-pass and notches for a white signal, each frequency weighted by
    its passed power.
    """
    low = low_sections(settings, rate)
    k = np.arange(3)
    delay = float(((low[:, :3] @ k) / low[:, :3].sum(axis=1) - (low[:, 3:] @ k) / low[:, 3:].sum(axis=1)).sum())
    w, response = scipy.signal.freqz_sos(band_sections(settings, rate), GRID)
    power = np.abs(response) ** 2
    slope = np.gradient(np.unwrap(np.angle(response)), w)
    return (delay - float((power * slope).sum() / power.sum())) / rate


class Envelope:
    """EMG envelope filter with state: its result does not depend on how samples are split into chunks.

    The filters replace a value that is not finite by the previous one; the envelope of that sample is NaN.

    Args:
        settings: settings of the filter chain.
        layout: layout of the raw EMG; channels measured in seconds (time codes) have no envelope.

    Attributes:
        layout: layout of the envelope.

    Raises:
        ParameterError: the rate is too low for the filters, or a channel of `mvc` does not exist.
    """

    def __init__(self, settings: EnvelopeSettings, layout: Layout) -> None:
        self._columns = [index for index, unit in enumerate(layout.units) if unit != "s"]
        self._band, self._low = band_sections(settings, layout.rate), low_sections(settings, layout.rate)
        self._decimate, self._rate = settings.decimate, layout.rate
        names, mvc = [layout.channels[index] for index in self._columns], settings.mvc
        for name in mvc:
            if name not in names:
                raise ParameterError(f"envelope: mvc names the channel {name!r}; valid: {', '.join(names)}")
        units = [
            "MVC" if name in mvc else layout.units[index] for name, index in zip(names, self._columns, strict=True)
        ]
        self.layout = replace(layout, channels=tuple(names), units=tuple(units), rate=layout.rate / settings.decimate)
        self._scale = np.array([1.0 / mvc.get(name, 1.0) for name in names])
        self._next: int | None = None
        self._band_state = self._low_state = self._before = np.empty(0)
        self._clear()

    def add(self, chunk: Chunk) -> Chunk | None:
        """Return the envelope of the next chunk of raw EMG; None if decimation leaves none of its samples."""
        if self._next is None or not 0 <= chunk.first - self._next <= SHORT_GAP * self._rate:
            self._clear()
        self._next = chunk.after
        data = chunk.data[:, self._columns]
        bad = ~np.isfinite(data)
        if bad.any():
            data = self._filled(data, bad)
        self._before = data[-1]
        banded, self._band_state = scipy.signal.sosfilt(self._band, data, axis=0, zi=self._band_state)
        smooth, self._low_state = scipy.signal.sosfilt(self._low, np.abs(banded), axis=0, zi=self._low_state)
        smooth[bad] = np.nan
        skip = -chunk.first % self._decimate
        if skip >= len(smooth):
            return None
        decimated = smooth[skip :: self._decimate] * self._scale
        return Chunk(
            self.layout, chunk.start + skip / chunk.rate, (chunk.first + skip) // self._decimate, decimated, chunk.pace
        )

    def _filled(self, data: FloatArray, bad: Any) -> FloatArray:
        """Return the data with each value that is not finite replaced by the previous one."""
        newest = np.maximum.accumulate(np.where(bad, -1, np.arange(len(data))[:, None]), axis=0)
        return np.where(newest >= 0, np.take_along_axis(data, np.maximum(newest, 0), axis=0), self._before)

    def _clear(self) -> None:
        count = len(self._columns)
        self._band_state = np.zeros((len(self._band), 2, count))
        self._low_state = np.zeros((len(self._low), 2, count))
        self._before = np.zeros(count)
