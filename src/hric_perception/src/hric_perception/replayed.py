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
"""Time span of the rows that are stored [s] (project default, unconfirmed)."""
START_TOPIC = "hric/human/start"
"""Topic whose stamp is the robot time at which the emulated human's program begins."""
START_DELAY = 0.2
"""Delay after which it is known if the human had begun at a sample [s] (project default, unconfirmed)."""


class RecentRows(Generic[Row]):
    """Rows at increasing times, of the last seconds; thread-safe.

    Args:
        span: time span of the rows that are stored [s].
    """

    def __init__(self, span: float = HISTORY) -> None:
        self._span, self._lock = span, threading.Lock()
        self._rows: deque[tuple[float, Row]] = deque()

    def store(self, time: float, row: Row) -> None:
        """Store a row at a time [s]; an earlier time restarts the history, the same one replaces."""
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
        """Return time [s] and row of all."""
        with self._lock:
            return list(self._rows)


class ValueTrack(RecentRows[FloatArray]):
    """Values at increasing times, shape (columns,) each, linear in between, constant before and after.

    Args:
        count: number of columns; all 0 before the first values.
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
    """Samples of a trial, replayed from a robot time on, linear in between.

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
        """Start the trial at a robot time [s]."""
        self._begin = begin

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """Return the values as a signal of `EvenSensor`."""
        return self.at(times)

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at robot times, shape (n,) [s]: shape (n, channels)."""
        since = np.asarray(times) - self._begin
        replayed = interpolated(since, self._rate, self._samples)
        if not self._constant_ends:
            replayed[(since < 0) | (since * self._rate > len(self._samples) - 1)] = 0.0
        return replayed


def follow_human(node: Node, replayed: Replayed) -> float:
    """Start a trial without a start time together with the emulated human.

    Returns:
        delay of its samples, until it is certain that the human had not begun [s].
    """
    if not replayed.waits:
        return 0.0
    node.subscribe(node.beside(START_TOPIC), Header, lambda message: replayed.start(message.stamp.to_sec()))
    return START_DELAY


@dataclass(frozen=True)
class RecordedEmg(TrialSettings):
    """Program c3d of emulated muscles."""

    channels: tuple[str, ...] | None = names(None, None)
    begin: float | None = number(None, minimum=0.0, unit="s")

    def replayed(self, muscles: Sequence[str]) -> Replayed:
        """Return EMG channels [V], silent before and after the trial, one per muscle. Raises ParameterError."""
        channels = self.channels or tuple(muscles)
        if len(channels) != len(muscles):
            raise refused(
                f"{self.prefix}channels", list(channels), f"{len(muscles)} names, one for each of {', '.join(muscles)}"
            )
        trial = self.trial()
        try:
            return Replayed(np.nan_to_num(trial.volts(channels)), trial.analog_rate, self.begin, holds=False)
        except HricError as error:
            raise ParameterError(f"{self.prefix}channels: {error}") from error


@dataclass(frozen=True)
class RecordedLoad(TrialSettings):
    """Program c3d of an emulated plate."""

    plate: int = whole(1, minimum=0, maximum=1000)
    begin: float | None = number(None, minimum=0.0, unit="s")

    def replayed(self) -> Replayed:
        """Return the load on a plate of a trial, in its frame with z up [N, N m]. Raises ParameterError.

        The first and last load are held.
        """
        trial = self.trial()
        try:
            plate = trial.plate(self.plate)
        except HricError as error:
            raise ParameterError(f"{self.prefix}plate: {error}") from error
        return Replayed(np.nan_to_num(plate.load), plate.rate, self.begin, holds=True)
