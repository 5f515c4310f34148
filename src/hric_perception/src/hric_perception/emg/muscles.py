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
"""Root mean square of emulated EMG at full activation [V]; surface EMG has 0 to 10 mV peak to peak (textbook)."""
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
"""Eight default EMG channels of an arm (project default, unconfirmed), with the muscle paths below each electrode.

Paths are those of the built-in body model, named without the side. The scapular paths of the deltoid begin along the
spine of the scapula (a) up to the acromion (d): a and b are posterior, c and d lateral (unconfirmed). The body model
has no wrist muscles: their electrode measures the actuator that flexes the wrist.
"""
MUSCLES = tuple(PARTS)
"""Names of the default EMG channels."""
Activation = Callable[[FloatArray], FloatArray]
"""Function from robot times, shape (n,) [s], to activation from 0 to 1, shape (n, muscles)."""


@dataclass(frozen=True)
class ActivationProgram(Settings):
    """Settings of a program that activates emulated muscles over time."""

    def activation(self, count: int) -> Activation:
        """Return the activation of `count` muscles as a function of robot time. Raises ParameterError."""
        raise NotImplementedError


@dataclass(frozen=True)
class ConstantActivation(ActivationProgram):
    """Settings of a program with the same constant activation for all muscles."""

    level: float = number(0.3, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """Return the constant activation of `count` muscles as a function of robot time."""
        return lambda times: np.full((len(times), count), self.level)


@dataclass(frozen=True)
class Bursts(ActivationProgram):
    """Settings of a program with one raised-cosine burst of activation per period, one muscle after the other."""

    period: float = number(4.0, minimum=0.1, maximum=3600.0, unit="s")
    share: float = number(0.5, above=0.0, maximum=1.0)
    level: float = number(0.5, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """Return the activation of `count` muscles, in bursts, as a function of robot time."""
        shift = np.arange(count) / count

        def bursts(times: FloatArray) -> FloatArray:
            phase = (times[:, None] / self.period - shift) % 1.0
            swell = self.level * 0.5 * (1 - np.cos(2 * np.pi * phase / self.share))
            return np.asarray(np.where(phase < self.share, swell, 0.0))

        return bursts


@dataclass(frozen=True)
class Points(ActivationProgram):
    """Settings of a program that interpolates linearly between rows of time and activation, common or per muscle."""

    points: tuple[tuple[float, ...], ...] = listing(numbers(), default=(), unit="s, 1")

    def activation(self, count: int) -> Activation:
        """Return the interpolated activation of `count` muscles as a function of robot time."""
        even = len({len(row) for row in self.points}) == 1 and len(self.points[0]) in (2, count + 1)
        rows = np.array(self.points) if even else np.empty((0, 2))
        if not len(rows) or (np.diff(rows[:, 0]) <= 0).any() or rows[:, 1:].min() < 0 or rows[:, 1:].max() > 1:
            raise ParameterError(
                f"{self.prefix}points is not valid; valid: rows of increasing time [s] and activation, 0 to 1: one "
                f"value for all muscles, or {count} values, one for each muscle"
            )
        values = np.broadcast_to(rows[:, 1:], (len(rows), count))
        return lambda times: np.column_stack([np.interp(times, rows[:, 0], column) for column in values.T])


@dataclass(frozen=True)
class TopicActivation(Settings):
    """Settings of the activation of a simulated human's muscles, received on a topic."""

    topic: str = text("hric/human/activation", empty=False)
    side: str = choice("right", "left", text="arm with the electrodes of the default muscles")


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
"""Parameter `activation`: source of the emulated muscles' activation, chosen by the key `program`."""


BAND = (20.0, 450.0)
"""Frequency band of surface EMG [Hz] (textbook)."""
FLOOR = 2e-6
"""Noise of electrodes and amplifier, root mean square [V] (project default, unconfirmed)."""


class BodyActivation(ValueTrack):
    """Muscle activation of a simulated human, interpolated linearly between messages; one thread adds them.

    A default channel has the mean activation of its muscle paths (project default, unconfirmed: how much each one
    contributes at the electrode is not known). Any other channel has that of the muscle path of the same name.

    Args:
        channels: names of the EMG channels.
        side: side of the arm of default channels, "right" or "left".
    """

    def __init__(self, channels: Sequence[str], side: str) -> None:
        super().__init__(len(channels))
        self._parts = [
            [f"{side}_{part}" for part in PARTS[channel]] if channel in PARTS else [channel] for channel in channels
        ]
        self._names: tuple[str, ...] | None = None
        self._columns: list[list[int]] = []

    def add(self, time: float, names: Sequence[str], activation: Sequence[float]) -> None:
        """Add the activation of one message; a time before the last one clears what is stored.

        Args:
            time: robot time [s].
            names: names of the muscle paths.
            activation: activation of each path [1].

        Raises:
            CommandError: a muscle path is missing; raised only for the first of several messages with equal names.
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
    """Emulated EMG, a signal for `EvenSensor`: amplitude * activation * band-limited noise + noise floor.

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
            raise ParameterError(f"emulated EMG has a rate of {rate:g} Hz; valid: above {BAND[0] / 0.45:.0f} Hz")
        self._sections = scipy.signal.butter(2, (low, high), "bandpass", fs=rate, output="sos")
        response = scipy.signal.freqz_sos(self._sections, 4096, fs=rate)[1]
        self._gain = 1.0 / math.sqrt(float(np.mean(np.abs(response) ** 2)))  # the filtered noise has deviation 1 again
        self._state = np.zeros((len(self._sections), 2, count))
        self._carrier = BlockNoise(count, seed, 3, self._in_band)
        self._floor = BlockNoise(count, seed, 4)

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """Return the EMG of samples numbered from `first` at robot times, shape (n,) [s]: shape (n, muscles) [V]."""
        carrier, floor = self._carrier.values(first, len(times)), self._floor.values(first, len(times))
        return self._amplitude * np.clip(self._activation(times), 0.0, 1.0) * carrier + FLOOR * floor

    def _in_band(self, block: FloatArray) -> FloatArray:
        filtered, self._state = scipy.signal.sosfilt(self._sections, block, axis=0, zi=self._state)
        return np.asarray(self._gain * filtered)


def muscles(names_or_count: int | tuple[str, ...]) -> tuple[str, ...]:
    """Return names of EMG channels: the given ones, or the first default ones. Raises ValueError."""
    if isinstance(names_or_count, int) and not 1 <= names_or_count <= len(MUSCLES):
        raise ValueError
    return MUSCLES[:names_or_count] if isinstance(names_or_count, int) else names_or_count


def muscle_names(text: str = "") -> Any:
    """Return the declaration of a parameter: names of EMG channels, or how many default channels."""
    kinds: Parameter = either(whole(), names(range(1, 65)), default=len(MUSCLES), made=muscles, text=text)
    kinds.accepts = f"1 to {len(MUSCLES)} of the usual muscles, or a list of up to 64 names, all different"
    return kinds
