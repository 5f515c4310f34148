"""Scene of the emulated cameras, read from a YAML file."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

from hric_core.errors import ParameterError
from hric_core.geometry import UP_AXES, Pose, Track, Vector, from_rotation_vector
from hric_core.parameters import Settings, choice, listing, names, numbers, read_yaml, section, text, variant, whole
from hric_core.trial.c3d import Trial, read_trial
from mocap_natnet.server.c3d_source import RecordedBody, labels_of
from mocap_natnet.server.scene import TRIANGLE, CameraFaults, SceneBody, ServedPlate, ServedScene
from mocap_natnet.server.sources import SinusoidSource, Source, from_file

DEFAULT_BODIES = (SceneBody("marker", SinusoidSource()),)
"""Default scene: one body on a sinusoid along x, 0.1 m, 0.25 Hz, as in the marker tracking of the thesis."""


class Live(Protocol):
    """Factory of motion sources that follow the running system; `mocap_natnet.server.node_app` has it for ROS."""

    def topic(self, name: str) -> Source:
        """Return a source that follows a topic of poses."""

    def link(self, name: str, frame: str) -> Source:
        """Return a source that follows a link of the robot or the simulation."""


def load(
    path: Path, faults: CameraFaults, up: str, describe_plates: bool = True, live: Live | None = None
) -> ServedScene:
    """Return the scene of a file (INTERFACE.md gives its keys).

    Args:
        path: path of the file.
        faults: measurement faults of the scene.
        up: axis that points up in the stream.
        describe_plates: True if the description contains the plates, which some clients cannot read.
        live: factory of sources that follow the running system; None: there is none.

    Raises:
        ParameterError, UnknownNameError: the file cannot be used.
    """
    scene = _Scene.of(read_yaml(path), f"{path}:")
    bodies = tuple(body.built(path.parent, number, live) for number, body in enumerate(scene.bodies, 1))
    plates = tuple(plate.built(path.parent, number) for number, plate in enumerate(scene.plates, 1))
    return ServedScene(bodies, plates, faults, up, describe_plates)


class _Motion(Settings):
    """Settings of a body's motion."""

    def source(self, folder: Path, live: Live | None) -> Source:
        """Return the source of the motion; folder: base of relative paths; live: factory for topics and links."""
        raise NotImplementedError


@dataclass(frozen=True)
class _Still(_Motion):
    position: Vector = numbers(3, (0.0, 0.0, 1.0), unit="m")
    rotation: Vector = numbers(3, (0.0, 0.0, 0.0), unit="rad")

    def source(self, folder: Path, live: Live | None) -> Source:
        return Track([0.0], [Pose(self.position, from_rotation_vector(self.rotation))])


@dataclass(frozen=True)
class _Sinusoid(SinusoidSource, _Motion):
    def source(self, folder: Path, live: Live | None) -> Source:
        return self


def _track(rows: Sequence[Sequence[float]], minimum_jerk: bool = False) -> Track:
    poses = [Pose((row[1], row[2], row[3]), from_rotation_vector(row[4:] or [0.0, 0.0, 0.0])) for row in rows]
    return Track([row[0] for row in rows], poses, minimum_jerk)


@dataclass(frozen=True)
class _Line(_Motion):
    points: Track = listing(numbers((4, 7)), made=_track)

    def source(self, folder: Path, live: Live | None) -> Source:
        return self.points


@dataclass(frozen=True)
class _MinimumJerk(_Line):
    points: Track = listing(numbers((4, 7)), made=partial(_track, minimum_jerk=True))


@dataclass(frozen=True)
class _File(_Motion):
    path: str = text(empty=False)

    def source(self, folder: Path, live: Live | None) -> Source:
        return from_file(folder / self.path)


@dataclass(frozen=True)
class _Bag(_Motion):
    path: str = text(empty=False)
    topic: str = text(empty=False)
    body: str = text("", figures=True)
    up: str = choice(*UP_AXES, default="z")

    def source(self, folder: Path, live: Live | None) -> Source:
        from mocap_natnet.server.bag_source import from_bag  # imported here: it takes half a second

        return from_bag(folder / self.path, self.topic, self.body, self.up)


@dataclass(frozen=True)
class _TrialFile(Settings):
    path: str = text(empty=False)
    up: str = text("")

    def trial(self, folder: Path) -> Trial:
        """Read the trial in the file; folder: base of a relative path."""
        return read_trial((folder / self.path).expanduser().absolute(), self.up)


