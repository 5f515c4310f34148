"""The payload of MODELDEF."""

from __future__ import annotations

import struct
from collections.abc import Callable

from mocap_natnet.codec.descriptions import (
    IDENTITY,
    AssetDescription,
    AssetMarkerDescription,
    CameraDescription,
    DescribedMarker,
    Description,
    DeviceDescription,
    ForcePlateDescription,
    MarkerSetDescription,
    Model,
    RigidBodyDescription,
    SkeletonDescription,
)
from mocap_natnet.codec.errors import CodecError
from mocap_natnet.codec.layout import Layout, text
from mocap_natnet.codec.reader import VECTOR, Reader

_TYPE_AND_SIZE = struct.Struct("<ii")
_QUATERNION = struct.Struct("<4f")
_TWO = struct.Struct("<ii")
_PLATE = struct.Struct("<ff3f144f12fii")
_CAMERA = struct.Struct("<3f4f")
_ASSET_MARKER = struct.Struct("<i3ffh")

Read = Callable[[Reader, Layout], Description]


def decode_model(layout: Layout, data: bytes, offset: int = 0, end: int | None = None) -> Model:
    """A model description.

    Args:
        layout: of the bitstream.
        data: datagram or payload.
        offset: where the payload begins.
        end: where it ends.

    Raises:
        CodecError: it cannot be read.
    """
    reader = Reader(data, offset, len(data) if end is None else end)
    found = [_description(reader, layout) for _ in range(reader.count(8))]
    return Model(tuple(description for description in found if description is not None), reader.skipped + reader.left)


def _description(reader: Reader, layout: Layout) -> Description | None:
    """One description; None for a type that is not known."""
    if not layout.sizes:
        kind = reader.integer()
        if kind not in _READ:
            raise CodecError(
                "unknown type", f"description of type {kind} at {reader.offset}; in bitstream {text(layout.version)} it cannot be skipped"
            )
        return _READ[kind](reader, layout)
    kind, size = reader.unpack(_TYPE_AND_SIZE)
    read = _READ.get(kind)
    return reader.sized(size, lambda inner: read(inner, layout) if read else None)


def _marker_set(reader: Reader, layout: Layout) -> MarkerSetDescription:
    name = reader.name()
    return MarkerSetDescription(name, reader.names(reader.count(1)))


def _body(reader: Reader, layout: Layout) -> RigidBodyDescription:
    name = reader.name()
    body, parent = reader.unpack(_TWO)
    offset = reader.unpack(VECTOR)
    rotation = reader.unpack(_QUATERNION) if layout.rotation_offset else IDENTITY
    markers = _body_markers(reader, layout) if layout.residual else ()
    return RigidBodyDescription(name, body, parent, offset, rotation, markers)


def _body_markers(reader: Reader, layout: Layout) -> tuple[DescribedMarker, ...]:
    """Three arrays, one after the other."""
    number = reader.count(VECTOR.size + 4 + layout.marker_names)
    positions = reader.array(VECTOR, number)
    labels = reader.unpack(struct.Struct(f"<{number}i"))
    names = reader.names(number) if layout.marker_names else ("",) * number
    return tuple(map(DescribedMarker, positions, labels, names))


def _bodies(reader: Reader, layout: Layout) -> tuple[RigidBodyDescription, ...]:
    return tuple(_body(reader, layout) for _ in range(reader.count(21)))


def _skeleton(reader: Reader, layout: Layout) -> SkeletonDescription:
    return SkeletonDescription(reader.name(), reader.integer(), _bodies(reader, layout))


def _plate(reader: Reader, layout: Layout) -> ForcePlateDescription:
    plate, serial = reader.integer(), reader.name()
    v = reader.unpack(_PLATE)
    corners = (v[149:152], v[152:155], v[155:158], v[158:161])
    channels = reader.names(reader.count(1))
    return ForcePlateDescription(plate, serial, v[0], v[1], v[2:5], v[5:149], corners, v[161], v[162], channels)


def _device(reader: Reader, layout: Layout) -> DeviceDescription:
    device, name, serial = reader.integer(), reader.name(), reader.name()
    device_type, data_type = reader.unpack(_TWO)
    return DeviceDescription(device, name, serial, device_type, data_type, reader.names(reader.count(1)))


def _camera(reader: Reader, layout: Layout) -> CameraDescription:
    name = reader.name()
    v = reader.unpack(_CAMERA)
    return CameraDescription(name, v[0:3], v[3:7])


def _asset(reader: Reader, layout: Layout) -> AssetDescription:
    name = reader.name()
    asset_type, asset = reader.unpack(_TWO)
    bodies = _bodies(reader, layout)
    markers = tuple(_asset_marker(reader) for _ in range(reader.count(1 + _ASSET_MARKER.size)))
    return AssetDescription(name, asset_type, asset, bodies, markers)


def _asset_marker(reader: Reader) -> AssetMarkerDescription:
    name = reader.name()
    v = reader.unpack(_ASSET_MARKER)
    return AssetMarkerDescription(name, v[0], v[1:4], v[4], v[5])


_READ: dict[int, Read] = {0: _marker_set, 1: _body, 2: _skeleton, 3: _plate, 4: _device, 5: _camera, 6: _asset}
"""By the type that stands before each description."""
