"""What emulated muscles do: which there are, programs of their activation, and that of a simulated human. No ROS."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from hric_control.errors import CommandError, ParameterError
from hric_control.parameters import (
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
from hric_perception.replayed import RecordedEmg, Track

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
"""Eight muscles of a working arm (project default, unconfirmed), and what each is of the built-in anatomy of
hric_human, without the side: the lines of action below an electrode there. Those of the deltoid that begin at the
scapula run from its spine (a) to the acromion (d), so that a and b lie behind, c and d at the side (unconfirmed). The
anatomy has no muscles of the wrist: their electrode measures the actuator that flexes it."""
MUSCLES = tuple(PARTS)
"""The usual ones."""
Activation = Callable[[FloatArray], FloatArray]
"""Run times, shape (n,) [s] -> activation from 0 to 1, shape (n, muscles)."""


@dataclass(frozen=True)
class Program(Settings):
    """What muscles do by themselves."""

    def activation(self, count: int) -> Activation:
        """Of so many muscles. Raises ParameterError."""
        raise NotImplementedError


@dataclass(frozen=True)
class Constant(Program):
    """Always the same."""

    level: float = number(0.3, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """See the base."""
        return lambda times: np.full((len(times), count), self.level)


@dataclass(frozen=True)
class Bursts(Program):
    """A half-cosine swell in each period, one muscle after the other."""

    period: float = number(4.0, minimum=0.1, maximum=3600.0, unit="s")
    share: float = number(0.5, above=0.0, maximum=1.0)
    level: float = number(0.5, minimum=0.0, maximum=1.0)

    def activation(self, count: int) -> Activation:
        """See the base."""
        shift = np.arange(count) / count

        def bursts(times: FloatArray) -> FloatArray:
            phase = (times[:, None] / self.period - shift) % 1.0
            swell = self.level * 0.5 * (1 - np.cos(2 * np.pi * phase / self.share))
            return np.asarray(np.where(phase < self.share, swell, 0.0))

        return bursts


@dataclass(frozen=True)
class Points(Program):
    """Rows of time and activation of all muscles, or of each; straight between them."""

    points: tuple[tuple[float, ...], ...] = listing(numbers(), default=(), unit="s, 1")

    def activation(self, count: int) -> Activation:
        """See the base."""
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
    """Activations of a simulated human, as he publishes them."""

    topic: str = text("hric/human/activation", empty=False)
    side: str = choice("right", "left", text="arm that wears the electrodes of the usual muscles")


PROGRAM: Any = variant(
    "program",
    {"bursts": Bursts, "constant": Constant, "points": Points, "topic": TopicActivation, "c3d": RecordedEmg},
    "bursts",
    {},
    default_text="`{program: bursts}`",
    text="`bursts` (`period` [s], `share`, `level`), `constant` (`level`), `points` (rows of time "
    '[s] and activation of all or of each), `topic` (`topic`, `side`): that of a simulated human, see "Muscles of a '
    'simulated human", `c3d`: EMG as it was recorded, see "A recorded trial"',
)
"""The parameter `activation`."""


BAND = (20.0, 450.0)
"""Of surface EMG [Hz] (textbook)."""
FLOOR = 2e-6
"""Noise of electrodes and amplifier, root mean square [V] (project default, unconfirmed)."""


class BodyActivation:
    """Activation of a simulated human's muscles, from messages; straight lines between them. One thread adds.

    An electrode of a usual muscle measures the mean of its parts (project default, unconfirmed: how much of each lies
    below it is not known); any other channel is a muscle of that name.

    Args:
        channels: names.
        side: of the usual ones.
    """

    def __init__(self, channels: Sequence[str], side: str) -> None:
        self._parts = [
            [f"{side}_{part}" for part in PARTS[channel]] if channel in PARTS else [channel] for channel in channels
        ]
        self._names: tuple[str, ...] | None = None
        self._columns: list[list[int]] = []
        self._track = Track(len(channels))

    @property
    def known(self) -> float:
        """Time of the last message [s]; before all times where there is none."""
        return self._track.last

    def at(self, times: FloatArray) -> FloatArray:
        """See Activation."""
        return self._track.at(times)

    def add(self, time: float, names: Sequence[str], activation: Sequence[float]) -> None:
        """One message; an earlier time begins again.

        Args:
            time: of robot [s].
            names: of muscles.
            activation: as many [1].

        Raises:
            CommandError: it lacks a muscle; once, since those that follow lack it, too.
        """
        if tuple(names) != self._names:
            self._names, self._columns = tuple(names), []
            self._columns = self._found(self._names)
        if self._columns:
            values = [sum(activation[column] for column in own) / len(own) for own in self._columns]
            self._track.add(time, np.array(values))

    def _found(self, names: tuple[str, ...]) -> list[list[int]]:
        """Columns of each channel's parts."""
        missing = sorted({part for own in self._parts for part in own} - set(names))
        if missing:
            raise CommandError(
                f"no activation of {', '.join(missing)}; there is one of {', '.join(names) or 'nothing'}"
            )
        return [[names.index(part) for part in own] for own in self._parts]


class Muscles:
    """A signal for `EvenSensor`: amplitude * activation * noise + floor.

    Args:
        activation: of each muscle.
        count: of muscles.
        rate: of samples [Hz]; the noise ends at 0.45 of it where it cannot hold the band.
        amplitude: root mean square at full activation [V].
        seed: of the noise.
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
        """[V]"""
        carrier, floor = self._carrier.values(first, len(times)), self._floor.values(first, len(times))
        return self._amplitude * np.clip(self._activation(times), 0.0, 1.0) * carrier + FLOOR * floor

    def _in_band(self, block: FloatArray) -> FloatArray:
        found, self._state = scipy.signal.sosfilt(self._sections, block, axis=0, zi=self._state)
        return np.asarray(self._gain * found)


def muscles(given: int | tuple[str, ...]) -> tuple[str, ...]:
    """Names of muscles: themselves, or so many of the usual ones. Raises ValueError."""
    if isinstance(given, int) and not 1 <= given <= len(MUSCLES):
        raise ValueError
    return MUSCLES[:given] if isinstance(given, int) else given


def muscle_names(said: str = "") -> Any:
    """A parameter with names of muscles, or how many of the usual ones."""
    kinds: Parameter = either(whole(), names(range(1, 65)), default=len(MUSCLES), made=muscles, text=said)
    kinds.accepts = f"1 to {len(MUSCLES)} of the usual muscles, or a list of up to 64 names, all different"
    return kinds
