"""Scene of the emulated cameras: rigid bodies with markers, skeletons, force plates, and measurement faults."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry.poses import UP_AXES, Pose, from_z_up, pose_from_z_up, transformed
from hric_core.geometry.quaternions import Vector, from_rotation_vector, product
from hric_core.parameters import Parameter, Settings, listing, number, numbers, whole
from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec import types as t
from mocap_natnet.codec.types import OF_ASSET, POINT_CLOUD, TRACKED, Analog, Frame, Marker, MarkerSet, RigidBody, Suffix
from mocap_natnet.server.skeleton import ServedSkeleton
from mocap_natnet.server.sources import Source

TRIANGLE: tuple[Vector, ...] = ((0.06, -0.02, 0.0), (-0.04, -0.03, 0.0), (-0.02, 0.05, 0.0))
"""Default positions of three markers in a body, a triangle with three different sides [m].

Project default, unconfirmed.
"""
MARKER_SIZE = 0.014
"""Diameter of a common passive marker [m]."""
MARKER_FLAGS = POINT_CLOUD | OF_ASSET
"""Flags of an asset's marker, as in captures."""
PLATE_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
NO_SUFFIX = Suffix()
BLOCK = 64
"""Number of frames whose noise is drawn at once; making a generator costs as much as the rest of a frame."""


