"""Emulated, evenly sampled sensor: samples that are due, their faults, and the thread that sends them.

No ROS, no transport.
"""

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hric_core.parameters import Settings, flag, listing, number, numbers, whole
from hric_core.robot_time.stream_time import Clock
from hric_perception.chunk import FloatArray
from hric_perception.stream import Driver

NOISE_BLOCK = 256
"""Number of samples whose noise is drawn at once; fixed, so that noise does not depend on when samples are fetched."""
LATE = 1.0
"""Delay beyond which an emulated sensor skips samples and continues with the current one [s].

Project default, unconfirmed.
"""
NS = 1e-9
PERIOD = 0.01
"""Default time between two sendings of an emulated sensor [s of wall time] (project default, unconfirmed)."""
SEED: Any = whole(0, minimum=0, name="seed", text="seed of all randomness")
BLOCK: Any = number(PERIOD, minimum=0.001, maximum=1.0, unit="s", name="block", text="wall time between two sendings")


@dataclass(frozen=True)
class Faults(Settings):
    """Faults that an emulated sensor adds to its samples; equal for equal seeds."""

    noise: float = number(0.0, minimum=0.0, unit="unit of the channel", text="standard deviation of white noise")
    bias: float = number(0.0, unit="unit of the channel", text="constant that is added")
    delay: float = number(
        0.0,
        minimum=0.0,
        maximum=5.0,
        unit="s",
        text="time from a sample to its sending, which the time stamp does not include",
    )
    dropouts: tuple[tuple[float, float], ...] = listing(
        numbers(2),
        default=(),
        unit="s of robot time",
        text="begin and duration of times in which nothing is sent, while sequence numbers continue",
    )
    dropout_rate: float = number(0.0, minimum=0.0, maximum=100.0, unit="1/s", text="rate of random drop-outs")
    dropout_length: float = number(0.05, minimum=0.0, maximum=60.0, unit="s", text="mean duration of random drop-outs")
    not_finite: tuple[tuple[float, float], ...] = listing(
        numbers(2),
        default=(),
        name="no_numbers",
        unit="s of robot time",
        text="begin and duration of times in which the first channel is NaN",
    )
    time_code: bool = flag(False, text="send the robot time of each sample in a further channel [s]")
    seed: int = 0


def faults_of(settings: Mapping[str, object], where: str, seed: int, delay: float = 0.0) -> Faults:
    """Return the faults in the mapping `settings`; delay: default of the key `delay` [s]. Raises ParameterError."""
    return replace(Faults.of({"delay": delay, **settings}, where), seed=seed)


class Samples(NamedTuple):
    """Consecutive samples of an emulated sensor that are due.

    Attributes:
        times: robot times, shape (n,) [s].
        data: values, shape (n, channels).
    """

    times: FloatArray
    data: FloatArray


Signal = Callable[[int, FloatArray], FloatArray]
"""Measured signal: (number of the first sample, robot times, shape (n,) [s]) -> values, shape (n, channels).

It is called with increasing times.
"""


class EvenSensor:
    """Emulated sensor whose sample k is taken at robot time k / rate.

    Args:
        rate: sample rate [Hz].
        channels: number of channels of the signal; a time code is appended as a further one.
        signal: measured signal.
        faults: faults of the samples.

    Attributes:
        sent, dropped: numbers of samples so far that were sent, and that were lost in drop-outs.
    """

    def __init__(self, rate: float, channels: int, signal: Signal, faults: Faults) -> None:
        self.rate, self.faults, self._signal = rate, faults, signal
        self.sent = self.dropped = 0
        self._next: int | None = None
        self._noise = BlockNoise(channels, faults.seed)
        self._random = Outages(faults.dropout_rate, faults.dropout_length, faults.seed)

    @property
    def following(self) -> int:
        """Sequence number of the next sample; 0: none was due yet."""
        return self._next or 0

    def due(self, now: float) -> list[Samples]:
        """Return the samples to be sent at a robot time [s]: consecutive samples, split at drop-outs.

        The first call starts the sensor. A jump by more than LATE, such as back in a restarted run, restarts it.
        """
        last = math.floor((now - self.faults.delay) * self.rate + 1e-6)
        if self._next is None or abs(last - self._next) > LATE * self.rate:
            self._next = max(0, last + 1)
        if last < self._next:
            return []
        numbers = np.arange(self._next, last + 1)
        self._next = last + 1
        times = numbers / self.rate
        present = ~(_within(times, self.faults.dropouts) | self._random.at(times))
        self.sent, self.dropped = self.sent + int(present.sum()), self.dropped + int((~present).sum())
        data = self._values(numbers, times)
        edges = (np.flatnonzero(np.diff(present)) + 1).tolist()
        parts = zip([0, *edges], [*edges, len(numbers)], strict=True)
        return [Samples(times[a:b], data[a:b]) for a, b in parts if present[a]]

    def _values(self, numbers: NDArray[np.int64], times: FloatArray) -> FloatArray:
        faults = self.faults
        data = self._signal(int(numbers[0]), times) + faults.bias
        if faults.noise:
            data += faults.noise * self._noise.values(int(numbers[0]), len(numbers))
        data[_within(times, faults.not_finite), 0] = np.nan
        return np.column_stack([data, times]) if faults.time_code else data


