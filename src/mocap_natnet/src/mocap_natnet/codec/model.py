"""Payload of MODELDEF: decoder and encoder."""

import struct
from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any, NamedTuple

from hric_core.geometry import IDENTITY
from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec.layout import FIRST, SINCE, Layout, Version, text
from mocap_natnet.codec.reader import INT, VECTOR, CodecError, Reader

_TWO = struct.Struct("<ii")
_QUATERNION = struct.Struct("<4f")
_PLATE = struct.Struct("<ff3f144f12fii")
_CAMERA = struct.Struct("<3f4f")
_ASSET_MARKER = struct.Struct("<i3ffh")


def decode_model(layout: Layout, data: bytes, offset: int = 0, end: int | None = None) -> d.Model:
    """Return the model description of a payload.

    Args:
        layout: layout of the bitstream.
        data: datagram or payload.
        offset: start of the payload.
        end: end of the payload.

    Raises:
        CodecError: it cannot be read.
    """
    reader = Reader(data, offset, len(data) if end is None else end)
    found = [_read_description(reader, layout) for _ in range(reader.count(8))]
    return d.Model(tuple(description for description in found if description is not None), reader.skipped + reader.left)


def _read_description(reader: Reader, layout: Layout) -> d.Description | None:
    """Return one description; None for an unknown type."""
    if not layout.sizes:
        kind = reader.integer()
        if kind not in _KINDS:
            raise CodecError(
                "unknown type",
                f"description of type {kind} at {reader.offset}; in bitstream {text(layout.version)} it cannot "
                "be skipped",
            )
        return _KINDS[kind].read(reader, layout)
    kind, size = reader.unpack(_TWO)
    known = _KINDS.get(kind)
    return reader.sized(size, lambda inner: known.read(inner, layout) if known else None)


def _read_marker_set(reader: Reader, layout: Layout) -> d.MarkerSetDescription:
    name = reader.name()
    return d.MarkerSetDescription(name, reader.names(reader.count(1)))


def _read_body(reader: Reader, layout: Layout) -> d.RigidBodyDescription:
    name = reader.name()
    body, parent = reader.unpack(_TWO)
    offset = reader.unpack(VECTOR)
    rotation = reader.unpack(_QUATERNION) if layout.rotation_offset else IDENTITY
    markers = _read_body_markers(reader, layout) if layout.residual else ()
    return d.RigidBodyDescription(name, body, parent, offset, rotation, markers)


def _read_body_markers(reader: Reader, layout: Layout) -> tuple[d.DescribedMarker, ...]:
    """Return the markers from three consecutive arrays."""
    number = reader.count(VECTOR.size + 4 + layout.marker_names)
    positions = reader.array(VECTOR, number)
    labels = reader.unpack(struct.Struct(f"<{number}i"))
    names = reader.names(number) if layout.marker_names else ("",) * number
    return tuple(map(d.DescribedMarker, positions, labels, names))


def _read_bodies(reader: Reader, layout: Layout) -> tuple[d.RigidBodyDescription, ...]:
    return tuple(_read_body(reader, layout) for _ in range(reader.count(21)))


def _read_skeleton(reader: Reader, layout: Layout) -> d.SkeletonDescription:
    return d.SkeletonDescription(reader.name(), reader.integer(), _read_bodies(reader, layout))


def _read_plate(reader: Reader, layout: Layout) -> d.ForcePlateDescription:
    plate, serial = reader.integer(), reader.name()
    v = reader.unpack(_PLATE)
    corners = (v[149:152], v[152:155], v[155:158], v[158:161])
    channels = reader.names(reader.count(1))
    return d.ForcePlateDescription(plate, serial, v[0], v[1], v[2:5], v[5:149], corners, v[161], v[162], channels)


def _read_device(reader: Reader, layout: Layout) -> d.DeviceDescription:
    device, name, serial = reader.integer(), reader.name(), reader.name()
    device_type, data_type = reader.unpack(_TWO)
    return d.DeviceDescription(device, name, serial, device_type, data_type, reader.names(reader.count(1)))


def _read_camera(reader: Reader, layout: Layout) -> d.CameraDescription:
    name = reader.name()
    v = reader.unpack(_CAMERA)
    return d.CameraDescription(name, v[0:3], v[3:7])


def _read_asset(reader: Reader, layout: Layout) -> d.AssetDescription:
    name = reader.name()
    asset_type, asset = reader.unpack(_TWO)
    bodies = _read_bodies(reader, layout)
    markers = tuple(_read_asset_marker(reader) for _ in range(reader.count(1 + _ASSET_MARKER.size)))
    return d.AssetDescription(name, asset_type, asset, bodies, markers)


def _read_asset_marker(reader: Reader) -> d.AssetMarkerDescription:
    name = reader.name()
    v = reader.unpack(_ASSET_MARKER)
    return d.AssetMarkerDescription(name, v[0], v[1:4], v[4], v[5])


