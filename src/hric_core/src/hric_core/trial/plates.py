"""Reader of the force plates in a c3d file: their poses and the measured loads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_core.geometry.transforms import FloatArray, homogeneous, vectors_z_up

Group = Mapping[str, list[Any]]
"""Parameter group of a c3d file: arrays as nested lists, by parameter name."""
CHANNELS = {1: 6, 2: 6, 3: 8, 4: 6, 5: 8}
"""Number of analog channels by type of force plate; the keys are the supported types."""
MATRICES = {4: (6, 6), 5: (6, 8)}
"""Shape of the calibration matrix by type of force plate; other types have none."""
METRES = {"mm": 1e-3, "cm": 1e-2, "dm": 0.1, "m": 1.0} | {
    f"{prefix}{metres}": factor
    for prefix, factor in {"milli": 1e-3, "centi": 1e-2, "deci": 0.1, "": 1.0}.items()
    for metres in ("metres", "meters")
}
"""Factors to metres, by the unit of length in a c3d file (parameter POINT:UNITS), in lower case."""
MOMENT_UNITS = {"nmm": 1e-3, "nm": 1.0}
"""Factors to N m, by the unit of a moment channel, reduced to its letters in lower case."""
PLATE_LIMIT = 255
"""Largest number of force plates: an index of an array in a c3d file has one byte."""


class PlateError(Exception):
    """Invalid force plate data in a c3d file; the message continues "force plate 2 ..." in one line."""


@dataclass(frozen=True)
class TrialPlate:
    """Force plate of a trial.

    Attributes:
        kind: type number of the plate in the file.
        rate: sample rate [Hz].
        T_lab_plate: pose of the plate's frame in the laboratory with z up, shape (4, 4). The origin is the middle of
            the surface, z points up, x is that of the plate's axes in the file.
        size: size of the surface along x and y [m].
        load: load on the plate, in its frame about the middle of the surface: Fx, Fy, Fz [N], Mx, My, Mz [N m], shape
            (samples, 6).
        source: the plate in the axes of the file, for exports: `corners` and
            `origin` [m], `channels` (numbers from 1 on), `moment` (unit of the moments [N m]), `flip` (-1: z points
            down) and, of types 4 and 5, `calibration`.
    """

    kind: int
    rate: float
    T_lab_plate: FloatArray
    size: tuple[float, float]
    load: FloatArray
    source: Mapping[str, Any] = field(default_factory=dict)

    def at(self, time: float) -> tuple[float, ...]:
        """Return the load (3 forces [N], 3 moments [N m]) at a time of the trial [s], interpolated linearly.

        Before the first sample and after the last one, the load is that of this sample."""
        return tuple(self.loads(np.array([time]))[0].tolist())

    def loads(self, times: FloatArray) -> FloatArray:
        """Return the loads (3 forces [N], 3 moments [N m]), shape (n, 6), at times of the trial [s], shape (n,)."""
        return interpolated(times, self.rate, self.load)


def interpolated(times: FloatArray, rate: float, samples: FloatArray) -> FloatArray:
    """Return evenly spaced samples, interpolated linearly at times [s], shape (n,); the result has shape (n, channels).

    `samples`, shape (m, channels), begin at time 0 and have the rate `rate` [Hz]. Before the first and after the last
    sample, that sample is returned."""
    position = np.clip(np.asarray(times) * rate, 0.0, len(samples) - 1.0)
    before = np.minimum(position.astype(int), max(len(samples) - 2, 0))
    after = np.minimum(before + 1, len(samples) - 1)
    share = (position - before)[:, None]
    return np.asarray((1.0 - share) * samples[before] + share * samples[after])


@dataclass(frozen=True)
class PlateReader:
    """Reader of the force plates of one c3d file.

    The channels give the reaction of the plate on what is on it, in the plate's axes, whose z usually points down
    (INTERFACE.md of mocap_natnet gives the sources).

    Attributes:
        group: parameter group FORCE_PLATFORM.
        analogs: analog samples, shape (channels, samples).
        units: units of the channels.
        rate: sample rate [Hz].
        per_frame: number of samples per frame.
        metres: unit of length of the file [m].
        up: axis that points up in the file, "y" or "z".
    """

    group: Group
    analogs: FloatArray
    units: Sequence[str]
    rate: float
    per_frame: int
    metres: float
    up: str

    def read(self) -> tuple[dict[int, TrialPlate], dict[int | str, str]]:
        """Return the force plates, and the reasons why others are left out, both by number in the file, from 1 on."""
        plates, reasons = dict[int, TrialPlate](), dict[int | str, str]()
        for number in range(1, min(int(first_number(self.group, "USED", 0.0)), PLATE_LIMIT) + 1):
            try:
                plates[number] = self._plate(number)
            except PlateError as error:
                reasons[number] = f"force plate {number} {error}"
        return plates, reasons

    def _plate(self, number: int) -> TrialPlate:
        """Return one force plate. Raises PlateError: parameters are missing or invalid, or of an unsupported type."""
        kinds = numbers(self.group, "TYPE").ravel()
        kind = int(kinds[number - 1]) if number <= len(kinds) else 0
        if kind not in CHANNELS:
            raise PlateError(f"is of type {kind}; valid: {', '.join(map(str, CHANNELS))}")
        corners = self._values("CORNERS", number, (3, 4)).T * self.metres
        rows = self._channel_rows(number, CHANNELS[kind])
        signals = self.analogs[rows].T - self._baseline(rows, kind)
        source: dict[str, Any] = {"corners": corners.tolist(), "channels": [row + 1 for row in rows]}
        if kind == 1:
            reaction = self._type_1(signals, [self.units[row] for row in rows])
            return _turned(kind, self.rate, corners, reaction, self.up, source)
        origin = self._values("ORIGIN", number, (3,)) * self.metres
        source["origin"] = origin.tolist()
        if kind in MATRICES:
            matrix = self._values("CAL_MATRIX", number, MATRICES[kind])
            signals, source["calibration"] = signals @ matrix.T, matrix.tolist()
        moments = source["moment"] = self._moment_unit(self.units[rows[3]]) if kind == 2 else self.metres
        wrench = _type_3(signals, origin) if kind == 3 else signals * np.array([1, 1, 1, moments, moments, moments])
        if (
            origin[2] > 0
        ):  # z points down and the origin is below the surface, so z must be negative: the sign is wrong; ezc3d agrees
            origin = -origin
        about_surface = np.array([0.0, 0.0, origin[2]]) if kind == 3 else origin
        wrench[:, 3:] += np.cross(wrench[:, :3], about_surface)
        return _turned(kind, self.rate, corners, wrench, self.up, source)

    def _type_1(self, signals: FloatArray, units: Sequence[str]) -> FloatArray:
        """Return the wrench about the middle of the surface, shape (samples, 6), of a type 1 plate.

        `signals`: forces Fx Fy Fz, centre of pressure Px Py on the surface, from its middle, and free moment Mz, shape
        (samples, 6)."""
        wrench = np.zeros_like(signals)
        wrench[:, :3], wrench[:, 5] = signals[:, :3], signals[:, 5] * self._moment_unit(units[5])
        p_middle_pressure = np.column_stack([signals[:, 3:5], np.zeros(len(signals))])
        p_middle_pressure *= METRES.get(units[3].lower(), self.metres)
        wrench[:, 3:] += np.cross(p_middle_pressure, wrench[:, :3])
        return wrench

    def _moment_unit(self, unit: str) -> float:
        return MOMENT_UNITS.get("".join(filter(str.isalpha, unit.lower())), self.metres)

    def _baseline(self, rows: list[int], kind: int) -> FloatArray:
        """Return the mean signals without load, shape (channels,), in the frames that FORCE_PLATFORM:ZERO names."""
        frames = numbers(self.group, "ZERO").ravel().astype(int)
        first, last = (max(frames[0], 1), frames[1]) if len(frames) > 1 else (1, 0)
        samples = self.analogs[rows, (first - 1) * self.per_frame : last * self.per_frame]
        if last < first:
            return np.zeros(len(rows))
        if not samples.size or not np.isfinite(samples).all():
            raise PlateError(f"has no samples in frames {first} to {last}, its baseline as FORCE_PLATFORM:ZERO states")
        baseline = samples.mean(axis=1)
        if kind == 1:  # a centre of pressure has no offset: it is not defined without load
            baseline[3:5] = 0.0
        return np.asarray(baseline)

    def _values(self, name: str, number: int, shape: tuple[int, int] | tuple[int]) -> FloatArray:
        """Return the values of a parameter for one plate, with the given shape, from an array that may be larger.

        The parameter's last index is the plate."""
        values = numbers(self.group, name)
        if values.ndim == len(shape):  # of the only plate
            values = values[..., None]
        if values.ndim == len(shape) + 1 and values.shape[-1] >= number:
            index: Any = (*map(slice, shape), number - 1)
            values = values[index]
        if values.shape != shape or not np.isfinite(values).all():
            raise PlateError(f"has no FORCE_PLATFORM:{name} of {' x '.join(map(str, shape))} finite numbers")
        return np.array(values)

    def _channel_rows(self, number: int, count: int) -> list[int]:
        rows = [int(channel) - 1 for channel in self._values("CHANNEL", number, (count,))]
        if min(rows) < 0 or max(rows) >= len(self.analogs):
            raise PlateError(f"is on channels {[row + 1 for row in rows]}; the file has {len(self.analogs)} channels")
        return rows


