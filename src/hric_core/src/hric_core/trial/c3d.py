"""Reader of a recorded trial from a c3d file: markers, analog channels and force plates.

It needs no ROS.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from hric_core import parameters
from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.geometry import UP_AXES, FloatArray
from hric_core.geometry.transforms import vectors_z_up
from hric_core.trial.c3d_file import C3dContent, continued, read_content
from hric_core.trial.events import TrialEvent, read_events
from hric_core.trial.plates import METRES, Group, PlateReader, TrialPlate, first_number, numbers

PROGRAMS = ("c3d", "trc", "mot")
"""Values of the parameter `program` that replay a file: "c3d" for emulated sensors, all for a simulated human."""
TRAJECTORY = "trajectory_file"
"""Key in an experiment that names the file with joint positions which a robot replays."""
VOLTS = {"v": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "µv": 1e-6, "μv": 1e-6}
"""Factors to volts, by the unit of an analog channel in a c3d file (parameter ANALOG:UNITS), in lower case."""
WIDTH = "_width"
"""Ending of the keys of joint widths in MEASURES."""
MEASURES = (
    ("height", ("height",), (1.2, 2.2), (1e-3, 1e-2, 1.0), "m"),
    ("mass", ("bodymass", "mass", "weight"), (30.0, 200.0), (1.0,), "kg"),
    *(
        (f"{side}_{joint}{WIDTH}", (f"{side[0]}{joint}width",), (0.025, 0.2), (1e-3, 1e-2, 1.0), "m")
        for side in ("right", "left")
        for joint in ("knee", "ankle", "elbow", "wrist")
    ),
)
"""Measures of the subject: key, names of the c3d parameter in lower case, valid range, factors to try, unit.

A factor converts a possible unit of the file to the unit given.

The ranges are a project default, unconfirmed."""
PACKAGE = "package://"
ANALOG = "analog"
"""Key of the analog data in `Trial.reasons`."""
ANGLES = "Angles"
"""Ending of the names of joint angles that Vicon's Plug-in Gait and similar software write beside the markers."""
FASTEST = 1e4
"""Largest rate of the frames of a trial [Hz], beyond that of any camera (project default, unconfirmed)."""
CUT = 4
"""Number of characters to which some exporters cut the unit of length, as "mete"."""
BLANKS = " \t\r\n\0"
"""Characters with which exporters fill up texts."""
LOG = logging.getLogger("hric.core.trial")


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
        plates: force plates by number in the file, from 1 on.
        up: axis that points up in the file, "y" or "z".
        up_known: True if `up` is stated by the file or was given; False: z was assumed.
        subject: height [m] and mass [kg] of the subject, and widths of joints such as `right_knee_width` [m], where the
            file has them.
        reasons: sentences about parts of the file that are left out, by part: the number of a force plate, or a name.
        start: for a file exported from a run of HRIC, robot time of the first frame [s]; 0 for other files.
        angles: joint angles that the laboratory's software computed, by name without prefix, shape (frames, 3) each
            [deg]; NaN: not known.
        events: events in the file, in the order of time.
        length: unit of length in the file, e.g. "mm".
    """

    name: str
    rate: float
    labels: tuple[str, ...]
    positions: FloatArray
    analog_rate: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    analogs: FloatArray
    plates: Mapping[int, TrialPlate]
    up: str
    up_known: bool = True
    subject: Mapping[str, float] = field(default_factory=dict)
    reasons: Mapping[int | str, str] = field(default_factory=dict)
    start: float = 0.0
    angles: Mapping[str, FloatArray] = field(default_factory=dict)
    events: tuple[TrialEvent, ...] = ()
    length: str = "mm"

    def __post_init__(self) -> None:
        if not 0.0 < self.rate <= FASTEST:
            raise ParameterError(
                f"{self.name} has {len(self.positions)} frames at {self.rate:g} Hz; valid: above 0, up to {FASTEST:g}"
            )

    @property
    def duration(self) -> float:
        """Time from the first frame to the last [s]."""
        return (len(self.positions) - 1) / self.rate

    @property
    def left_out(self) -> tuple[str, ...]:
        """Parts of the file that are left out, with the reason, one sentence each."""
        return tuple(self.reasons.values())

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
            raise ParameterError(self._reason(ANALOG) or f"{self.name} has no analog channels")
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
        if number not in self.plates:
            valid = ", ".join(map(str, self.plates)) or "none, the file has no force plates"
            reason = self._reason(number) or self._reason(ANALOG)
            raise ParameterError(reason or f"{self.name} has no force plate {number}; valid: {valid}")
        return self.plates[number]

    def _reason(self, part: int | str) -> str:
        return f"{self.name}: {self.reasons[part]}" if part in self.reasons else ""


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
    """Return settings with absolute paths of replayed files; `folder`: base of relative paths.

    These are `trajectory_file`, and `path` next to a `program` that replays a file.
    """
    if not isinstance(tree, Mapping):
        return tree
    absolute = {key: located(value, folder) for key, value in tree.items()}
    path = absolute.get("path")
    if absolute.get("program") in PROGRAMS and isinstance(path, str) and path and not path.startswith(PACKAGE):
        absolute["path"] = str((folder / Path(path).expanduser()).absolute())
    if isinstance(file := absolute.get(TRAJECTORY), str) and file:
        absolute[TRAJECTORY] = str((folder / Path(file).expanduser()).absolute())
    return absolute


def read_trial(path: Path, up: str = "") -> Trial:
    """Read a c3d file, or an xdf file (`hric_core.trial.xdf`).

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
        raise ParameterError(f"{path.suffix[1:] or 'c3d'} file {path}: {error.strerror}") from error
    return _read(path, up, about.st_mtime_ns, about.st_size)


