"""Samples of a recorded trial as what an emulated sensor measures. No ROS."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hric_control.errors import HricError, ParameterError
from hric_perception.chunk import FloatArray
from hric_perception.section import Section
from mocap_natnet.trial import Trial, read_trial, resolve
from mocap_natnet.trial_plates import interpolated

START_TOPIC = "/hric/human/start"
"""Tells by its stamp the run time at which the emulated human's program begins."""
START_DELAY = 0.2
"""So long after a sample was taken it is known whether the human had begun [s] (default chosen by this project, unconfirmed)."""
KEYS = ("program", "path", "begin")
"""Of each mapping that replays a trial."""


class Replayed:
    """Samples of a trial, replayed from a run time on, on straight lines between them.

    Args:
        samples: taken at k / rate, shape (n, channels).
        rate: [Hz].
        begin: run time of the trial's first sample [s]; None: not known yet, see `start`.
        holds: whether the first and the last sample stay before and after the trial; else nothing is there but zeros.
    """

    def __init__(self, samples: FloatArray, rate: float, begin: float | None, holds: bool) -> None:
        self._samples, self._rate, self._holds = samples, rate, holds
        self._begin = math.inf if begin is None else begin

    @property
    def waits(self) -> bool:
        """Whether the beginning is not known."""
        return self._begin == math.inf

    def start(self, begin: float) -> None:
        """The trial begins at a run time [s]."""
        self._begin = begin

    def __call__(self, first: int, times: FloatArray) -> FloatArray:
        """The same as a signal of `EvenSensor`."""
        return self.at(times)

    def at(self, times: FloatArray) -> FloatArray:
        """Shape (channels,) for each run time, shape (n,) [s]."""
        since = np.asarray(times) - self._begin
        found = interpolated(since, self._rate, self._samples)
        if not self._holds:
            found[(since < 0) | (since * self._rate > len(self._samples) - 1)] = 0.0
        return found


def read_file(section: Section) -> Trial:
    """The trial that a mapping names: `path`, `up`. Raises HricError."""
    if not section.text("path"):
        raise ParameterError(f"{section.where}.path is not given; valid: a c3d file, path or package:// address")
    try:
        return read_trial(resolve(section.text("path")), section.text("up"))
    except HricError as error:
        raise ParameterError(f"{section.where}: {error}") from error


def read_emg(section: Section, names: Sequence[str]) -> Replayed:
    """Channels of EMG [V], silent before and after the trial.

    Args:
        section: `path`, `channels`: of the file, one for each of `names`; not given: those of the same names; `begin`: run time [s].
        names: of the muscles.

    Raises:
        HricError: a value that cannot be.
    """
    section.only(*KEYS, "channels")
    trial = read_file(section)
    channels = section.texts("channels") if "channels" in section.content else list(names)
    if len(channels) != len(names):
        raise ParameterError(f"{section.where}.channels has {len(channels)} names; valid: {len(names)}, one for each of {', '.join(names)}")
    try:
        return Replayed(np.nan_to_num(trial.volts(channels)), trial.analog_rate, _begin(section), holds=False)
    except HricError as error:
        raise ParameterError(f"{section.where}.channels: {error}") from error


def read_load(section: Section) -> Replayed:
    """What pressed on a plate of a trial, in its frame with z up [N, N m]; the first and last load stay.

    Args:
        section: `path`, `plate`: its number in the file (1), `up`, `begin`: run time [s].

    Raises:
        HricError: a value that cannot be.
    """
    section.only(*KEYS, "plate", "up")
    trial, number = read_file(section), section.whole("plate", 1, 0, 1000)
    try:
        plate = trial.plate(number)
    except HricError as error:
        raise ParameterError(f"{section.where}.plate: {error}") from error
    return Replayed(np.nan_to_num(plate.load), plate.rate, _begin(section), holds=True)


def _begin(section: Section) -> float | None:
    return section.number("begin", 0.0, 0.0) if "begin" in section.content else None
