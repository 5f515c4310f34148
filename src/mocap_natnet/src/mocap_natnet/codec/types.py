"""Contents of a frame. Positions are metres and orientations x, y, z, w, both in the axes of the stream."""

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
    """Named markers; the last set of a frame contains all of them."""

    name: str
    positions: tuple[Vector, ...]


class BodyMarker(NamedTuple):
    """Marker within a rigid body, bitstreams below 3.0."""

    position: Vector
    id: int
    size: float


class RigidBody(NamedTuple):
    """Rigid body, also a bone of a skeleton or of an asset (whose id is skeleton id << 16 | number of the bone).

    Attributes:
        mean_error: mean error of its markers [m].
        flags: TRACKED; always set if the bitstream has no flags.
        markers: bitstreams below 3.0 only.
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
        id: (asset id << 16) + number of the member counted from 1, for passive markers of an asset.
        size: diameter [m].
        flags: OCCLUDED ... MEASUREMENT; 0 if the bitstream has none.
        residual: [m per ray], from 3.0 on.
    """

    id: int
    position: Vector
    size: float
    flags: int = 0
    residual: float = 0.0


class Skeleton(NamedTuple):
    """Bones of a skeleton."""

    id: int
    bodies: tuple[RigidBody, ...]


class Asset(NamedTuple):
    """Trained marker set, from 4.1 on."""

    id: int
    bodies: tuple[RigidBody, ...]
    markers: tuple[Marker, ...]


class Analog(NamedTuple):
    """Force plate or other analogue device: the samples of each channel in this frame, whose numbers may differ."""

    id: int
    channels: tuple[tuple[float, ...], ...]


class Suffix(NamedTuple):
    """End of a frame; 0 if the bitstream lacks it.

    Attributes:
        latency: latency of the software, below 3.0 [s, or ms in 2.10].
        time_stamp: time since the software started [s].
        mid_exposure, received, transmitted: ticks of the server's clock, from 3.0 on; mid_exposure is 0 if the cameras
            do not report it.
        precision_seconds, precision_fraction: precision time protocol, from 4.1 on.
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
    """Frame of the cameras.

    Attributes:
        unlabelled: positions of the legacy list; prefer `markers`.
        skipped: unknown bytes at the ends of sections and of the frame; 0 in the known bitstreams.
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
