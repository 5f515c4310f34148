"""Emulated muscles: names, activation programs, and the activation of a simulated human. No ROS."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from hric_core.errors import CommandError, ParameterError
from hric_core.parameters import (
    Parameter,
    Settings,
    choice,
    either,
    listing,
    names,
    number,
    numbers,
    text,
    variant,
    whole,
)
from hric_perception.chunk import FloatArray
from hric_perception.emulation import BlockNoise
from hric_perception.replayed import RecordedEmg, ValueTrack

AMPLITUDE = 1e-3
"""Root mean square at full activation [V]; surface EMG has 0 to 10 mV peak to peak (textbook)."""
PARTS: Mapping[str, tuple[str, ...]] = {
    "deltoid_anterior": ("delt_clav_a", "delt_clav_b"),
    "deltoid_middle": ("delt_scap_c", "delt_scap_d"),
    "deltoid_posterior": ("delt_scap_a", "delt_scap_b"),
    "pectoralis_major": ("pect_maj_t_a", "pect_maj_t_b", "pect_maj_c"),
    "biceps": ("bic_l", "bic_b"),
    "triceps": ("tric_long", "tric_med", "tric_lat"),
    "brachioradialis": ("brachiorad",),
    "wrist_flexors": ("wr_flex+",),
}
"""Eight muscles of a working arm (project default, unconfirmed), with their lines of action in the built-in anatomy.

The lines, named without the side, lie below an electrode there. Those of the deltoid that begin at the scapula run from
its spine (a) to the acromion (d), so that a and b lie behind, c and d at the side (unconfirmed). The anatomy has no
muscles of the wrist: their electrode measures the actuator that flexes it.
"""
MUSCLES = tuple(PARTS)
"""Names of the default muscles."""
Activation = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> activation from 0 to 1, shape (n, muscles)."""


@dataclass(frozen=True)
class ActivationProgram(Settings):
    """Activation program of muscles."""

    def activation(self, count: int) -> Activation:
        """Return the activation of `count` muscles. Raises ParameterError."""
        raise NotImplementedError