@dataclass(frozen=True)
class TrialSettings(parameters.Settings):
    """Parameters that select a recorded trial: file and vertical axis."""

    path: str = parameters.text(valid="a c3d or xdf file, path or package:// address,", empty=False)
    up: str = parameters.text("", text="axis that points up in the file, y or z; empty: as in the file")

    def trial(self) -> Trial:
        """Read the selected trial. Raises ParameterError if the file cannot be read or is not valid."""
        try:
            return read_trial(resolve(self.path), self.up)
        except HricError as error:
            raise ParameterError(f"{self.prefix}path: {error}") from error


@lru_cache(maxsize=4)  # one file is read several times: before the run, and for markers, plates and EMG
def _read(path: Path, up: str, modified: int, size: int) -> Trial:
    if path.suffix.lower() == ".xdf":
        from hric_core.trial.xdf import read_xdf  # which builds on this module

        trial = read_xdf(path, up)
    else:
        trial = _trial(path, up, read_content(path))
    for sentence in trial.left_out:
        LOG.warning("%s: left out: %s", path.name, sentence)
    return trial


def _trial(path: Path, up: str, content: C3dContent) -> Trial:
    """Check the raw content of a c3d file, and return it in metres and with z up."""
    parameters, rate, raw, analogs = content.parameters, content.rate, content.points, content.analogs
    point, analog, reasons = parameters.get("POINT", {}), parameters.get("ANALOG", {}), dict[int | str, str]()
    if "POINT" not in parameters:
        raise ParameterError(f"c3d file {path} is damaged: it has no parameters POINT")
    if content.damaged:
        reasons["parameters"] = "some parameters, which are damaged"
    if content.rest:
        reasons["frames"] = (
            f"{content.rest} bytes after the {len(raw)} frames stated in the header, which may be further frames"
        )
    unit = _unit(path, point)
    labels = _labels(point, "LABELS", raw.shape[1])
    raw[~content.valid | ~np.isfinite(raw).all(axis=2) | (raw == 0.0).all(axis=2)] = np.nan
    computed = {label.split(":")[-1]: raw[:, row] for row, label in enumerate(labels) if label.endswith(ANGLES)}
    analog_rate, reason = _analog_rate(analog, rate, content.per_frame)
    if reason:
        reasons[ANALOG], analogs = reason, analogs[:0]
    units = tuple(_texts(analog, "UNITS", len(analogs)))
    stated = up or _stated_up(point)
    z_or_y = stated or "z"
    platforms = {} if reason else parameters.get("FORCE_PLATFORM", {})
    reader = PlateReader(platforms, analogs, units, analog_rate, content.per_frame, METRES[unit], z_or_y)
    plates, missing = reader.read()
    reasons.update(missing)
    return Trial(
        path.name,
        rate,
        labels,
        vectors_z_up(z_or_y, raw * METRES[unit]),
        analog_rate,
        _labels(analog, "LABELS", len(analogs)),
        units,
        analogs.T.copy(),
        plates,
        z_or_y,
        bool(stated),
        _subject(parameters, reasons),
        reasons,
        first_number(parameters.get("HRIC", {}), "START_TIME", 0.0),
        computed,
        read_events(parameters.get("EVENT", {}), (max(content.first, 1) - 1) / (rate or np.nan)),
        unit,
    )


