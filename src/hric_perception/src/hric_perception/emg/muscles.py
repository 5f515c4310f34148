"""Emulated surface EMG: noise of the band that electrodes see, its amplitude that of a muscle's activation. No ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy import signal

from hric_control.errors import ParameterError
from hric_perception.chunk import FloatArray
from hric_perception.emulation import BlockNoise
from hric_perception.section import Section

BAND = (20.0, 450.0)
"""Of surface EMG [Hz] (textbook)."""
AMPLITUDE = 1e-3
"""Root mean square at full activation [V]; surface EMG has 0 to 10 mV peak to peak (textbook)."""
FLOOR = 2e-6
"""Noise of electrodes and amplifier, root mean square [V] (our choice)."""
MUSCLES = ("deltoid_anterior", "deltoid_middle", "deltoid_posterior", "pectoralis_major", "biceps", "triceps", "brachioradialis", "wrist_flexors")
"""Eight of a working arm (our choice)."""
PROGRAMS = ("bursts", "constant", "points", "topic")

Activation = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> activation from 0 to 1, shape (n, muscles)."""


class Muscles:
    """A signal for `EvenSensor`: amplitude * activation * noise + floor.

    Args:
        activation: of each muscle.
        count: of muscles.
        rate: of samples [Hz]; the noise ends at 0.45 of it where it cannot hold the band.
        amplitude: root mean square at full activation [V].
        seed: of the noise.
    """

    def __init__(self, activation: Activation, count: int, rate: float, amplitude: float = AMPLITUDE, seed: int = 0) -> None:
        self._activation, self._amplitude = activation, amplitude
        low, high = BAND[0], min(BAND[1], 0.45 * rate)
        if low >= high:
            raise ParameterError(f"EMG at {rate:g} Hz: valid: above {BAND[0] / 0.45:.0f} Hz")
        self._sections = signal.butter(2, (low, high), "bandpass", fs=rate, output="sos")
        response = signal.freqz_sos(self._sections, 4096, fs=rate)[1]
        self._gain = 1.0 / math.sqrt(float(np.mean(np.abs(response) ** 2)))  # white noise of deviation 1 keeps it
        self._state = np.zeros((len(self._sections), 2, count))
        self._carrier = BlockNoise(count, seed, 3, self._in_band)
        self._floor = BlockNoise(count, seed, 4)

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """[V]"""
        carrier, floor = self._carrier.values(first, len(times)), self._floor.values(first, len(times))
        return self._amplitude * np.clip(self._activation(times), 0.0, 1.0) * carrier + FLOOR * floor

    def _in_band(self, block: FloatArray) -> FloatArray:
        found, self._state = signal.sosfilt(self._sections, block, axis=0, zi=self._state)
        return np.asarray(self._gain * found)


def read_program(section: Section, names: Sequence[str]) -> Activation:
    """The activation that a mapping describes; `topic` is not among them.

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
