"""Reader of a recorded trial from a c3d file: markers, analog channels and force plates.

It needs no ROS. The library ezc3d reads the file, in a separate process."""

import json
import os
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hric_core import parameters
from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.geometry import UP_AXES, FloatArray
from hric_core.geometry.transforms import vectors_z_up
from hric_core.trial.plates import Group, PlateError, TrialPlate, read_plates

PROGRAMS = ("c3d", "trc", "mot")
"""Values of the parameter `program` that replay a file: "c3d" for emulated sensors, all for a simulated human."""
METRES = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0}
"""Factors to metres, by the unit of length in a c3d file (parameter POINT:UNITS)."""
VOLTS = {"v": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "µv": 1e-6, "μv": 1e-6}
"""Factors to volts, by the unit of an analog channel in a c3d file (parameter ANALOG:UNITS), in lower case."""
PACKAGE = "package://"
READER = Path(__file__).with_name("c3d_child.py")
"""Script that reads a c3d file in a separate process."""
BLOCK = 512
"""Size of a block of a c3d file [byte]."""
MAGIC = 0x50
"""Second byte of every c3d file, by which the format is recognised."""
ORDERS = {84: "<", 85: "<", 86: ">"}
"""Byte order (format of `struct`) by the processor type in the parameter section: Intel, DEC, SGI."""
TIMEOUT = 60.0
"""Longest time to read a file [s] (project default, unconfirmed)."""


@dataclass(frozen=True)
class Trial:
    """Content of a c3d file. Axes are those of the laboratory, rotated to z up.

    Attributes:
        name: name of the file, for error messages.
        rate: frame rate [Hz].
        labels: names of the markers.
        positions: marker positions, shape (frames, markers, 3) [m]; NaN: not visible.
        analog_rate: rate of the analog samples [Hz], a whole multiple of `rate`; 0: there are none.
        channels: labels of the analog channels.
        units: unit of each channel, as in the file.
        analogs: analog samples, shape (samples, channels), each channel in its unit.
        plates: force plates.
        up: axis that points up in the file, "y" or "z".
        start: for a file exported from a run of HRIC, robot time of the first frame [s]; 0 for other files.
    """

    name: str
    rate: float
    labels: tuple[str, ...]
    positions: FloatArray
    analog_rate: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    analogs: FloatArray
    plates: tuple[TrialPlate, ...]
    up: str
    start: float = 0.0

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self.positions) - 1) / self.rate

    def markers(self, labels: Sequence[str]) -> FloatArray:
        """Return positions of some markers, shape (frames, len(labels), 3) [m]. Raises UnknownNameError."""
        if not self.labels:
            raise ParameterError(f"{self.name} has no markers")
        return np.stack(
            [self.positions[:, _index(label, self.labels, "marker", self.name)] for label in labels], axis=1
        )

    def volts(self, channels: Sequence[str]) -> FloatArray:
        """Return samples of some channels, shape (samples, len(channels)) [V].

        Raises:
            HricError: there is no such channel, or its unit is not a voltage.
        """
        if not self.channels:
            raise ParameterError(f"{self.name} has no analog channels")
        columns = []
        for channel in channels:
            index = _index(channel, self.channels, "analog channel", self.name)
            factor = VOLTS.get(self.units[index].lower())
            if factor is None:
                raise ParameterError(
                    f"channel {channel} of {self.name} is in {self.units[index] or 'no unit'!r}; valid: V, mV, uV"
                )
            columns.append(self.analogs[:, index] * factor)
        return np.column_stack(columns)

    def plate(self, number: int) -> TrialPlate:
        """Return a force plate by its number in the file, from 1 on. Raises ParameterError."""
        if not 1 <= number <= len(self.plates):
            numbers = ", ".join(map(str, range(1, len(self.plates) + 1)))
            raise ParameterError(
                f"{self.name} has no force plate {number}; valid: {numbers or 'none, the file has no force plates'}"
            )
        return self.plates[number - 1]


