"""Contents of a model description. Positions are metres, orientations x, y, z, w."""

from typing import NamedTuple

from hric_core.geometry import IDENTITY, ORIGIN, Quaternion, Vector

NO_PARENT = -1


class MarkerSetDescription(NamedTuple):
    """Named set of markers."""

    name: str
    markers: tuple[str, ...] = ()


class DescribedMarker(NamedTuple):
    """Marker of a rigid body.

    Attributes:
        position: position in the body. In a capture of Motive 2.1 (3.0) the sign of x was reversed against the streamed
            pose: try both.
        label: required active label, 0 for passive ones.
        name: name, from 4.0 on.
    """

    position: Vector
    label: int = 0
    name: str = ""


class RigidBodyDescription(NamedTuple):
    """Rigid body or bone. `rotation` to the parent exists from 4.2, `markers` from 3.0 on."""

    name: str
    id: int
    parent: int = NO_PARENT
    offset: Vector = ORIGIN
    rotation: Quaternion = IDENTITY
    markers: tuple[DescribedMarker, ...] = ()


class SkeletonDescription(NamedTuple):
    """Skeleton and its bones."""

    name: str
    id: int
    bodies: tuple[RigidBodyDescription, ...] = ()


class ForcePlateDescription(NamedTuple):
    """Force plate.

    Attributes:
        width, length: size [m].
        origin: electrical origin [m].
        calibration: 12 x 12, row by row.
        corners: four, in the world, clockwise from the plate's +x +y [m].
        plate_type: type as in C3D.
        data_type: 0 forces and torques [N, N m], 1 volts.
    """

    id: int
    serial: str
    width: float
    length: float
    origin: Vector
    calibration: tuple[float, ...]
    corners: tuple[Vector, Vector, Vector, Vector]
    plate_type: int = 2
    data_type: int = 0
    channels: tuple[str, ...] = ()


class DeviceDescription(NamedTuple):
    """Other analogue device."""

    id: int
    name: str
    serial: str
    device_type: int = 0
    data_type: int = 0
    channels: tuple[str, ...] = ()


class CameraDescription(NamedTuple):
    """Camera."""

    name: str
    position: Vector
    orientation: Quaternion


class AssetMarkerDescription(NamedTuple):
    """Marker of an asset."""

    name: str
    id: int
    position: Vector
    size: float
    flags: int = 0


class AssetDescription(NamedTuple):
    """Trained marker set (asset type 1), from 4.1 on."""

    name: str
    asset_type: int
    id: int
    bodies: tuple[RigidBodyDescription, ...] = ()
    markers: tuple[AssetMarkerDescription, ...] = ()


Description = (
    MarkerSetDescription
    | RigidBodyDescription
    | SkeletonDescription
    | ForcePlateDescription
    | DeviceDescription
    | CameraDescription
    | AssetDescription
)


class ServerModel(NamedTuple):
    """Complete description of a server.

    Attributes:
        skipped: bytes of descriptions of unknown types, and of unknown tails.
    """

    descriptions: tuple[Description, ...] = ()
    skipped: int = 0

    @property
    def bodies(self) -> dict[int, RigidBodyDescription]:
        """Rigid bodies, without bones, by streaming id."""
        return {body.id: body for body in self.descriptions if isinstance(body, RigidBodyDescription)}