def _unit(path: Path, point: Group) -> str:
    """Return the unit of length, a key of METRES. Raises ParameterError: there is no such unit."""
    unit = _texts(point, "UNITS", 1)[0].lower() or "mm"
    if unit not in METRES and len(unit) == CUT:
        unit = next((name for name in METRES if name.startswith(unit)), unit)
    if unit not in METRES:
        raise ParameterError(f"c3d file {path} has points in {unit!r}; valid: {', '.join(METRES)}")
    return unit


def _analog_rate(analog: Group, rate: float, per_frame: int) -> tuple[float, str]:
    """Return the rate of the analog samples [Hz], and "" or the reason why they are left out; the rate is then 0.

    A rate that is not stated, or 0, is that of the samples in a frame.
    """
    stated = first_number(analog, "RATE", 0.0) or rate * per_frame
    if not per_frame or abs(stated - rate * per_frame) <= 1e-3 * rate:
        return (stated if per_frame else 0.0), ""
    return 0.0, (
        f"analog channels and force plates have a rate of {stated:g} Hz (ANALOG:RATE); valid: "
        f"{rate * per_frame:g} Hz, as the file has {per_frame} samples in each frame at {rate:g} Hz"
    )


def _stated_up(point: Group) -> str:
    """Return the vertical axis, "y" or "z", by the parameter POINT:Y_SCREEN, drawn upwards; "": not stated."""
    screen = _texts(point, "Y_SCREEN", 1)[0].lower().removeprefix("+")
    return screen if screen in UP_AXES else ""


def _subject(parameters: Mapping[str, Group], reasons: dict[int | str, str]) -> dict[str, float]:
    """Return the measures of the subject [m], [kg]; add to `reasons` what is not in the range of a person.

    A height or width may be in mm, as Nexus writes it, in cm or in m: the ranges of a person in these units do not
    overlap. A width of 0 was not measured."""
    subject = dict[str, float]()
    for key, names, (low, high), factors, unit in MEASURES:
        found = [
            numbers(parameters[group], name)
            for group in ("PROCESSING", "SUBJECTS")
            for name in parameters.get(group, {})
            if name.lower() in names
        ]
        found = [array for array in found if array.any() or not key.endswith(WIDTH)]
        values = [float(value) for array in found if array.size == 1 for value in array.ravel()]
        valid = [factor * value for value in values for factor in factors if low <= factor * value <= high]
        if valid:
            subject[key] = round(valid[0], 6)
        elif found:
            text = ", ".join(f"{value:g}" for array in found for value in array.ravel()) or "a text"
            reasons[key] = (
                f"the {key} of the subject is {text} in the file; valid: one number, {low:g} to {high:g} {unit}"
            )
    return subject


def _texts(group: Group, name: str, count: int) -> list[str]:
    """Return the first `count` texts of a parameter that continues in NAME2, NAME3, ...; missing texts are empty."""
    texts = [str(text).strip(BLANKS) for key in continued(name) for text in group.get(key, [])]
    return (texts + [""] * count)[:count]


def _labels(group: Group, name: str, count: int) -> tuple[str, ...]:
    """Return unique labels: a duplicate gets its number appended, a missing label becomes "*number"."""
    labels: list[str] = []
    for number, text in enumerate(_texts(group, name, count), 1):
        label = text or f"*{number}"
        labels.append(label if label not in labels else f"{label}_{number}")
    return tuple(labels)


def _index(label: str, labels: Sequence[str], what: str, where: str) -> int:
    if label not in labels:
        raise UnknownNameError(what, label, labels, where)
    return labels.index(label)