@dataclass(frozen=True)
class SceneBody:
    """Rigid body in the scene of the emulated cameras.

    Args:
        name: name in the description.
        source: source of its motion.
        id: streaming id, 1 to 32767.
        markers: positions of the markers in the body, z up [m].
        seen: function from stream time [s] to the measured position of each marker, z up [m], or None if that marker is
            not visible. None: the positions are computed from the pose.
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
class ServedPlate:
    """Force plate of 0.6 x 0.4 m.

    Args:
        source: function from stream time [s] to Fx, Fy, Fz [N], Mx, My, Mz [N m], in the plate's axes.
        id, serial: id and serial number in the description.
        centre: centre of the surface, z up [m].
        samples: number of samples per frame of the cameras.
    """

    source: Callable[[float], tuple[float, ...]]
    id: int = 1
    serial: str = "emulated-1"
    centre: Vector = (0.0, 0.0, 0.0)
    samples: int = 5


def _occlusion(value: Any, where: str, joints: Sequence[str]) -> tuple[float, float, str]:
    """Return (begin [s], duration [s], body or "") of the row [begin, duration] or [begin, duration, body]."""
    named = isinstance(value, list | tuple) and len(value) == 3
    span, body = (value[:2], value[2]) if named else (value, "")
    if not isinstance(body, str):
        raise ValueError
    begin, duration = numbers(2, unit="s").checked(span, where)
    return begin, duration, body


OCCLUSION = Parameter("row", "[begin, duration] or [begin, duration, body]", _occlusion, unit="s")


@dataclass(frozen=True)
class CameraFaults(Settings):
    """Measurement faults of the emulated cameras; equal for equal seeds."""

    noise: float = number(0.0, minimum=0.0, unit="m", text="noise of positions of bodies, standard deviation per axis")
    rotation_noise: float = number(
        0.0, minimum=0.0, unit="rad", text="noise of orientations of bodies, standard deviation per axis"
    )
    marker_noise: float = number(
        0.0, minimum=0.0, unit="m", text="additional noise of each marker, standard deviation per axis"
    )
    occlusions: tuple[tuple[float, float, str], ...] = listing(
        OCCLUSION, default=(), text="occlusions; without a body: of all bodies"
    )
    occlusion_rate: float = number(0.0, minimum=0.0, unit="1/s", text="rate of random occlusions of all bodies")
    occlusion_length: float = number(0.3, minimum=0.0, unit="s", text="mean duration of random occlusions")
    seed: int = whole(0, minimum=0, text="seed of all randomness")


@dataclass
class ServedScene:
    """Scene of the emulated cameras: bodies, plates and skeletons, as frames and as a description.

    Args:
        bodies: rigid bodies with different names and ids.
        plates: force plates.
        faults: measurement faults.
        up: axis that points up in the stream, y or z.
        describe_plates: True if the description contains the plates, which some clients cannot read.
        skeletons: skeletons with names and ids that no body has.
    """

    bodies: tuple[SceneBody, ...] = ()
    plates: tuple[ServedPlate, ...] = ()
    faults: CameraFaults = field(default_factory=CameraFaults)
    up: str = "y"
    describe_plates: bool = True
    skeletons: tuple[ServedSkeleton, ...] = ()

    def __post_init__(self) -> None:
        if self.up not in UP_AXES:
            raise ParameterError(f"the axis that points up is {self.up!r}; valid: {', '.join(UP_AXES)}")
        assets: list[SceneBody | ServedSkeleton] = [*self.bodies, *self.skeletons]
        for what, keys in (
            ("names", {asset.name for asset in assets}),
            ("streaming ids", {asset.id for asset in assets}),
        ):
            if len(keys) != len(assets):
                raise ParameterError(
                    f"two bodies share one of the {what}: {', '.join(f'{asset.name} ({asset.id})' for asset in assets)}"
                )
        self._last: dict[str, Pose] = {}
        sizes = [6 + 3 * len(body.markers) for body in self.bodies]
        sizes += [6 * len(skeleton.bones) + 3 * len(skeleton.markers) for skeleton in self.skeletons]
        self._blinks, self._noise = _Blinks(self.faults), _Noise(self.faults, sizes)

    def frame(self, number: int, time: float, period: float, suffix: Suffix = NO_SUFFIX) -> Frame:
        """Return the frame that the cameras measure at one exposure.

        Args:
            number: number of the frame.
            time: stream time of the middle of the exposure [s].
            period: time between frames [s]; the samples of a plate are spread over the period before `time`.
            suffix: suffix of the frame.
        """
        bodies, markers, sets, noises = list[RigidBody](), list[Marker](), list[MarkerSet](), self._noise.of(number)
        for body, noise in zip(self.bodies, noises, strict=False):
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
            streamed = pose_from_z_up(self.up, self._last.get(body.name, Pose()))
            error = self.faults.marker_noise
            bodies.append(RigidBody(body.id, streamed.position, streamed.orientation, error, 0 if hidden else TRACKED))
        skeletons = []
        for skeleton, noise in zip(self.skeletons, noises[len(self.bodies) :], strict=True):
            bones, seen = self._skeleton(skeleton, noise, time)
            skeletons.append(t.Skeleton(skeleton.id, tuple(bones)))
            markers += seen
            sets.append(MarkerSet(skeleton.name, tuple([marker.position for marker in seen])))
        positions = tuple([marker.position for marker in markers])
        plates = tuple([self._plate(plate, time, period) for plate in self.plates])
        return Frame(
            number,
            (*sets, MarkerSet("all", positions)),
            positions,
            tuple(bodies),
            tuple(skeletons),
            (),
            tuple(markers),
            plates,
            (),
            suffix,
        )

    def model(self) -> d.ServerModel:
        """Return the description of the scene, as a client requests it."""
        named = {body.name: [f"Marker{index}" for index, _ in enumerate(body.markers, 1)] for body in self.bodies}
        named |= {skeleton.name: list(skeleton.markers) for skeleton in self.skeletons}
        descriptions: list[d.Description] = [
            d.MarkerSetDescription(name, tuple(names)) for name, names in named.items()
        ]
        labels = [f"{body.name}_{index}" for body in self.bodies for index in range(1, len(body.markers) + 1)]
        labels += [f"{skeleton.name}_{name}" for skeleton in self.skeletons for name in skeleton.markers]
        descriptions.append(d.MarkerSetDescription("all", tuple(labels)))
        for body in self.bodies:
            markers = [
                d.DescribedMarker(from_z_up(self.up, marker), 0, f"Marker{index}")
                for index, marker in enumerate(body.markers, 1)
            ]
            descriptions.append(d.RigidBodyDescription(body.name, body.id, markers=tuple(markers)))
        descriptions += [skeleton.described(self.up) for skeleton in self.skeletons]
        if self.describe_plates:
            descriptions += [self._described(plate) for plate in self.plates]
        return d.ServerModel(tuple(descriptions))

    def _hidden(self, name: str, time: float) -> bool:
        hidden = (
            begin <= time < begin + duration and who in ("", name) for begin, duration, who in self.faults.occlusions
        )
        return any(hidden) or self._blinks.at(time)

    def _noisy(self, pose: Pose, noise: Sequence[float]) -> Pose:
        faults, (x, y, z), orientation = self.faults, pose.position, pose.orientation
        if faults.rotation_noise:
            error = from_rotation_vector([faults.rotation_noise * part for part in noise[3:6]])
            orientation = product(error, orientation)
        size = faults.noise
        return Pose((x + size * noise[0], y + size * noise[1], z + size * noise[2]), orientation)

    def _markers(self, body: SceneBody, pose: Pose, noise: Sequence[float], time: float) -> list[Marker]:
        positions = [transformed(pose, marker) for marker in body.markers] if body.seen is None else body.seen(time)
        return self._labelled(body.id, positions, noise[6:])

    def _labelled(self, asset: int, positions: Sequence[Vector | None], noise: Sequence[float]) -> list[Marker]:
        """Return the visible markers of a body or skeleton (`asset`: its streaming id), with noise."""
        size, up, markers = self.faults.marker_noise, self.up, list[Marker]()
        for index, exact in enumerate(positions, 1):
            if exact is None:
                continue
            (x, y, z), (dx, dy, dz) = exact, noise[3 * index - 3 : 3 * index]
            position = from_z_up(up, (x + size * dx, y + size * dy, z + size * dz))
            markers.append(Marker(asset << 16 | index, position, MARKER_SIZE, MARKER_FLAGS, size))
        return markers

    def _skeleton(
        self, skeleton: ServedSkeleton, noise: Sequence[float], time: float
    ) -> tuple[list[RigidBody], list[Marker]]:
        """Return a skeleton's bones, in global coordinates, and its markers; both are occluded together."""
        poses, positions = skeleton.source(time)
        hidden = self._hidden(skeleton.name, time)
        bones = [
            self._bone(skeleton.id << 16 | number, pose, noise[6 * number - 6 : 6 * number], hidden)
            for number, pose in enumerate(poses, 1)
        ]
        return bones, [] if hidden else self._labelled(skeleton.id, positions, noise[6 * len(bones) :])

    def _bone(self, number: int, exact: Pose, noise: Sequence[float], hidden: bool) -> RigidBody:
        pose = pose_from_z_up(self.up, self._noisy(exact, noise))
        return RigidBody(number, pose.position, pose.orientation, self.faults.marker_noise, 0 if hidden else TRACKED)

    def _plate(self, plate: ServedPlate, time: float, period: float) -> Analog:
        times = [time - period * (plate.samples - 1 - index) / plate.samples for index in range(plate.samples)]
        samples = [plate.source(at) for at in times]
        return Analog(plate.id, tuple(zip(*samples, strict=True)) if samples else ((),) * len(PLATE_CHANNELS))

    def _described(self, plate: ServedPlate) -> d.ForcePlateDescription:
        x, y, z = plate.centre
        a, b, c, e = (
            from_z_up(self.up, (x + dx, y + dy, z)) for dx, dy in ((0.3, 0.2), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2))
        )
        identity = tuple(np.eye(12).ravel().tolist())
        return d.ForcePlateDescription(
            plate.id, plate.serial, 0.6, 0.4, (0.0, 0.0, 0.0), identity, (a, b, c, e), 2, 0, PLATE_CHANNELS
        )


