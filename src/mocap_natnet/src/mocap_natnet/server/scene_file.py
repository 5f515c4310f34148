"""A scene from YAML."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import yaml

from hric_control.errors import ParameterError, UnknownNameError
from mocap_natnet.codec.types import Vector
from mocap_natnet.poses import UP_AXES, Pose, from_rotation_vector
from mocap_natnet.server.scene import Body, Faults, Plate, Scene
from mocap_natnet.server.sources import Sinusoid, Source, Track, from_file

if TYPE_CHECKING:
    from mocap_natnet.server.c3d_source import RecordedBody
    from mocap_natnet.trial import Trial

DEFAULT_BODIES = (Body("marker", Sinusoid()),)
"""One body on a sinusoid along x: 0.1 m, 0.25 Hz, as in the marker tracking of the thesis."""


class Live(Protocol):
    """Makes sources that hear the running system (`mocap_natnet.server.live_sources`)."""

    def topic(self, name: str) -> Source:
        """Follows a topic of poses."""

    def link(self, name: str, frame: str) -> Source:
        """Follows a link of the robot or the simulation."""


def load(path: Path, faults: Faults, up: str, describe_plates: bool = True, live: Live | None = None) -> Scene:
    """The scene of a file (INTERFACE.md gives its keys).

    Args:
        path: of the file.
        faults, up, describe_plates: of the scene.
        live: makes what hears the running system; None: there is none.

    Raises:
        ParameterError, UnknownNameError: the file cannot be used.
    """
    try:
        content = yaml.safe_load(path.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ParameterError(f"scene {path}: {error}") from error
    table = _Table(str(path), content)
    table.only("bodies", "plates")
    bodies = tuple(_body(entry, path.parent, number, live) for number, entry in enumerate(table.tables("bodies"), 1))
    plates = tuple(_plate(entry, path.parent, number) for number, entry in enumerate(table.tables("plates"), 1))
    if not bodies and not plates:
        raise ParameterError(f"{path} has neither bodies nor plates")
    return Scene(bodies, plates, faults, up, describe_plates)


class _Table:
    """A mapping of the file, and where it stands."""

    def __init__(self, where: str, content: Any) -> None:
        if not isinstance(content, Mapping):
            raise ParameterError(f"{where} is {content!r}; valid: a mapping")
        self.where, self._content = where, content

    def only(self, *names: str) -> None:
        """Refuse other keys."""
        for name in self._content:
            if name not in names:
                raise UnknownNameError("key", name, names, self.where)

    def tables(self, name: str) -> list[_Table]:
        """A list of mappings."""
        entries = self._content.get(name) or []
        if not isinstance(entries, list):
            raise ParameterError(f"{name} in {self.where} is {entries!r}; valid: a list")
        return [_Table(f"{self.where}: {name}[{index}]", entry) for index, entry in enumerate(entries)]

    def table(self, name: str) -> _Table:
        """A mapping."""
        return _Table(f"{self.where}: {name}", self._content.get(name))

    def text(self, name: str, default: str | None = None) -> str:
        """A text."""
        value = self._content.get(name, default)
        if not isinstance(value, str) or not value or "\0" in value:
            raise ParameterError(f"{name} in {self.where} is {value!r}; valid: a text")
        return value

    def texts(self, name: str) -> list[str]:
        """A list of texts, one at least, all different."""
        value = self._content.get(name)
        if not isinstance(value, list) or not value or any(not isinstance(part, str) for part in value) or len(set(value)) != len(value):
            raise ParameterError(f"{name} in {self.where} is {value!r}; valid: a list of different texts")
        return value

    def has(self, name: str) -> bool:
        """Whether the key is given."""
        return name in self._content

    def integer(self, name: str, default: int) -> int:
        """A whole number, 0 or more."""
        value = self._content.get(name, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < 0:
            raise ParameterError(f"{name} in {self.where} is {value!r}; valid: a whole number, 0 or more")
        return value

    def number(self, name: str, default: float) -> float:
        """A finite number."""
        return self._numbers(name, [self._content.get(name, default)], 1)[0]

    def vector(self, name: str, default: Vector) -> Vector:
        """Three numbers."""
        x, y, z = self._numbers(name, self._content.get(name, list(default)), 3)
        return x, y, z

    def rows(self, name: str, *lengths: int) -> list[list[float]]:
        """Rows of numbers of one of the lengths."""
        rows = self._content.get(name) or []
        if not isinstance(rows, list):
            raise ParameterError(f"{name} in {self.where} is {rows!r}; valid: a list of lists of numbers")
        return [self._numbers(f"{name}[{index}]", row, *lengths) for index, row in enumerate(rows)]

    def numbers(self, name: str, length: int, default: list[float]) -> list[float]:
        """That many numbers."""
        return self._numbers(name, self._content.get(name, default), length)

    def _numbers(self, name: str, value: Any, *lengths: int) -> list[float]:
        good = isinstance(value, list) and len(value) in lengths
        if not good or not all(isinstance(part, int | float) and not isinstance(part, bool) and math.isfinite(part) for part in value):
            raise ParameterError(f"{name} in {self.where} is {value!r}; valid: {' or '.join(map(str, lengths))} finite numbers")
        return [float(part) for part in value]


def _body(table: _Table, folder: Path, number: int, live: Live | None) -> Body:
    table.only("name", "id", "markers", "motion")
    motion = table.table("motion")
    if motion.text("type") == RECORDED:
        if table.has("markers"):
            raise ParameterError(f"{table.where} has markers; those of motion {RECORDED} are in the file: valid: labels in motion")
        recorded = _recorded(motion, folder, table.text("name"))
        return Body(table.text("name"), recorded, table.integer("id", number), recorded.markers, recorded.seen)
    markers = tuple((row[0], row[1], row[2]) for row in table.rows("markers", 3))
    body = Body(table.text("name"), _motion(motion, folder, live), table.integer("id", number))
    return Body(body.name, body.source, body.id, markers) if markers else body


def _motion(table: _Table, folder: Path, live: Live | None) -> Source:
    kind = table.text("type")
    if kind in _LIVE:
        if live is None:
            valid = ", ".join([*_MOTIONS, RECORDED])
            raise ParameterError(f"motion {kind} in {table.where} hears the running system, and no ROS master answers; valid: {valid}")
        return _LIVE[kind](table, live)
    if kind not in _MOTIONS:
        raise UnknownNameError("motion", kind, [*_MOTIONS, RECORDED, *_LIVE], table.where)
    return _MOTIONS[kind](table, folder)


def _topic(table: _Table, live: Live) -> Source:
    table.only("type", "topic", "message")
    if (kind := table.text("message", "PoseStamped")) != "PoseStamped":
        raise ParameterError(f"message in {table.where} is {kind!r}; valid: PoseStamped")
    return live.topic(table.text("topic"))


def _link(table: _Table, live: Live) -> Source:
    table.only("type", "link", "frame")
    return live.link(table.text("link"), table.text("frame", "world"))


def _still(table: _Table, folder: Path) -> Source:
    table.only("type", "position", "rotation")
    pose = Pose(table.vector("position", (0.0, 0.0, 1.0)), from_rotation_vector(table.vector("rotation", (0.0, 0.0, 0.0))))
    return Track([0.0], [pose])


def _sinusoid(table: _Table, folder: Path) -> Source:
    table.only("type", "centre", "amplitude", "frequency", "begin", "rotation")
    base = Sinusoid()
    return Sinusoid(
        table.vector("centre", base.centre),
        table.vector("amplitude", base.amplitude),
        table.number("frequency", base.frequency),
        table.number("begin", base.begin),
        table.vector("rotation", base.rotation),
    )


def _track(table: _Table, folder: Path) -> Source:
    table.only("type", "points")
    rows = table.rows("points", 4, 7)
    poses = [Pose((row[1], row[2], row[3]), from_rotation_vector(row[4:] or [0.0, 0.0, 0.0])) for row in rows]
    try:
        return Track([row[0] for row in rows], poses, minimum_jerk=table.text("type") == "minimum_jerk")
    except ParameterError as error:
        raise ParameterError(f"{table.where}: {error}") from error


def _file(table: _Table, folder: Path) -> Source:
    table.only("type", "path")
    return from_file(folder / table.text("path"))


def _bag(table: _Table, folder: Path) -> Source:
    from mocap_natnet.server.bag_source import from_bag  # takes half a second, which only this motion is worth

    table.only("type", "path", "topic", "body", "up")
    up = table.text("up", "z")
    if up not in UP_AXES:
        raise ParameterError(f"up in {table.where} is {up!r}; valid: {', '.join(UP_AXES)}")
    return from_bag(folder / table.text("path"), table.text("topic"), table.text("body") if table.has("body") else "", up)


def _recorded(table: _Table, folder: Path, name: str) -> RecordedBody:
    from mocap_natnet.server.c3d_source import RecordedBody, labels_of

    table.only("type", "path", "labels", "up")
    trial = _trial(table, folder)
    labels = table.texts("labels") if table.has("labels") else labels_of(trial, name)
    return RecordedBody(trial, labels)


def _trial(table: _Table, folder: Path) -> Trial:
    from mocap_natnet.trial import read_trial

    return read_trial((folder / table.text("path")).expanduser().absolute(), table.text("up") if table.has("up") else "")


def _plate(table: _Table, folder: Path, number: int) -> Plate:
    if table.has("recorded"):
        table.only("id", "serial", "samples", "recorded")
        return _recorded_plate(table, table.table("recorded"), folder, number)
    table.only("id", "serial", "centre", "samples", "wrench")
    wrench = tuple(table.numbers("wrench", 6, [0.0] * 6))
    base = Plate(lambda time: wrench)
    return Plate(
        base.source,
        table.integer("id", number),
        table.text("serial", f"emulated-{number}"),
        table.vector("centre", base.centre),
        table.integer("samples", base.samples),
    )


def _recorded_plate(table: _Table, recorded: _Table, folder: Path, number: int) -> Plate:
    """A plate that measures what one of the file measured, at its place."""
    recorded.only("path", "plate", "up")
    found = _trial(recorded, folder).plate(recorded.integer("plate", 1))
    x, y, z = found.T_lab_plate[:3, 3].tolist()
    base = Plate(found.at)
    return Plate(
        base.source,
        table.integer("id", number),
        table.text("serial", f"emulated-{number}"),
        (x, y, z),
        table.integer("samples", base.samples),
    )


_MOTIONS: dict[str, Callable[[_Table, Path], Source]] = {
    "still": _still,
    "sinusoid": _sinusoid,
    "minimum_jerk": _track,
    "line": _track,
    "file": _file,
    "bag": _bag,
}
RECORDED = "c3d"
"""The motion that brings the markers along."""
_LIVE: dict[str, Callable[[_Table, Live], Source]] = {"topic": _topic, "link": _link}
