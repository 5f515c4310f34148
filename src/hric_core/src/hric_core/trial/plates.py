"""Reader of the force plates in a c3d file: their poses and the measured loads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.geometry.transforms import FloatArray, homogeneous, vectors_z_up

Group = Mapping[str, list[Any]]
"""Parameter group of a c3d file: arrays as nested lists, by parameter name."""
CHANNELS = {2: 6, 3: 8, 4: 6}
"""Number of analog channels by type of force plate; the keys are the supported types."""
MOMENT_UNITS = {"nmm": 1e-3, "nm": 1.0}
"""Factors to N m, by the unit of a moment channel, reduced to its letters in lower case."""


class PlateError(Exception):
    """Invalid force plate data in a c3d file; the message gives the reason in one line."""


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
    """

    kind: int
    rate: float
    T_lab_plate: FloatArray
    size: tuple[float, float]
    load: FloatArray

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


def read_plates(
    group: Group, analogs: FloatArray, units: Sequence[str], rate: float, metres: float, up: str
) -> tuple[TrialPlate, ...]:
    """Return the force plates of a c3d file.

    The channels give the reaction of the plate on what is on it, in the plate's axes, whose z usually points down
    (INTERFACE.md gives the sources).

    Args:
        group: parameter group FORCE_PLATFORM.
        analogs: analog samples, shape (channels, samples).
        units: units of the channels.
        rate: sample rate [Hz].
        metres: unit of length of the file [m].
        up: axis that points up in the file, "y" or "z".

    Raises:
        PlateError: parameters are missing or invalid, or the type of a plate is not supported.
    """
    used = np.ravel(group.get("USED", [0]))
    count = int(used[0]) if len(used) else 0
    return tuple(_plate(number, group, analogs, units, rate, metres, up) for number in range(count))


def _plate(
    number: int,
    group: Group,
    analogs: FloatArray,
    units: Sequence[str],
    rate: float,
    metres: float,
    up: str,
) -> TrialPlate:
    kinds = np.ravel(group.get("TYPE", []))
    kind = int(kinds[number]) if number < len(kinds) else 0
    if kind not in CHANNELS:
        raise PlateError(f"force plate {number + 1} is of type {kind}; valid: {', '.join(map(str, CHANNELS))}")
    corners = _of(group, "CORNERS", number, (3, 4)).T * metres
    origin = _of(group, "ORIGIN", number, (3,)) * metres
    rows = _channel_rows(group, number, CHANNELS[kind], len(analogs))
    signals = analogs[rows].T
    if kind == 4:
        signals = signals @ _of(group, "CAL_MATRIX", number, (6, 6)).T
    moments = MOMENT_UNITS.get("".join(filter(str.isalpha, units[rows[3]].lower())), metres) if kind == 2 else metres
    wrench = _type_3(signals, origin) if kind == 3 else signals * np.array([1, 1, 1, moments, moments, moments])
    if (
        origin[2] > 0
    ):  # z points down and the origin is below the surface, so z must be negative: the sign is wrong; ezc3d agrees
        origin = -origin
    about_surface = np.array([0.0, 0.0, origin[2]]) if kind == 3 else origin
    wrench[:, 3:] += np.cross(wrench[:, :3], about_surface)
    return _turned(kind, rate, corners, wrench, up)


def _type_3(ch: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the wrench about the plate's origin, shape (samples, 6), of a type 3 plate, by Kistler's formulae.

    `ch`: channels Fx12 Fx34 Fy14 Fy23 Fz1 Fz2 Fz3 Fz4, shape (samples, 8). In the formulae, a and b are the distances
    of the four sensors from the centre along x and y [m]."""
    a, b = abs(origin[0]), abs(origin[1])
    x12, x34, y14, y23, z1, z2, z3, z4 = ch.T
    mx, my = b * (z1 + z2 - z3 - z4), a * (z2 + z3 - z1 - z4)
    return np.column_stack([x12 + x34, y14 + y23, z1 + z2 + z3 + z4, mx, my, b * (x34 - x12) + a * (y14 - y23)])


def _turned(kind: int, rate: float, corners: FloatArray, reaction: FloatArray, up: str) -> TrialPlate:
    """Return the plate, with the load in a frame whose z points up.

    `corners`, shape (4, 3) [m], are in the quadrants +x +y, -x +y, -x -y, +x -y of the plate's axes in the file."""
    corners = vectors_z_up(up, corners)
    x, y = corners[0] - corners[1], corners[0] - corners[3]
    z = np.cross(x, y)
    if not np.isfinite(corners).all() or np.linalg.norm(z) < 1e-6:
        raise PlateError(
            f"the corners of a force plate are {corners.round(3).tolist()} m; valid: four that span a rectangle"
        )
    size = (float(np.linalg.norm(x)), float(np.linalg.norm(y)))
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    R_lab_file = np.column_stack([x, np.cross(z, x), z])
    flip = 1.0 if z[2] >= 0 else -1.0
    R_file_plate = np.diag([1.0, flip, flip])
    T_lab_plate = homogeneous(R_lab_file @ R_file_plate, corners.mean(axis=0))
    load = -np.hstack([reaction[:, :3] @ R_file_plate, reaction[:, 3:] @ R_file_plate])
    return TrialPlate(kind, rate, T_lab_plate, size, load)


def _of(group: Group, name: str, number: int, shape: tuple[int, ...]) -> FloatArray:
    """Return the values of a parameter for one plate, with the given shape; the parameter's last index is the plate."""
    values = np.asarray(group.get(name, []), dtype=float)
    if (
        values.ndim != len(shape) + 1
        or values.shape[:-1] != shape
        or values.shape[-1] <= number
        or not np.isfinite(values[..., number]).all()
    ):
        expected = " x ".join(map(str, shape))
        raise PlateError(f"force plate {number + 1} has no FORCE_PLATFORM:{name} of {expected} finite numbers")
    return np.array(values[..., number])


def _channel_rows(group: Group, number: int, count: int, available: int) -> list[int]:
    channels = np.asarray(group.get("CHANNEL", []), dtype=int)
    if channels.ndim != 2 or channels.shape[0] < count or channels.shape[1] <= number:
        raise PlateError(f"force plate {number + 1} has no FORCE_PLATFORM:CHANNEL of {count} channels")
    rows = (channels[:count, number] - 1).tolist()
    if min(rows) < 0 or max(rows) >= available:
        raise PlateError(
            f"force plate {number + 1} is on channels {channels[:count, number].tolist()}; valid: 1 to {available}"
        )
    return [int(row) for row in rows]