class BlockNoise:
    """White noise of standard deviation 1 that depends only on the seed and the number of a sample.

    Args:
        channels: number of columns.
        seed: seed of the random numbers.
        stream: index that makes several noises with one seed independent.
        shape_block: filter of a block, shape (NOISE_BLOCK, channels); called in the order of the blocks, from the first
            one requested; None: no filter.
    """

    def __init__(
        self, channels: int, seed: int, stream: int = 1, shape_block: Callable[[FloatArray], FloatArray] | None = None
    ) -> None:
        self._channels, self._key, self._shape = channels, (seed, stream), shape_block
        self._blocks: dict[int, FloatArray] = {}

    def values(self, first: int, count: int) -> FloatArray:
        """Return the noise of samples from `first` on, shape (count, channels); with a filter, in increasing order."""
        begin, end = first // NOISE_BLOCK, (first + count - 1) // NOISE_BLOCK
        for index in range(begin, end + 1):
            if index not in self._blocks:
                block = np.random.default_rng((*self._key, index)).standard_normal((NOISE_BLOCK, self._channels))
                self._blocks[index] = block if self._shape is None else self._shape(block)
        self._blocks = {index: block for index, block in self._blocks.items() if index >= begin}
        data = np.concatenate([self._blocks[index] for index in range(begin, end + 1)])
        offset = first - begin * NOISE_BLOCK
        return data[offset : offset + count]


class Outages:
    """Random outages of an emulated sensor, drawn as time advances; intervals and lengths are exponential.

    Args:
        rate: mean number of outages per second [1/s].
        length: mean duration of an outage [s].
        seed: seed of the random numbers.
    """

    def __init__(self, rate: float, length: float, seed: int) -> None:
        self._rate, self._length, self._random = rate, length, np.random.default_rng((seed, 2))
        self._spans: list[tuple[float, float]] = []
        self._until = 0.0

    def at(self, times: FloatArray) -> NDArray[np.bool_]:
        """Return True for each robot time within an outage; times: shape (n,) [s]."""
        if self._rate <= 0:
            return np.zeros(len(times), dtype=bool)
        while self._until <= times[-1]:
            begin = self._until + self._random.exponential(1 / self._rate)
            self._until = begin + self._random.exponential(self._length)
            self._spans.append((begin, self._until - begin))
        first = max(0, bisect_right(self._spans, (float(times[0]), math.inf)) - 1)
        return _within(times, self._spans[first:])


def _within(times: FloatArray, spans: tuple[tuple[float, float], ...] | list[tuple[float, float]]) -> NDArray[np.bool_]:
    inside = np.zeros(len(times), dtype=bool)
    for begin, duration in spans:
        inside |= (times >= begin) & (times < begin + duration)
    return inside


class Outlet(Protocol):
    """Interface of a sender or receiver of an emulated sensor's samples, such as an LSL outlet."""

    def push(self, times: FloatArray, data: FloatArray) -> None:
        """Send samples; times: stamps by the monotonic clock, shape (n,) [s]; data: values, shape (n, channels)."""

    def close(self) -> None:
        """Stop sending."""


class Emulator(Driver):
    """Thread that sends the samples of an emulated sensor from `start` to `close`; a caller may use `step` instead.

    Args:
        sensor: emulated sensor.
        outlet: receiver of the samples.
        clock: clock of the sensor: a `RobotTime`, or a wall clock.
        period: time between sendings [s of wall time].
        on_error: called once with the reason when sending fails.
        on_sent: called after each sending with (number of the next sample, samples sent so far, robot time of the last
            one [s]).
        on_reached: called after each sending with the clock time up to which all samples are sent [s].
    """

    def __init__(
        self,
        sensor: EvenSensor,
        outlet: Outlet,
        clock: Clock,
        period: float = PERIOD,
        on_error: Callable[[str], None] = lambda text: None,
        on_sent: Callable[[int, int, float], None] = lambda following, sent, last: None,
        on_reached: Callable[[float], None] = lambda now: None,
    ) -> None:
        super().__init__("emulated sensor")
        self._sensor, self._outlet, self._clock, self._period, self._on_error = sensor, outlet, clock, period, on_error
        self._on_sent, self._on_reached = on_sent, on_reached

    def close(self) -> None:
        """Stop the thread, and close the outlet."""
        super().close()
        self._outlet.close()

    def step(self) -> None:
        """Send the samples that are due. Raises OSError."""
        now = self._clock.now()
        if now is None:
            return
        for samples in self._sensor.due(now):
            first, last = (self._clock.monotonic(float(samples.times[index])) for index in (0, -1))
            if first is not None and last is not None:
                self._outlet.push(np.linspace(first * NS, last * NS, len(samples.times)), samples.data)
        sensor = self._sensor
        self._on_sent(sensor.following, sensor.sent, (sensor.following - 1) / sensor.rate)
        self._on_reached(now)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.wait(max(0.0, due - time.monotonic())):
            due = max(due + self._period, time.monotonic())
            try:
                self.step()
            except OSError as error:
                self._on_error(str(error))
                return
