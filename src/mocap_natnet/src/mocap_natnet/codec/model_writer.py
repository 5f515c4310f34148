"""Writes the payload of MODELDEF: the other direction of `model`."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from itertools import chain
from typing import Any

from mocap_natnet.codec.descriptions import (
    AssetDescription,
    AssetMarkerDescription,
    CameraDescription,
    Description,
    DeviceDescription,
    ForcePlateDescription,
    MarkerSetDescription,
    Model,
    RigidBodyDescription,
    SkeletonDescription,
)
from mocap_natnet.codec.layout import SINCE, Layout

_SINCE = {ForcePlateDescription: SINCE["force_plates"], DeviceDescription: SINCE["devices"], AssetDescription: SINCE["assets"]}
"""First bitstream whose frames hold what is described; before it the description is left out. The plate's fields are those of 3.0."""


def encode_model(layout: Layout, model: Model) -> bytes:
    """The payload; descriptions that the bitstream lacks are left out."""
    parts = []
    for description in model.descriptions:
        if layout.version >= _SINCE.get(type(description), (0, 0)):
            kind, write = _WRITE[type(description)]
            content = write(description, layout)
            parts.append(struct.pack("<i", kind) + (struct.pack("<i", len(content)) if layout.sizes else b"") + content)
    return struct.pack("<i", len(parts)) + b"".join(parts)


def _name(text: str) -> bytes:
    return text.encode() + b"\0"


def _names(names: Iterable[str]) -> bytes:
    listed = list(names)
    return struct.pack("<i", len(listed)) + b"".join(map(_name, listed))


def _marker_set(markers: MarkerSetDescription, layout: Layout) -> bytes:
    return _name(markers.name) + _names(markers.markers)


def _body(body: RigidBodyDescription, layout: Layout) -> bytes:
    head = _name(body.name) + struct.pack("<ii3f", body.id, body.parent, *body.offset)
    rotation = struct.pack("<4f", *body.rotation) if layout.rotation_offset else b""
    return head + rotation + (_body_markers(body, layout) if layout.residual else b"")


def _body_markers(body: RigidBodyDescription, layout: Layout) -> bytes:
    number = len(body.markers)
    positions = chain.from_iterable(marker.position for marker in body.markers)
    labels = (marker.label for marker in body.markers)
    names = b"".join(_name(marker.name) for marker in body.markers) if layout.marker_names else b""
    return struct.pack(f"<i{3 * number}f{number}i", number, *positions, *labels) + names


def _bodies(bodies: tuple[RigidBodyDescription, ...], layout: Layout) -> bytes:
    return struct.pack("<i", len(bodies)) + b"".join(_body(body, layout) for body in bodies)


def _skeleton(skeleton: SkeletonDescription, layout: Layout) -> bytes:
    return _name(skeleton.name) + struct.pack("<i", skeleton.id) + _bodies(skeleton.bodies, layout)


def _plate(plate: ForcePlateDescription, layout: Layout) -> bytes:
    numbers = (plate.width, plate.length, *plate.origin, *plate.calibration, *chain.from_iterable(plate.corners))
    fields = struct.pack("<161fii", *numbers, plate.plate_type, plate.data_type)
    return struct.pack("<i", plate.id) + _name(plate.serial) + fields + _names(plate.channels)


def _device(device: DeviceDescription, layout: Layout) -> bytes:
    kinds = struct.pack("<ii", device.device_type, device.data_type)
    return struct.pack("<i", device.id) + _name(device.name) + _name(device.serial) + kinds + _names(device.channels)


def _camera(camera: CameraDescription, layout: Layout) -> bytes:
    return _name(camera.name) + struct.pack("<7f", *camera.position, *camera.orientation)


def _asset(asset: AssetDescription, layout: Layout) -> bytes:
    head = _name(asset.name) + struct.pack("<ii", asset.asset_type, asset.id)
    markers = struct.pack("<i", len(asset.markers)) + b"".join(map(_asset_marker, asset.markers))
    return head + _bodies(asset.bodies, layout) + markers


def _asset_marker(marker: AssetMarkerDescription) -> bytes:
    return _name(marker.name) + struct.pack("<i3ffh", marker.id, *marker.position, marker.size, marker.flags)


_WRITE: dict[type[Description], tuple[int, Callable[[Any, Layout], bytes]]] = {
    MarkerSetDescription: (0, _marker_set),
    RigidBodyDescription: (1, _body),
    SkeletonDescription: (2, _skeleton),
    ForcePlateDescription: (3, _plate),
    DeviceDescription: (4, _device),
    CameraDescription: (5, _camera),
    AssetDescription: (6, _asset),
}
