"""Contents of a model description, by which a NatNet server names what it streams.

Positions are in metres, orientations are quaternions x, y, z, w.
"""

from typing import NamedTuple

from hric_core.geometry import IDENTITY, ORIGIN, Quaternion, Vector

NO_PARENT = -1


class MarkerSetDescription(NamedTuple):
    """Description of a named set of markers."""

    name: str
    markers: tuple[str, ...] = ()


class DescribedMarker(NamedTuple):
    """Description of a marker of a rigid body.

    Attributes:
        position: position in the body [m]. In a capture of Motive 2.1 (bitstream 3.0), the sign of x was opposite to
            that of the streamed pose: try both.
        label: required active label, 0 for passive ones.
        name: name of the marker, from bitstream 4.0 on.
    """

    position: Vector
    label: int = 0
    name: str = ""


class RigidBodyDescription(NamedTuple):
    """Description of a rigid body or bone; `rotation` to the parent is in bitstreams from 4.2, `markers` from 3.0."""

    name: str
    id: int
    parent: int = NO_PARENT
    offset: Vector = ORIGIN
    rotation: Quaternion = IDENTITY
    markers: tuple[DescribedMarker, ...] = ()


class SkeletonDescription(NamedTuple):
    """Description of a skeleton and its bones."""

    name: str
    id: int
    bodies: tuple[RigidBodyDescription, ...] = ()


class ForcePlateDescription(NamedTuple):
    """Description of a force plate.

    Attributes:
        width, length: size of the surface [m].
        origin: electrical origin [m].
        calibration: matrix 12 x 12, row by row.
        corners: corners in the axes of the stream, clockwise from the plate's +x +y [m].
        plate_type: type of the plate as in C3D.
        data_type: 0: forces and torques [N, N m], 1: volts.
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
    """Description of an analogue device that is not a force plate."""

    id: int
    name: str
    serial: str
    device_type: int = 0
    data_type: int = 0
    channels: tuple[str, ...] = ()


class CameraDescription(NamedTuple):
    """Description of a camera."""

    name: str
    position: Vector
    orientation: Quaternion


class AssetMarkerDescription(NamedTuple):
    """Description of a marker of an asset (trained marker set)."""

    name: str
    id: int
    position: Vector
    size: float
    flags: int = 0


class AssetDescription(NamedTuple):
    """Description of a trained marker set (asset type 1), in bitstreams from 4.1 on."""

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
    """Complete description of what a server streams.

    Attributes:
        skipped: number of bytes skipped: descriptions of unknown types, and unknown ends of known ones.
    """

    descriptions: tuple[Description, ...] = ()
    skipped: int = 0

    @property
    def bodies(self) -> dict[int, RigidBodyDescription]:
        """Descriptions of rigid bodies, without bones, by streaming id."""
        return {body.id: body for body in self.descriptions if isinstance(body, RigidBodyDescription)}