@dataclass(frozen=True)
class ConstantActivation(ActivationProgram):
    """Constant activation program."""

    level: float = number(0.3, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """Return the constant activation."""
        return lambda times: np.full((len(times), count), self.level)


@dataclass(frozen=True)
class Bursts(ActivationProgram):
    """Half-cosine burst in each period, one muscle after the other."""

    period: float = number(4.0, minimum=0.1, maximum=3600.0, unit="s")
    share: float = number(0.5, above=0.0, maximum=1.0)
    level: float = number(0.5, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """Return the bursts."""
        shift = np.arange(count) / count

        def bursts(times: FloatArray) -> FloatArray:
            phase = (times[:, None] / self.period - shift) % 1.0
            swell = self.level * 0.5 * (1 - np.cos(2 * np.pi * phase / self.share))
            return np.asarray(np.where(phase < self.share, swell, 0.0))

        return bursts


@dataclass(frozen=True)
class Points(ActivationProgram):
    """Rows of time and activation of all muscles, or of each; linear in between."""

    points: tuple[tuple[float, ...], ...] = listing(numbers(), default=(), unit="s, 1")

    def activation(self, count: int) -> Activation:
        """Return the interpolated activation."""
        even = len({len(row) for row in self.points}) == 1 and len(self.points[0]) in (2, count + 1)
        rows = np.array(self.points) if even else np.empty((0, 2))
        if not len(rows) or (np.diff(rows[:, 0]) <= 0).any() or rows[:, 1:].min() < 0 or rows[:, 1:].max() > 1:
            raise ParameterError(
                f"{self.prefix}points: valid: rows of rising time [s] and activation, 0 to 1, of all muscles or of "
                f"each of {count}"
            )
        values = np.broadcast_to(rows[:, 1:], (len(rows), count))
        return lambda times: np.column_stack([np.interp(times, rows[:, 0], column) for column in values.T])


@dataclass(frozen=True)
class TopicActivation(Settings):
    """Activation of a simulated human from a topic."""

    topic: str = text("hric/human/activation", empty=False)
    side: str = choice("right", "left", text="arm that wears the electrodes of the usual muscles")


PROGRAM: Any = variant(
    "program",
    {"bursts": Bursts, "constant": ConstantActivation, "points": Points, "topic": TopicActivation, "c3d": RecordedEmg},
    "bursts",
    {},
    default_text="`{program: bursts}`",
    text="`bursts` (`period` [s], `share`, `level`), `constant` (`level`), `points` (rows of time "
    '[s] and activation of all or of each), `topic` (`topic`, `side`): that of a simulated human, see "Muscles of a '
    'simulated human", `c3d`: EMG as it was recorded, see "A recorded trial"',
)
"""Parameter `activation`."""


BAND = (20.0, 450.0)
"""Frequency band of surface EMG [Hz] (textbook)."""
FLOOR = 2e-6
"""Noise of electrodes and amplifier, root mean square [V] (project default, unconfirmed)."""


class BodyActivation(ValueTrack):
    """Activation of a simulated human's muscles from messages, linear in between; one thread adds.

    An electrode of a default muscle measures the mean of its lines (project default, unconfirmed: their shares below it
    are not known); any other channel is a muscle of that name.

    Args:
        channels: names of the channels.
        side: side of the default muscles.
    """

    def __init__(self, channels: Sequence[str], side: str) -> None:
        super().__init__(len(channels))
        self._parts = [
            [f"{side}_{part}" for part in PARTS[channel]] if channel in PARTS else [channel] for channel in channels
        ]
        self._names: tuple[str, ...] | None = None
        self._columns: list[list[int]] = []

    def add(self, time: float, names: Sequence[str], activation: Sequence[float]) -> None:
        """Add a message; an earlier time restarts the track.

        Args:
            time: robot time [s].
            names: names of the muscles.
            activation: activation of each [1].

        Raises:
            CommandError: a muscle is missing; raised once, since it is missing in the following messages, too.
        """
        if tuple(names) != self._names:
            self._names, self._columns = tuple(names), []
            if missing := sorted({part for group in self._parts for part in group} - set(names)):
                raise CommandError(
                    f"the message has no activation of {', '.join(missing)}; it has {', '.join(names) or 'nothing'}"
                )
            self._columns = [[self._names.index(part) for part in group] for group in self._parts]
        if self._columns:
            self.store(
                time, np.array([sum(activation[column] for column in group) / len(group) for group in self._columns])
            )


class EmulatedMuscles:
    """EMG signal for `EvenSensor`: amplitude * activation * noise + floor.

    Args:
        activation: activation of each muscle.
        count: number of muscles.
        rate: sample rate [Hz]; the noise band is limited to 0.45 of it.
        amplitude: root mean square at full activation [V].
        seed: seed of the noise.
    """

    def __init__(
        self, activation: Activation, count: int, rate: float, amplitude: float = AMPLITUDE, seed: int = 0
    ) -> None:
        self._activation, self._amplitude = activation, amplitude
        low, high = BAND[0], min(BAND[1], 0.45 * rate)
        if low >= high:
            raise ParameterError(f"EMG at {rate:g} Hz: valid: above {BAND[0] / 0.45:.0f} Hz")
        self._sections = scipy.signal.butter(2, (low, high), "bandpass", fs=rate, output="sos")
        response = scipy.signal.freqz_sos(self._sections, 4096, fs=rate)[1]
        self._gain = 1.0 / math.sqrt(float(np.mean(np.abs(response) ** 2)))  # white noise of deviation 1 keeps it
        self._state = np.zeros((len(self._sections), 2, count))
        self._carrier = BlockNoise(count, seed, 3, self._in_band)
        self._floor = BlockNoise(count, seed, 4)

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """Return the signal [V]."""
        carrier, floor = self._carrier.values(first, len(times)), self._floor.values(first, len(times))
        return self._amplitude * np.clip(self._activation(times), 0.0, 1.0) * carrier + FLOOR * floor

    def _in_band(self, block: FloatArray) -> FloatArray:
        filtered, self._state = scipy.signal.sosfilt(self._sections, block, axis=0, zi=self._state)
        return np.asarray(self._gain * filtered)


def muscles(names_or_count: int | tuple[str, ...]) -> tuple[str, ...]:
    """Return names of muscles: the given ones, or the first default ones. Raises ValueError."""
    if isinstance(names_or_count, int) and not 1 <= names_or_count <= len(MUSCLES):
        raise ValueError
    return MUSCLES[:names_or_count] if isinstance(names_or_count, int) else names_or_count


def muscle_names(text: str = "") -> Any:
    """Return a parameter with names of muscles, or the number of default ones."""
    kinds: Parameter = either(whole(), names(range(1, 65)), default=len(MUSCLES), made=muscles, text=text)
    kinds.accepts = f"1 to {len(MUSCLES)} of the usual muscles, or a list of up to 64 names, all different"
    return kinds