class _Noise:
    """Standard normal random numbers for each body and skeleton in each frame, independent of the order of calls.

    Each body or bone has three for its position and three for its orientation, each marker has three.
    """

    def __init__(self, faults: CameraFaults, sizes: Sequence[int]) -> None:
        self._seed, self._sizes = faults.seed, sizes
        self._silent = not (faults.noise or faults.rotation_noise or faults.marker_noise)
        self._zeros = [[0.0] * size for size in self._sizes]
        self._block, self._rows = -1, list[list[list[float]]]()

    def of(self, number: int) -> list[list[float]]:
        """Return the random numbers of a frame, by body and then by skeleton; number: number of the frame."""
        if self._silent:
            return self._zeros
        block, index = divmod(number, BLOCK)
        if block != self._block:
            drawn = np.random.default_rng((self._seed, block)).standard_normal((BLOCK, sum(self._sizes)))
            bodies = np.split(drawn, np.cumsum(self._sizes)[:-1], axis=1) if self._sizes else []
            self._block, self._rows = (
                block,
                [list(row) for row in zip(*(body.tolist() for body in bodies), strict=True)] or [[]] * BLOCK,
            )
        return self._rows[index]


class _Blinks:
    """Random occlusions of all bodies, drawn as time advances."""

    def __init__(self, faults: CameraFaults) -> None:
        self._faults, self._random = faults, np.random.default_rng((faults.seed, 2**31))
        self._begins: list[float] = []
        self._ends: list[float] = []
        self._until = 0.0

    def at(self, time: float) -> bool:
        """Return True if a random occlusion lasts at a stream time [s]."""
        if self._faults.occlusion_rate <= 0:
            return False
        while self._until <= time:
            begin = self._until + self._random.exponential(1 / self._faults.occlusion_rate)
            self._until = begin + self._random.exponential(self._faults.occlusion_length)
            self._begins.append(begin)
            self._ends.append(self._until)
        index = bisect_right(self._begins, time) - 1
        return index >= 0 and time < self._ends[index]