def encode_model(layout: Layout, model: d.Model) -> bytes:
    """Return the payload; descriptions that the bitstream lacks are left out."""
    parts = []
    for description in model.descriptions:
        number, kind = next((number, kind) for number, kind in _KINDS.items() if kind.description is type(description))
        if layout.version >= kind.since:
            content = kind.pack(description, layout)
            parts.append(INT.pack(number) + (INT.pack(len(content)) if layout.sizes else b"") + content)
    return INT.pack(len(parts)) + b"".join(parts)


def _pack_name(text: str) -> bytes:
    return text.encode() + b"\0"


def _pack_names(names: Iterable[str]) -> bytes:
    listed = list(names)
    return INT.pack(len(listed)) + b"".join(map(_pack_name, listed))


def _pack_marker_set(markers: d.MarkerSetDescription, layout: Layout) -> bytes:
    return _pack_name(markers.name) + _pack_names(markers.markers)


def _pack_body(body: d.RigidBodyDescription, layout: Layout) -> bytes:
    head = _pack_name(body.name) + struct.pack("<ii3f", body.id, body.parent, *body.offset)
    rotation = struct.pack("<4f", *body.rotation) if layout.rotation_offset else b""
    return head + rotation + (_pack_body_markers(body, layout) if layout.residual else b"")


def _pack_body_markers(body: d.RigidBodyDescription, layout: Layout) -> bytes:
    number = len(body.markers)
    positions = chain.from_iterable(marker.position for marker in body.markers)
    labels = (marker.label for marker in body.markers)
    names = b"".join(_pack_name(marker.name) for marker in body.markers) if layout.marker_names else b""
    return struct.pack(f"<i{3 * number}f{number}i", number, *positions, *labels) + names


def _pack_bodies(bodies: tuple[d.RigidBodyDescription, ...], layout: Layout) -> bytes:
    return INT.pack(len(bodies)) + b"".join(_pack_body(body, layout) for body in bodies)


def _pack_skeleton(skeleton: d.SkeletonDescription, layout: Layout) -> bytes:
    return _pack_name(skeleton.name) + INT.pack(skeleton.id) + _pack_bodies(skeleton.bodies, layout)


def _pack_plate(plate: d.ForcePlateDescription, layout: Layout) -> bytes:
    numbers = (plate.width, plate.length, *plate.origin, *plate.calibration, *chain.from_iterable(plate.corners))
    fields = struct.pack("<161fii", *numbers, plate.plate_type, plate.data_type)
    return INT.pack(plate.id) + _pack_name(plate.serial) + fields + _pack_names(plate.channels)


def _pack_device(device: d.DeviceDescription, layout: Layout) -> bytes:
    kinds = struct.pack("<ii", device.device_type, device.data_type)
    names = _pack_name(device.name) + _pack_name(device.serial)
    return INT.pack(device.id) + names + kinds + _pack_names(device.channels)


def _pack_camera(camera: d.CameraDescription, layout: Layout) -> bytes:
    return _pack_name(camera.name) + struct.pack("<7f", *camera.position, *camera.orientation)


def _pack_asset(asset: d.AssetDescription, layout: Layout) -> bytes:
    head = _pack_name(asset.name) + struct.pack("<ii", asset.asset_type, asset.id)
    markers = INT.pack(len(asset.markers)) + b"".join(map(_pack_asset_marker, asset.markers))
    return head + _pack_bodies(asset.bodies, layout) + markers


def _pack_asset_marker(marker: d.AssetMarkerDescription) -> bytes:
    return _pack_name(marker.name) + struct.pack("<i3ffh", marker.id, *marker.position, marker.size, marker.flags)


class _Kind(NamedTuple):
    """Type of description.

    Attributes:
        description: its class.
        read, pack: functions from and to its payload.
        since: first bitstream whose frames contain the described object; before it the description is left out.
    """

    description: type[d.Description]
    read: Callable[[Reader, Layout], d.Description]
    pack: Callable[[Any, Layout], bytes]
    since: Version = FIRST


_KINDS = {
    0: _Kind(d.MarkerSetDescription, _read_marker_set, _pack_marker_set),
    1: _Kind(d.RigidBodyDescription, _read_body, _pack_body),
    2: _Kind(d.SkeletonDescription, _read_skeleton, _pack_skeleton),
    3: _Kind(d.ForcePlateDescription, _read_plate, _pack_plate, SINCE["force_plates"]),
    4: _Kind(d.DeviceDescription, _read_device, _pack_device, SINCE["devices"]),
    5: _Kind(d.CameraDescription, _read_camera, _pack_camera),
    6: _Kind(d.AssetDescription, _read_asset, _pack_asset, SINCE["assets"]),
}
"""Types by the number before each description. The plate's fields are those of 3.0."""
