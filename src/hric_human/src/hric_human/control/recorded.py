"""Recorded motions as joint references: angles, or markers by inverse kinematics.

The motion is a list of values, a c3d file, or a file of OpenSim (.trc, .mot).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import UP_AXES, FloatArray, Pose
from hric_core.geometry.poses import PoseSettings, inverse
from hric_core.geometry.transforms import rotation_from_quaternion, vectors_z_up
from hric_core.parameters import Mistakes, choice, mapping, number, refused, section, text, unknown
from hric_core.trial.c3d import TrialSettings, resolve
from hric_core.trial.opensim_text import rate_of, read_markers, read_storage
from hric_human.body.markers import check_upright, marker_labels
from hric_human.control.controller import Person
from hric_human.control.inverse_kinematics import Solver, Task
from hric_human.control.marker_model import ROOT_MOTIONS, MarkerModel
from hric_human.control.references import AngleRows, Reference, ReferenceSettings

ROOT = Pose()
"""Identity: pose of the root link if marker positions are given in its axes."""


class MarkerSolver:
    """Inverse kinematics of a body from marker positions, by least squares within the ranges of the joints.

    Args:
        person: person whose joints are computed.
        names: names of the body's markers.
    """

    def __init__(self, person: Person, names: list[str]) -> None:
        self._marked = MarkerModel(person.body, names)
        self._solver = Solver(*(np.array(values) for values in (person.lower, person.upper, person.rest)))

    def solve(self, positions: FloatArray) -> tuple[list[list[float]], FloatArray]:
        """Return joint angles per frame, searched from the previous frame's; without visible markers they stay.

        Args:
            positions: positions in axes of the root link, shape (frames, markers, 3) [m]; NaN: not visible.

        Returns:
            n floats per frame [rad], and the root mean square distance between measured and model markers, shape
                (frames,) [m].
        """
        q, rows, distances = self._solver.rest, [], []
        for target in positions:
            seen = np.isfinite(target).all(axis=1)
            q, left = self._solver.solve(self._task(target, seen), q, 0.0)
            rows.append(q.tolist())
            distances.append(left / max(1, int(seen.sum())) ** 0.5)
        return rows, np.array(distances)

    def _task(self, target: FloatArray, seen: Any) -> Task:
        def task(q: list[float]) -> tuple[FloatArray, FloatArray]:
            p, J = self._marked.at(q, ROOT)
            return (target - p)[seen].ravel(), J[seen, :, ROOT_MOTIONS:].reshape(-1, len(q))

        return task


def _followed(person: Person, rate: float, columns: Mapping[str, FloatArray], where: str) -> Reference:
    """Return a reference with recorded angles of some joints; the others stay in the resting posture.

    Args:
        person: person whose joints are driven.
        rate: rate of the rows [Hz].
        columns: angles by joint, shape (rows,) each [rad].
        where: name of the columns, for error messages.

    Raises:
        ParameterError: an angle outside the range of its joint.
    """
    mistakes = Mistakes()
    rows = np.tile(person.rest, (len(next(iter(columns.values()))), 1))
    for name, column in columns.items():
        index = person.joints.index(name)
        low, high = person.lower[index], person.upper[index]
        outside = np.flatnonzero(~((column >= low) & (column <= high)))
        if len(outside):
            with mistakes.noted():
                value = float(column[outside[0]])
                raise refused(f"{where}.{name}[{outside[0]}]", value, f"{low:.3f} to {high:.3f} [rad]")
        rows[:, index] = column
    mistakes.raise_all()
    return AngleRows(1.0 / rate, rows.tolist())


@dataclass(frozen=True)
class Angles(ReferenceSettings):
    """Settings of a reference with recorded joint angles."""

    rate: float = number(above=0.0, maximum=1e4, unit="Hz", text="of the rows")
    angles: Mapping[str, object] = mapping(
        unit="rad",
        text="lists of equal length, by joint; joints not named stay in the resting posture. Before and after the "
        "lists the body is at rest",
    )

    def reference(self, person: Person) -> Reference:
        """Return the reference of the recorded angles."""
        columns, mistakes, where = {}, Mistakes(), f"{self.prefix}angles"
        for name, values in self.angles.items():
            with mistakes.noted():
                if name not in person.joints:
                    raise unknown("joint", name, person.joints, where)
                columns[name] = _array(values, f"{where}.{name}", 1)
        mistakes.raise_all()
        if not columns or len({len(column) for column in columns.values()}) > 1:
            raise ParameterError(f"{where} must have one joint or more, all with the same number of values")
        return _followed(person, self.rate, columns, where)


@dataclass(frozen=True)
class MotionFile(ReferenceSettings):
    """Settings of a reference from a .mot or .sto file of OpenSim; columns that are no joint are ignored."""

    path: str = text(valid="a .mot or .sto file, path or package:// address,", empty=False)

    def reference(self, person: Person) -> Reference:
        """Return the reference of the file's joint angles."""
        path, where = resolve(self.path), f"{self.prefix}path"
        try:
            stored = read_storage(path)
            rate = rate_of(path, stored.time)
        except ParameterError as error:
            raise ParameterError(f"{where}: {error}") from error
        scale = np.pi / 180.0 if stored.degrees else 1.0
        named = {_coordinate(label): scale * column for label, column in stored.columns.items()}
        columns = {name: named[name] for name in person.joints if name in named}
        if not columns:
            raise ParameterError(f"{where}: {path} has no joint of the body; valid: {', '.join(person.joints)}")
        return _followed(person, rate, columns, f"{where}: {path.name}")


