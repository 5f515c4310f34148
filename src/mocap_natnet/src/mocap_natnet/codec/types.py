"""Contents of a NatNet frame.

Positions are in metres, orientations are quaternions x, y, z, w, both in the axes of the stream.
"""

from typing import NamedTuple

from hric_core.geometry import Quaternion, Vector

TRACKED = 0x01
"""Flag of a rigid body: tracking is valid in this frame. Without it the pose is meaningless."""
OCCLUDED, POINT_CLOUD, MODEL_FILLED, OF_ASSET, UNLABELLED, ACTIVE, ESTABLISHED, MEASUREMENT = (
    1 << bit for bit in range(8)
)
"""Flags of a labelled marker."""
RECORDING, MODEL_CHANGED, EDIT_MODE, VERSION_CHANGED = (1 << bit for bit in range(4))
"""Flags of a frame."""


class MarkerSet(NamedTuple):
    """Named set of markers; the last set of a frame contains all markers."""

    name: str
    positions: tuple[Vector, ...]


class BodyMarker(NamedTuple):
    """Marker of a rigid body, in bitstreams below 3.0."""

    position: Vector
    id: int
    size: float


class RigidBody(NamedTuple):
    """Pose of a rigid body, or of a bone of a skeleton or asset, whose id is skeleton id << 16 | number of the bone.

    Attributes:
        mean_error: mean error of the body's markers [m].
        flags: TRACKED or 0; always TRACKED if the bitstream has no flags.
        markers: markers of the body, only in bitstreams below 3.0.
    """

    id: int
    position: Vector
    orientation: Quaternion
    mean_error: float = 0.0
    flags: int = TRACKED
    markers: tuple[BodyMarker, ...] = ()


class Marker(NamedTuple):
    """Labelled marker.

    Attributes:
        id: for passive markers of an asset, (asset id << 16) + number of the marker in the asset, from 1 on.
        size: diameter [m].
        flags: OCCLUDED ... MEASUREMENT; 0 if the bitstream has none.
        residual: residual of the triangulation [m per ray], in bitstreams from 3.0 on.
    """

    id: int
    position: Vector
    size: float
    flags: int = 0
    residual: float = 0.0


class Skeleton(NamedTuple):
    """Skeleton: poses of its bones."""

    id: int
    bodies: tuple[RigidBody, ...]


class Asset(NamedTuple):
    """Trained marker set, in bitstreams from 4.1 on."""

    id: int
    bodies: tuple[RigidBody, ...]
    markers: tuple[Marker, ...]


class Analog(NamedTuple):
    """Force plate or other analogue device: samples of each channel in a frame; channels may differ in number."""

    id: int
    channels: tuple[tuple[float, ...], ...]


class Suffix(NamedTuple):
    """End of a frame: its times and flags. Fields that the bitstream lacks are 0.

    Attributes:
        latency: latency of the software, in bitstreams below 3.0 [s, or ms in 2.10].
        time_stamp: time since the software started [s].
        mid_exposure, received, transmitted: ticks of the server's clock, from bitstream 3.0 on; mid_exposure is 0 if
            the cameras do not report it.
        precision_seconds, precision_fraction: time by the precision time protocol, from bitstream 4.1 on.
        flags: RECORDING, MODEL_CHANGED, EDIT_MODE, VERSION_CHANGED.
    """

    latency: float = 0.0
    time_code: int = 0
    time_code_subframe: int = 0
    time_stamp: float = 0.0
    mid_exposure: int = 0
    received: int = 0
    transmitted: int = 0
    precision_seconds: int = 0
    precision_fraction: int = 0
    flags: int = 0


class Frame(NamedTuple):
    """Frame: everything that the server streams for one exposure of the cameras.

    Attributes:
        unlabelled: positions of the legacy list of markers; prefer `markers`.
        skipped: number of unknown bytes at the ends of sections and of the frame; 0 in the known bitstreams.
    """

    number: int
    marker_sets: tuple[MarkerSet, ...] = ()
    unlabelled: tuple[Vector, ...] = ()
    bodies: tuple[RigidBody, ...] = ()
    skeletons: tuple[Skeleton, ...] = ()
    assets: tuple[Asset, ...] = ()
    markers: tuple[Marker, ...] = ()
    force_plates: tuple[Analog, ...] = ()
    devices: tuple[Analog, ...] = ()
    suffix: Suffix = Suffix()
    skipped: int = 0
