"""An emulated sensor that samples evenly: which samples are due, and what goes wrong with them. No ROS, no transport."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hric_control.errors import ParameterError
from hric_perception.chunk import FloatArray
from hric_perception.section import Section

BLOCK = 256
"""Samples per block of random numbers, so that they do not depend on when samples are fetched."""
LATE = 1.0
"""A sensor that is this far behind goes on from now [s] (our choice)."""
FAULT_KEYS = ("noise", "bias", "delay", "dropouts", "dropout_rate", "dropout_length", "no_numbers", "time_code")


@dataclass(frozen=True)
class Faults:
    """What is wrong with the samples; all of it repeats with the seed.

    Args:
        noise: white, standard deviation [unit of the channel].
        bias: added [unit of the channel].
        delay: from a sample to its sending, beside the time stamp [s].
        dropouts: (begin, duration) [s of run time] in which nothing is sent; the numbers of the samples go on.
        dropout_rate: random ones per second [1/s].
        dropout_length: their mean duration [s].
        no_numbers: (begin, duration) [s of run time] in which the first channel is NaN.
        time_code: whether one channel tells the run time of its sample [s].
        seed: of all that is random.
    """

    noise: float = 0.0
    bias: float = 0.0
    delay: float = 0.0
    dropouts: tuple[tuple[float, float], ...] = ()
    dropout_rate: float = 0.0
    dropout_length: float = 0.05
    no_numbers: tuple[tuple[float, float], ...] = ()
    time_code: bool = False
    seed: int = 0


def read_faults(section: Section, seed: int) -> Faults:
    """The faults of a mapping. Raises HricError."""
    section.only(*FAULT_KEYS)
    time_code = section.content.get("time_code", False)
    if not isinstance(time_code, bool):
        raise ParameterError(f"{section.where}.time_code is {time_code!r}; valid: true or false")
    return Faults(
        noise=section.number("noise", 0.0, 0.0),
        bias=section.number("bias", 0.0),
        delay=section.number("delay", 0.0, 0.0, 5.0),
        dropouts=tuple((row[0], row[1]) for row in section.rows("dropouts", 2)),
        dropout_rate=section.number("dropout_rate", 0.0, 0.0, 100.0),
        dropout_length=section.number("dropout_length", 0.05, 0.0, 60.0),
        no_numbers=tuple((row[0], row[1]) for row in section.rows("no_numbers", 2)),
        time_code=time_code,
        seed=seed,
    )


class Samples(NamedTuple):
    """Consecutive samples that are due.

    Attributes:
        times: of run, shape (n,) [s].
        data: shape (n, channels).
    """

    times: FloatArray
    data: FloatArray


Signal = Callable[[int, FloatArray], FloatArray]
"""(number of the first sample, run times shape (n,) [s]) -> values, shape (n, channels); called with rising times."""


class EvenSensor:
    """Sample k is taken at the run time k / rate.

    Args:
        rate: [Hz].
        channels: of the signal; the time code comes behind.
        signal: what it measures.
        faults: what goes wrong.

    Attributes:
        sent, dropped: samples that were due, and went or did not go.
    """

    def __init__(self, rate: float, channels: int, signal: Signal, faults: Faults) -> None:
        self.rate, self.faults, self._signal = rate, faults, signal
        self.sent = self.dropped = 0
        self._next: int | None = None
        self._noise = BlockNoise(channels, faults.seed)
        self._random = Outages(faults.dropout_rate, faults.dropout_length, faults.seed)

    @property
    def following(self) -> int:
        """Number of the next sample; 0: none was due yet."""
        return self._next or 0

    def due(self, now: float) -> list[Samples]:
        """What is to be sent at a run time [s]: consecutive samples, a drop-out between them.

        The first call begins; one that is earlier by LATE, in a run that began anew, begins again.
        """
        last = math.floor((now - self.faults.delay) * self.rate + 1e-6)
        if self._next is None or abs(last - self._next) > LATE * self.rate:
            self._next = max(0, last + 1)
        if last < self._next:
            return []
        numbers = np.arange(self._next, last + 1)
        self._next = last + 1
        times = numbers / self.rate
        kept = ~self._out(times)
        self.sent, self.dropped = self.sent + int(kept.sum()), self.dropped + int((~kept).sum())
        data = self._values(numbers, times)
        edges = (np.flatnonzero(np.diff(kept)) + 1).tolist()
        parts = zip([0, *edges], [*edges, len(numbers)], strict=True)
        return [Samples(times[a:b], data[a:b]) for a, b in parts if kept[a]]

    def _values(self, numbers: NDArray[np.int64], times: FloatArray) -> FloatArray:
        faults = self.faults
        data = self._signal(int(numbers[0]), times) + faults.bias
        if faults.noise:
            data += faults.noise * self._noise.values(int(numbers[0]), len(numbers))
        data[_within(times, faults.no_numbers), 0] = np.nan
        return np.column_stack([data, times]) if faults.time_code else data

    def _out(self, times: FloatArray) -> NDArray[np.bool_]:
        return _within(times, self.faults.dropouts) | self._random.at(times)


class BlockNoise:
    """White noise of standard deviation 1 that depends on the seed and the number of a sample alone.

    Args:
        channels: columns.
        seed: and which of its streams.
        shape_block: what becomes of a block, called in their order from wherever the first one asked for lies; None: nothing.
    """

    def __init__(self, channels: int, seed: int, stream: int = 1, shape_block: Callable[[FloatArray], FloatArray] | None = None) -> None:
        self._channels, self._key, self._shape = channels, (seed, stream), shape_block
        self._blocks: dict[int, FloatArray] = {}

    def values(self, first: int, count: int) -> FloatArray:
        """Those of the samples from `first` on, shape (count, channels); `first` may not fall by more than a block."""
        begin, end = first // BLOCK, (first + count - 1) // BLOCK
        for index in range(begin, end + 1):
            if index not in self._blocks:
                block = np.random.default_rng((*self._key, index)).standard_normal((BLOCK, self._channels))
                self._blocks[index] = block if self._shape is None else self._shape(block)
        self._blocks = {index: block for index, block in self._blocks.items() if index >= begin}
        data = np.concatenate([self._blocks[index] for index in range(begin, end + 1)])
        return data[first - begin * BLOCK : first - begin * BLOCK + count]


class Outages:
    """Random ones, drawn as time goes on.

    Args:
        rate: [1/s].
        length: mean duration [s].
        seed: of both.
    """

    def __init__(self, rate: float, length: float, seed: int) -> None:
        self._rate, self._length, self._random = rate, length, np.random.default_rng((seed, 2))
        self._spans: list[tuple[float, float]] = []
        self._until = 0.0

    def at(self, times: FloatArray) -> NDArray[np.bool_]:
        """Whether one is going on at each time [s]."""
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
