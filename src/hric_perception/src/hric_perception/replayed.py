"""Signals of an emulated sensor: values received until now, or the samples of a recorded trial."""

import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from std_msgs.msg import Header

from hric_core.errors import HricError, ParameterError
from hric_core.node import Node
from hric_core.parameters import names, number, refused, whole
from hric_core.trial.c3d import TrialSettings
from hric_core.trial.plates import interpolated
from hric_perception.chunk import FloatArray

Row = TypeVar("Row")
HISTORY = 5.0
"""Time span of the received values that are stored [s] (project default, unconfirmed)."""
START_TOPIC = "hric/human/start"
"""Topic whose stamp is the robot time at which the emulated human's program begins."""
START_DELAY = 0.2
"""Delay of a replayed sample, so that it is known before whether the human had begun [s].

Project default, unconfirmed.
"""


class RecentRows(Generic[Row]):
    """History of rows (values at one time) of the last seconds, in the order of time; thread-safe.

    Args:
        span: time span of the rows that are stored [s].
    """

    def __init__(self, span: float = HISTORY) -> None:
        self._span, self._lock = span, threading.Lock()
        self._rows: deque[tuple[float, Row]] = deque()

    def store(self, time: float, row: Row) -> None:
        """Store a row at a time [s]; a time before the last row clears the history, an equal one replaces that row."""
        with self._lock:
            if self._rows and time < self._rows[-1][0]:
                self._rows.clear()
            elif self._rows and time == self._rows[-1][0]:
                self._rows.pop()
            self._rows.append((time, row))
            while self._rows[0][0] < time - self._span:
                self._rows.popleft()

    @property
    def known(self) -> float:
        """Time of the last row [s]; minus infinity if there is none."""
        with self._lock:
            return self._rows[-1][0] if self._rows else -math.inf

    def rows(self) -> list[tuple[float, Row]]:
        """Return (time [s], row) of all stored rows."""
        with self._lock:
            return list(self._rows)


class ValueTrack(RecentRows[FloatArray]):
    """History of values, shape (columns,), interpolated linearly; constant before the first and after the last.

    Args:
        count: number of columns. Without stored values, all are 0.
    """

    def __init__(self, count: int) -> None:
        super().__init__()
        self._count = count

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at times [s], shape (n, columns)."""
        if not (rows := self.rows()):
            return np.zeros((len(times), self._count))
        known, values = (np.array(part) for part in zip(*rows, strict=True))
        return np.column_stack([np.interp(times, known, values[:, column]) for column in range(self._count)])


class Replayed:
    """Samples of a recorded trial, replayed from a robot time on and interpolated linearly; unknown ones stay NaN.

    Args:
        samples: samples taken at k / rate, shape (n, channels).
        rate: sample rate [Hz].
        begin: robot time of the trial's first sample [s]; None: not known yet, see `start`.
        holds: True: the first and the last sample are held before and after the trial; False: zeros.
    """

    def __init__(self, samples: FloatArray, rate: float, begin: float | None, holds: bool) -> None:
        self._samples, self._rate, self._constant_ends = samples, rate, holds
        self._begin = math.inf if begin is None else begin

    @property
    def waits(self) -> bool:
        """True if the start time is not known yet."""
        return self._begin == math.inf

    def start(self, begin: float) -> None:
        """Set the robot time of the trial's first sample [s]."""
        self._begin = begin

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """Return the values at robot times, shape (n,) [s], as a signal of `EvenSensor`; `first` is not used."""
        return self.at(times)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at robot times, shape (n,) [s]: shape (n, channels)."""
        since = np.asarray(times) - self._begin
        replayed = interpolated(since, self._rate, self._samples)
        if not self._constant_ends:
            replayed[(since < 0) | (since * self._rate > len(self._samples) - 1)] = 0.0
        return replayed


def follow_human(node: Node, replayed: Replayed) -> float:
    """Let a trial without a start time begin when the emulated human's motion begins.

    Returns:
        delay with which samples must be sent, so that the human's start is known in time [s]; 0 with a start time.
    """
    if not replayed.waits:
        return 0.0
    node.subscribe(node.beside(START_TOPIC), Header, lambda message: replayed.start(message.stamp.to_sec()))
    return START_DELAY


@dataclass(frozen=True)
class RecordedEmg(TrialSettings):
    """Settings of the program `c3d` of emulated muscles: EMG of a recorded trial."""

    channels: tuple[str, ...] | None = names(None, None)
    begin: float | None = number(None, minimum=0.0, unit="s")

    def replayed(self, muscles: Sequence[str]) -> Replayed:
        """Return the recorded EMG [V], one channel per muscle, 0 before and after the trial. Raises ParameterError."""
        channels = self.channels or tuple(muscles)
        if len(channels) != len(muscles):
            raise refused(
                f"{self.prefix}channels", list(channels), f"{len(muscles)} names, one for each of {', '.join(muscles)}"
            )
        trial = self.trial()
        try:
            return Replayed(trial.volts(channels), trial.analog_rate, self.begin, holds=False)
        except HricError as error:
            raise ParameterError(f"{self.prefix}channels: {error}") from error


@dataclass(frozen=True)
class RecordedLoad(TrialSettings):
    """Settings of the program `c3d` of an emulated plate: load of a recorded trial."""

    plate: int = whole(1, minimum=0, maximum=1000)
    begin: float | None = number(None, minimum=0.0, unit="s")

    def replayed(self) -> Replayed:
        """Return the recorded load on a plate, in the plate's frame with z up [N, N m]. Raises ParameterError.

        Before and after the trial, the first and the last load are held.
        """
        trial = self.trial()
        try:
            plate = trial.plate(self.plate)
        except HricError as error:
            raise ParameterError(f"{self.prefix}plate: {error}") from error
        return Replayed(plate.load, plate.rate, self.begin, holds=True)
