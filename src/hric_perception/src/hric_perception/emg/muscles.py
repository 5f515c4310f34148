"""Emulated surface EMG: noise of the band that electrodes see, its amplitude that of a muscle's activation. No ROS."""

from __future__ import annotations

import math

import numpy as np
from scipy import signal

from hric_control.errors import ParameterError
from hric_perception.chunk import FloatArray
from hric_perception.emg.activation import AMPLITUDE, Activation
from hric_perception.emulation import BlockNoise

BAND = (20.0, 450.0)
"""Of surface EMG [Hz] (textbook)."""
FLOOR = 2e-6
"""Noise of electrodes and amplifier, root mean square [V] (our choice)."""


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