@dataclass(frozen=True)
class _Recorded(_TrialFile):
    labels: tuple[str, ...] | None = names(None, None)

    def body(self, folder: Path, name: str) -> RecordedBody:
        """Return the recorded body; name: prefix of its markers' labels unless `labels` are given."""
        trial = self.trial(folder)
        return RecordedBody(trial, list(self.labels) if self.labels else labels_of(trial, name))


def _running(live: Live | None) -> Live:
    """Return the factory of live sources. Raises ParameterError if there is none."""
    if live is None:
        raise ParameterError(
            "a motion by topic or link follows the running system, but there is no ROS master; "
            f"valid: {', '.join(kind for kind in MOTIONS if kind not in ('topic', 'link'))}"
        )
    return live


@dataclass(frozen=True)
class _Topic(_Motion):
    topic: str = text(empty=False)
    message: str = choice("PoseStamped")

    def source(self, folder: Path, live: Live | None) -> Source:
        return _running(live).topic(self.topic)


@dataclass(frozen=True)
class _Link(_Motion):
    link: str = text(empty=False)
    frame: str = text("world", empty=False)

    def source(self, folder: Path, live: Live | None) -> Source:
        return _running(live).link(self.link, self.frame)


MOTIONS: dict[str, type[Settings]] = {
    "still": _Still,
    "sinusoid": _Sinusoid,
    "minimum_jerk": _MinimumJerk,
    "line": _Line,
    "file": _File,
    "bag": _Bag,
    "c3d": _Recorded,
    "topic": _Topic,
    "link": _Link,
}
"""Type of motion in the file -> its settings; c3d also provides the body's markers."""


@dataclass(frozen=True)
class _Body(Settings):
    name: str = text(empty=False, figures=True)
    id: int | None = whole(None, minimum=0)
    markers: tuple[Vector, ...] = listing(numbers(3), default=())
    motion: _Motion | _Recorded = variant("type", MOTIONS)

    def check(self, where: str) -> None:
        """Raise ParameterError if `markers` are given though motion c3d has markers from its file."""
        if isinstance(self.motion, _Recorded) and self.markers:
            raise ParameterError(f"{where}markers is given, but motion c3d has its own; valid: labels in motion")

    def built(self, folder: Path, number: int, live: Live | None) -> SceneBody:
        """Return the body of the scene; folder: base of relative paths; number: default of its streaming id."""
        id_ = number if self.id is None else self.id
        if isinstance(self.motion, _Recorded):
            recorded = self.motion.body(folder, self.name)
            return SceneBody(self.name, recorded, id_, recorded.markers, recorded.seen)
        return SceneBody(self.name, self.motion.source(folder, live), id_, self.markers or TRIANGLE)


@dataclass(frozen=True)
class _RecordedPlate(_TrialFile):
    plate: int = whole(1, minimum=0)


@dataclass(frozen=True)
class _Plate(Settings):
    id: int | None = whole(None, minimum=0)
    serial: str = text("", figures=True)
    centre: Vector | None = numbers(3, None, unit="m")
    samples: int = whole(5, minimum=0)
    wrench: tuple[float, ...] | None = numbers(6, None, unit="N, N m")
    recorded: _RecordedPlate | None = section(_RecordedPlate, None)

    def check(self, where: str) -> None:
        """Raise ParameterError if keys are given whose values a recorded plate has from its file."""
        if self.recorded is not None and (self.centre or self.wrench):
            raise ParameterError(
                f"{where}centre or wrench is given, but a recorded plate has its own; valid: id, serial, samples"
            )

    def built(self, folder: Path, number: int) -> ServedPlate:
        """Return the plate of the scene; folder: base of relative paths; number: default of its id."""
        wrench, centre = self.wrench or (0.0,) * 6, self.centre or (0.0, 0.0, 0.0)
        id_, serial = number if self.id is None else self.id, self.serial or f"emulated-{number}"
        if self.recorded is None:
            return ServedPlate(lambda time: wrench, id_, serial, centre, self.samples)
        recorded_plate = self.recorded.trial(folder).plate(self.recorded.plate)
        x, y, z = recorded_plate.T_lab_plate[:3, 3].tolist()
        return ServedPlate(recorded_plate.at, id_, serial, (x, y, z), self.samples)


@dataclass(frozen=True)
class _Scene(Settings):
    bodies: tuple[_Body, ...] = listing(section(_Body), default=())
    plates: tuple[_Plate, ...] = listing(section(_Plate), default=())

    def check(self, where: str) -> None:
        """Raise ParameterError if the scene is empty."""
        if not self.bodies and not self.plates:
            raise ParameterError(f"{where.rstrip(': ')} has neither bodies nor plates")