def numbers(group: Group, name: str) -> FloatArray:
    """Return the numbers of a parameter, in its shape; none if it is missing or a text."""
    try:
        return np.asarray(group.get(name, []), dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)


def first_number(group: Group, name: str, default: float = np.nan) -> float:
    """Return the first number of a parameter; the default if there is none, or if it is not finite."""
    values = numbers(group, name).ravel()
    return float(values[0]) if len(values) and np.isfinite(values[0]) else default


def _type_3(ch: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the wrench about the plate's origin, shape (samples, 6), of a type 3 plate, by Kistler's formulae.

    `ch`: channels Fx12 Fx34 Fy14 Fy23 Fz1 Fz2 Fz3 Fz4, shape (samples, 8). In the formulae, a and b are the distances
    of the four sensors from the centre along x and y [m]."""
    a, b = abs(origin[0]), abs(origin[1])
    x12, x34, y14, y23, z1, z2, z3, z4 = ch.T
    mx, my = b * (z1 + z2 - z3 - z4), a * (z2 + z3 - z1 - z4)
    return np.column_stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4, mx, my, b * (x34 - x12) + a * (y14 - y23)])


def _turned(
    kind: int, rate: float, corners: FloatArray, reaction: FloatArray, up: str, source: dict[str, Any]
) -> TrialPlate:
    """Return the plate, with the load in a frame whose z points up.

    `corners`, shape (4, 3) [m], are in the quadrants +x +y, -x +y, -x -y, +x -y of the plate's axes in the file."""
    corners = vectors_z_up(up, corners)
    x, y = corners[0] - corners[1], corners[0] - corners[3]
    z = np.cross(x, y)
    if not np.isfinite(corners).all() or np.linalg.norm(z) < 1e-6:
        raise PlateError(f"has the corners {corners.round(3).tolist()} m; valid: four that span a rectangle")
    size = (float(np.linalg.norm(x)), float(np.linalg.norm(y)))
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    R_lab_file = np.column_stack([x, np.cross(z, x), z])
    flip = 1.0 if z[2] >= 0 else -1.0
    R_file_plate = np.diag([1.0, flip, flip])
    T_lab_plate = homogeneous(R_lab_file @ R_file_plate, corners.mean(axis=0))
    load = -np.hstack([reaction[:, :3] @ R_file_plate, reaction[:, 3:] @ R_file_plate])
    return TrialPlate(kind, rate, T_lab_plate, size, load, {**source, "flip": flip})