def _coordinate(label: str) -> str:
    """Return the coordinate's name from a column label: `el_flex` or `/jointset/elbow/el_flex/value`."""
    return label.removesuffix("/value").rpartition("/")[2]


@dataclass(frozen=True)
class CapturedMarkers(ReferenceSettings):
    """Settings of a reference computed from marker positions; markers that the body does not have are ignored."""

    root_in_lab: PoseSettings = section(
        PoseSettings, text="pose of the body's root link in the laboratory, x forward, z up"
    )

    def motion(self) -> tuple[float, Mapping[str, FloatArray]]:
        """Return the frame rate [Hz], and marker positions in the laboratory by name, shape (frames, 3) each [m]."""
        raise NotImplementedError

    def reference(self, person: Person) -> Reference:
        """Return the reference of the joint angles computed from the markers."""
        rate, markers = self.motion()
        labels = marker_labels(self.prefix.rstrip("./"), tuple(markers), tuple(person.body.markers))
        names = [name for name in person.body.markers if name in labels]
        lab = np.stack([markers[labels[name]] for name in names], axis=1)
        rows, _ = MarkerSolver(person, names).solve(_moved(inverse(self.root_in_lab.pose), lab))
        return AngleRows(1.0 / rate, rows)


@dataclass(frozen=True)
class ListedMarkers(CapturedMarkers):
    """Settings of a reference from marker positions that are listed in the settings themselves."""

    rate: float = number(above=0.0, maximum=1e4, unit="Hz", text="of the frames")
    markers: Mapping[str, object] = mapping(
        unit="m", text="positions by name of Plug-in Gait, a row of x, y, z per frame; NaN: not seen"
    )

    def motion(self) -> tuple[float, Mapping[str, FloatArray]]:
        """Return frame rate [Hz] and marker positions [m] from the settings."""
        where = f"{self.prefix}markers"
        arrays = {name: _array(values, f"{where}.{name}", 2) for name, values in self.markers.items()}
        if len({array.shape for array in arrays.values()}) > 1 or any(array.shape[1] != 3 for array in arrays.values()):
            raise ParameterError(f"{where} must have the same number of rows x, y, z for each marker")
        return self.rate, arrays


@dataclass(frozen=True)
class C3dFile(CapturedMarkers, TrialSettings):
    """Settings of a reference from the marker positions of a c3d file."""

    def motion(self) -> tuple[float, Mapping[str, FloatArray]]:
        """Return frame rate [Hz] and marker positions [m] from the c3d file."""
        trial = self.trial()
        markers = {name: trial.positions[:, index] for index, name in enumerate(trial.labels)}
        if not trial.up_known:
            check_upright(f"{self.prefix}path: {trial.name}", markers)
        return trial.rate, markers


@dataclass(frozen=True)
class TrcFile(CapturedMarkers):
    """Settings of a reference from the marker positions of a .trc file of OpenSim."""

    path: str = text(valid="a .trc file, path or package:// address,", empty=False)
    up: str = choice(*UP_AXES, default="y", text="axis that points up in the file")

    def motion(self) -> tuple[float, Mapping[str, FloatArray]]:
        """Return frame rate [Hz] and marker positions [m] from the .trc file, converted to z up."""
        path = resolve(self.path)
        try:
            rows = read_markers(path)
            rate = rate_of(path, rows.time)
        except ParameterError as error:
            raise ParameterError(f"{self.prefix}path: {error}") from error
        return rate, {name: vectors_z_up(self.up, positions) for name, positions in rows.markers.items()}


RECORDED: dict[str, type[ReferenceSettings]] = {
    "angles": Angles,
    "mot": MotionFile,
    "markers": ListedMarkers,
    "trc": TrcFile,
    "c3d": C3dFile,
}
"""Settings classes of recorded motions, by the value of `program`."""


def _array(values: Any, where: str, dimensions: int) -> FloatArray:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.zeros(())
    if array.ndim != dimensions or not len(array):
        raise refused(where, values, "a list of numbers" if dimensions == 1 else "rows of x, y, z [m]")
    return array


def _moved(T_root_lab: Pose, p_lab: FloatArray) -> FloatArray:
    """Transform points, shape (..., 3) [m], from axes of the laboratory to axes of the root link."""
    return np.asarray(p_lab @ rotation_from_quaternion(T_root_lab.orientation).T + np.array(T_root_lab.position))