def resolve(address: str) -> Path:
    """Return the absolute path of a path or package:// address. Raises ParameterError if there is no such package."""
    if not address.startswith(PACKAGE):
        return Path(address).expanduser().absolute()
    import rospkg

    package, _, rest = address.removeprefix(PACKAGE).partition("/")
    try:
        return Path(rospkg.RosPack().get_path(package)) / rest
    except rospkg.ResourceNotFound as error:
        raise ParameterError(f"{address}: there is no ROS package {package!r}") from error


def located(tree: Any, folder: Path) -> Any:
    """Return settings with absolute `path`s wherever a `program` replays a file; `folder`: base of relative paths."""
    if not isinstance(tree, Mapping):
        return tree
    absolute = {key: located(value, folder) for key, value in tree.items()}
    path = absolute.get("path")
    if absolute.get("program") in PROGRAMS and isinstance(path, str) and path and not path.startswith(PACKAGE):
        absolute["path"] = str((folder / Path(path).expanduser()).absolute())
    return absolute


def read_trial(path: Path, up: str = "") -> Trial:
    """Read a c3d file.

    Args:
        path: path of the file.
        up: vertical axis in the file, y or z; empty: that of the parameter POINT:Y_SCREEN, or z without it, as is usual
            in laboratories.

    Raises:
        HricError: the file cannot be read, or its content is not valid; the message is one line.
    """
    if up and up not in UP_AXES:
        raise ParameterError(f"the axis that points up in {path.name} is {up!r}; valid: {', '.join(UP_AXES)}")
    try:
        about = path.stat()
    except OSError as error:
        raise ParameterError(f"c3d file {path}: {error.strerror}") from error
    return _read(path, up, about.st_mtime_ns, about.st_size)


@dataclass(frozen=True)
class TrialSettings(parameters.Settings):
    """Parameters that select a recorded trial: file and vertical axis."""

    path: str = parameters.text(valid="a c3d file, path or package:// address,", empty=False)
    up: str = parameters.text("", text="axis that points up in the file, y or z; empty: as in the file")

    def trial(self) -> Trial:
        """Read the selected trial. Raises ParameterError if the file cannot be read or is not valid."""
        try:
            return read_trial(resolve(self.path), self.up)
        except HricError as error:
            raise ParameterError(f"{self.prefix}path: {error}") from error


@lru_cache(maxsize=4)  # one file is read several times: before the run, and for markers, plates and EMG
def _read(path: Path, up: str, modified: int, size: int) -> Trial:
    _check_size(path, size)
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "trial.npz"
        words = [sys.executable, os.fspath(READER), os.fspath(path), os.fspath(output)]
        try:  # in a session of its own: otherwise Ctrl-C in the terminal would look like a damaged file
            done = subprocess.run(
                words, capture_output=True, text=True, timeout=TIMEOUT, check=False, start_new_session=True
            )
        except subprocess.TimeoutExpired as error:
            raise ParameterError(f"c3d file {path} cannot be read: it takes longer than {TIMEOUT:g} s") from error
        if done.returncode:
            reason = done.stderr.strip().splitlines()[-1:] if done.returncode > 0 else ["it is damaged"]
            raise ParameterError(f"c3d file {path} cannot be read: {' '.join(reason) or 'it is damaged'}")
        with np.load(output) as arrays:
            parameters = json.loads(str(arrays["parameters"]))
            return _trial(path, up, parameters, arrays["points"], arrays["residuals"], arrays["analogs"])


def _check_size(path: Path, size: int) -> None:
    """Check that the numbers of frames and channels in the header fit the size [byte] of the file."""
    try:
        with path.open("rb") as file:
            head = file.read(BLOCK)
            file.seek(max(0, (head[0] if head else 1) - 1) * BLOCK)
            parameters = file.read(4)
    except OSError as error:
        raise ParameterError(f"c3d file {path}: {error.strerror}") from error
    if len(head) < BLOCK or head[1] != MAGIC or len(parameters) < 4 or parameters[3] not in ORDERS:
        raise ParameterError(f"{path} is not a c3d file")
    order = ORDERS[parameters[3]]
    points, analogs, first, last = struct.unpack_from(f"{order}4H", head, 2)
    (start,) = struct.unpack_from(f"{order}H", head, 16)
    (scale_high,) = struct.unpack_from(f"{order}H", head, 14 if parameters[3] == 84 else 12)
    width = 4 if scale_high & 0x8000 else 2  # a negative scale means floating point
    frames = last - first + 1
    needed = (start - 1) * BLOCK + frames * (4 * points + analogs) * width
    if frames < 1 or start < 2 or needed > size:
        raise ParameterError(
            f"c3d file {path} is damaged: {frames} frames by its header need {needed} bytes, and the file has {size}"
        )


