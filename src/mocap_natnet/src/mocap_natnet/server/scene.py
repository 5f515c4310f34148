"""What the emulated cameras see: rigid bodies with markers, force plates, and what goes wrong with them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hric_control.errors import ParameterError
from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec.types import OF_ASSET, POINT_CLOUD, TRACKED, Analog, Frame, Marker, MarkerSet, RigidBody, Suffix, Vector
from mocap_natnet.poses import UP_AXES, Pose, from_rotation_vector, multiply, pose_stream_axes, stream_axes, transform
from mocap_natnet.server.sources import Source

TRIANGLE: tuple[Vector, ...] = ((0.06, -0.02, 0.0), (-0.04, -0.03, 0.0), (-0.02, 0.05, 0.0))
"""Three markers about their centroid, no two sides alike [m] (our choice)."""
MARKER_SIZE = 0.014
"""Diameter of a common passive marker [m]."""
MARKER_FLAGS = POINT_CLOUD | OF_ASSET
"""As captures show them for a marker of an asset."""
PLATE_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
NO_SUFFIX = Suffix()
BLOCK = 64
"""Frames whose noise is drawn at once: a generator of random numbers costs as much as all else of a frame."""


@dataclass(frozen=True)
class Body:
    """A rigid body.

    Args:
        name: in the description.
        source: what moves it.
        id: streaming id, 1 to 32767.
        markers: in the body, z up [m].
        seen: time of the stream [s] -> where each of the markers is seen, z up [m], None: it is not; None: where the pose puts them.
    """

    name: str
    source: Source
    id: int = 1
    markers: tuple[Vector, ...] = TRIANGLE
    seen: Callable[[float], Sequence[Vector | None]] | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.id <= 32767:
            raise ParameterError(f"body {self.name!r} has streaming id {self.id}; valid: 1 to 32767")


@dataclass(frozen=True)
class Plate:
    """A force plate of 0.6 x 0.4 m.

    Args:
        source: time of the stream [s] -> Fx, Fy, Fz [N], Mx, My, Mz [N m], in the plate's axes.
        id, serial: as described.
        centre: of the surface, z up [m].
        samples: per frame of the cameras.
    """

    source: Callable[[float], tuple[float, ...]]
    id: int = 1
    serial: str = "emulated-1"
    centre: Vector = (0.0, 0.0, 0.0)
    samples: int = 5


@dataclass(frozen=True)
class Faults:
    """What is wrong with what is seen; all of it repeats with the seed.

    Args:
        noise: of a body's position, standard deviation per axis [m].
        rotation_noise: of its orientation, per axis [rad].
        marker_noise: of each marker besides [m].
        occlusions: (begin [s], duration [s], name of the body or "" for all).
        occlusion_rate: random ones of all bodies [1/s].
        occlusion_length: mean duration of those [s].
        seed: of all that is random.
    """

    noise: float = 0.0
    rotation_noise: float = 0.0
    marker_noise: float = 0.0
    occlusions: tuple[tuple[float, float, str], ...] = ()
    occlusion_rate: float = 0.0
    occlusion_length: float = 0.3
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("noise", "rotation_noise", "marker_noise", "occlusion_rate", "occlusion_length"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ParameterError(f"{name} is {value}; valid: finite, 0 or more")
        if not all(math.isfinite(begin) and math.isfinite(duration) for begin, duration, _ in self.occlusions):
            raise ParameterError(f"occlusions are {self.occlusions}; valid: finite begin and duration")
        if self.seed < 0:
            raise ParameterError(f"seed is {self.seed}; valid: 0 or more")


@dataclass
class Scene:
    """Bodies and plates, as frames and as a description.

    Args:
        bodies: with different names and ids.
        plates: force plates.
        faults: what is wrong with what is seen.
        up: axis that points up in the stream, y or z.
        describe_plates: whether the description tells of the plates; some clients cannot read it.
    """

    bodies: tuple[Body, ...] = ()
    plates: tuple[Plate, ...] = ()
    faults: Faults = field(default_factory=Faults)
    up: str = "y"
    describe_plates: bool = True

    def __post_init__(self) -> None:
        if self.up not in UP_AXES:
            raise ParameterError(f"the axis that points up is {self.up!r}; valid: {', '.join(UP_AXES)}")
        for what, keys in (("names", {body.name for body in self.bodies}), ("streaming ids", {body.id for body in self.bodies})):
            if len(keys) != len(self.bodies):
                raise ParameterError(f"two bodies share one of the {what}: {', '.join(f'{body.name} ({body.id})' for body in self.bodies)}")
        self._last: dict[str, Pose] = {}
        self._blinks, self._noise = _Blinks(self.faults), _Noise(self.faults, self.bodies)

    def frame(self, number: int, time: float, period: float, suffix: Suffix = NO_SUFFIX) -> Frame:
        """What is seen at the middle of an exposure.

        Args:
            number: of the frame.
            time: of the stream [s].
            period: between frames [s]; the samples of a plate are spread over the one before `time`.
            suffix: of the frame.
        """
        bodies, markers, sets = [], [], []
        for body, noise in zip(self.bodies, self._noise.of(number), strict=True):
            exact = body.source(time)
            pose = self._noisy(exact or Pose(), noise)
            away = self._hidden(body.name, time)
            hidden = away or exact is None
            if not hidden:
                self._last[body.name] = pose
            if not (away if body.seen is not None else hidden):
                seen = self._markers(body, pose, noise, time)
                markers += seen
                sets.append(MarkerSet(body.name, tuple([marker.position for marker in seen])))
            told = pose_stream_axes(self.up, self._last.get(body.name, Pose()))
            error = self.faults.marker_noise
            bodies.append(RigidBody(body.id, told.position, told.orientation, error, 0 if hidden else TRACKED))
        positions = tuple([marker.position for marker in markers])
        plates = tuple([self._plate(plate, time, period) for plate in self.plates])
        return Frame(number, (*sets, MarkerSet("all", positions)), positions, tuple(bodies), (), (), tuple(markers), plates, (), suffix)

    def model(self) -> d.Model:
        """The description."""
        found: list[d.Description] = []
        for body in self.bodies:
            names = tuple(f"Marker{index}" for index in range(1, len(body.markers) + 1))
            found.append(d.MarkerSetDescription(body.name, names))
        found.append(
            d.MarkerSetDescription("all", tuple(f"{body.name}_{index}" for body in self.bodies for index in range(1, len(body.markers) + 1)))
        )
        for body in self.bodies:
            markers = [d.DescribedMarker(stream_axes(self.up, marker), 0, f"Marker{index}") for index, marker in enumerate(body.markers, 1)]
            found.append(d.RigidBodyDescription(body.name, body.id, markers=tuple(markers)))
        if self.describe_plates:
            found += [self._described(plate) for plate in self.plates]
        return d.Model(tuple(found))

    def _hidden(self, name: str, time: float) -> bool:
        for begin, duration, who in self.faults.occlusions:
            if begin <= time < begin + duration and who in ("", name):
                return True
        return self._blinks.at(time)

    def _noisy(self, pose: Pose, noise: Sequence[float]) -> Pose:
        faults, (x, y, z), orientation = self.faults, pose.position, pose.orientation
        if faults.rotation_noise:
            turn = from_rotation_vector([faults.rotation_noise * part for part in noise[3:6]])
            orientation = multiply(turn, orientation)
        size = faults.noise
        return Pose((x + size * noise[0], y + size * noise[1], z + size * noise[2]), orientation)

    def _markers(self, body: Body, pose: Pose, noise: Sequence[float], time: float) -> list[Marker]:
        size, up, found = self.faults.marker_noise, self.up, list[Marker]()
        places = [transform(pose, marker) for marker in body.markers] if body.seen is None else body.seen(time)
        for index, place in enumerate(places, 1):
            if place is None:
                continue
            (x, y, z), (dx, dy, dz) = place, noise[3 + 3 * index : 6 + 3 * index]
            position = stream_axes(up, (x + size * dx, y + size * dy, z + size * dz))
            found.append(Marker(body.id << 16 | index, position, MARKER_SIZE, MARKER_FLAGS, size))
        return found

    def _plate(self, plate: Plate, time: float, period: float) -> Analog:
        times = [time - period * (plate.samples - 1 - index) / plate.samples for index in range(plate.samples)]
        samples = [plate.source(at) for at in times]
        return Analog(plate.id, tuple(zip(*samples, strict=True)) if samples else ((),) * len(PLATE_CHANNELS))

    def _described(self, plate: Plate) -> d.ForcePlateDescription:
        x, y, z = plate.centre
        a, b, c, e = (stream_axes(self.up, (x + dx, y + dy, z)) for dx, dy in ((0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2)))
        identity = tuple(np.eye(12).ravel().tolist())
        return d.ForcePlateDescription(plate.id, plate.serial, 0.6, 0.4, (0.0, 0.0, 0.0), identity, (a, b, c, e), 2, 0, PLATE_CHANNELS)


class _Noise:
    """Standard normal numbers of each body in each frame: three for its position, three for its orientation, three for each marker. The same whoever
    asks for which frame when."""

    def __init__(self, faults: Faults, bodies: Sequence[Body]) -> None:
        self._seed, self._sizes = faults.seed, [6 + 3 * len(body.markers) for body in bodies]
        self._silent = not (faults.noise or faults.rotation_noise or faults.marker_noise)
        self._zeros = [[0.0] * size for size in self._sizes]
        self._block, self._rows = -1, list[list[list[float]]]()

    def of(self, number: int) -> list[list[float]]:
        """By body."""
        if self._silent:
            return self._zeros
        block, index = divmod(number, BLOCK)
        if block != self._block:
            drawn = np.random.default_rng((self._seed, block)).standard_normal((BLOCK, sum(self._sizes)))
            bodies = np.split(drawn, np.cumsum(self._sizes)[:-1], axis=1) if self._sizes else []
            self._block, self._rows = block, [list(row) for row in zip(*(body.tolist() for body in bodies), strict=True)] or [[]] * BLOCK
        return self._rows[index]


class _Blinks:
    """Random occlusions, drawn as time goes on."""

    def __init__(self, faults: Faults) -> None:
        self._faults, self._random = faults, np.random.default_rng((faults.seed, 2**31))
        self._begins: list[float] = []
        self._ends: list[float] = []
        self._until = 0.0

    def at(self, time: float) -> bool:
        """Whether one is going on."""
        if self._faults.occlusion_rate <= 0:
            return False
        while self._until <= time:
            begin = self._until + self._random.exponential(1 / self._faults.occlusion_rate)
            self._until = begin + self._random.exponential(self._faults.occlusion_length)
            self._begins.append(begin)
            self._ends.append(self._until)
        index = bisect_right(self._begins, time) - 1
        return index >= 0 and time < self._ends[index]