def _trial(
    path: Path, up: str, parameters: Mapping[str, Group], points: FloatArray, residuals: FloatArray, analogs: FloatArray
) -> Trial:
    """Check the raw content of a c3d file and return it in metres and with z up."""
    name, point, analog = path.name, parameters.get("POINT", {}), parameters.get("ANALOG", {})
    rate = _first(point, "RATE")
    if not (np.isfinite(rate) and rate > 0) or not points.shape[2] + analogs.shape[1]:
        raise ParameterError(
            f"c3d file {path} has {points.shape[2]} frames at {rate:g} Hz; valid: one frame or more, a rate above 0"
        )
    if points.shape[1]:
        unit = str(_texts(point, "UNITS", 1)[0]).strip().lower() or "mm"
        if unit not in METRES:
            raise ParameterError(f"c3d file {path} has points in {unit!r}; valid: {', '.join(METRES)}")
    metres = METRES[unit] if points.shape[1] else METRES["mm"]
    up = up or _up(point)
    positions = np.moveaxis(points, 2, 0).transpose(0, 2, 1) * metres
    positions[(residuals.T < 0) | ~np.isfinite(positions).all(axis=2)] = np.nan
    analog_rate = _first(analog, "RATE") if len(analogs) else 0.0
    if len(analogs) and abs(analog_rate - rate * max(1, round(analog_rate / rate))) > 1e-3 * rate:
        raise ParameterError(
            f"c3d file {path} has analog samples at {analog_rate:g} Hz; valid: a whole multiple of {rate:g} Hz, "
            "that of its frames"
        )
    labels, channels = _labels(point, "LABELS", points.shape[1]), _labels(analog, "LABELS", len(analogs))
    units = tuple(str(text).strip() for text in _texts(analog, "UNITS", len(analogs)))
    start = _first(parameters.get("HRIC", {}), "START_TIME")
    try:
        plates = read_plates(parameters.get("FORCE_PLATFORM", {}), analogs, units, analog_rate, metres, up)
    except PlateError as error:
        raise ParameterError(f"c3d file {path}: {error}") from error
    return Trial(
        name,
        rate,
        labels,
        vectors_z_up(up, positions),
        analog_rate,
        channels,
        units,
        analogs.T.copy(),
        plates,
        up,
        start if np.isfinite(start) else 0.0,
    )


def _up(point: Group) -> str:
    """Return the vertical axis, "y" or "z", by the parameter POINT:Y_SCREEN, the axis that is drawn upwards."""
    screen = str((point.get("Y_SCREEN") or [""])[0]).strip().upper()
    return "y" if screen.endswith("Y") else "z"


def _first(group: Group, name: str) -> float:
    values = np.ravel(group.get(name, [np.nan]))
    return float(values[0]) if len(values) else float("nan")


def _texts(group: Group, name: str, count: int) -> list[str]:
    """Return the first `count` texts of a parameter that continues in NAME2, NAME3, ...; missing texts are empty."""
    texts = [text for key in (name, *(f"{name}{k}" for k in range(2, 100))) for text in group.get(key, [])]
    return (texts + [""] * count)[:count]


def _labels(group: Group, name: str, count: int) -> tuple[str, ...]:
    """Return unique labels: a duplicate gets its number appended, a missing label becomes "*number"."""
    labels: list[str] = []
    for number, text in enumerate(_texts(group, name, count), 1):
        label = text.strip() or f"*{number}"
        labels.append(label if label not in labels else f"{label}_{number}")
    return tuple(labels)


def _index(label: str, labels: Sequence[str], what: str, where: str) -> int:
    if label not in labels:
        raise UnknownNameError(what, label, labels, where)
    return labels.index(label)
