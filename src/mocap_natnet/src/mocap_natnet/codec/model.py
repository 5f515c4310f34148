"""Decoder and encoder of the payload of MODELDEF, the NatNet message with the description of the streamed objects.

Each type of description is declared once as a record of fields, each with a function to read and one to pack it.
"""

import struct
from collections.abc import Callable
from itertools import chain
from typing import Any, NamedTuple

from hric_core.geometry import IDENTITY
from mocap_natnet.codec import descriptions as d
from mocap_natnet.codec.layout import FIRST, SINCE, BitstreamLayout, Version, text
from mocap_natnet.codec.reader import INT, VECTOR, CodecError, Reader


class _Field(NamedTuple):
    """Field of a description: function that reads it from bytes, and function that packs it."""

    read: Callable[[Reader, BitstreamLayout], Any]
    pack: Callable[[Any, BitstreamLayout], bytes]


def _number(form: str) -> _Field:
    """Return a field with one number in a struct format."""
    binary_format = struct.Struct(f"<{form}")
    return _Field(
        lambda reader, layout: reader.unpack(binary_format)[0], lambda value, layout: binary_format.pack(value)
    )


def _floats(count: int) -> _Field:
    """Return a field with a tuple of `count` floats."""
    row = struct.Struct(f"<{count}f")
    return _Field(lambda reader, layout: reader.unpack(row), lambda values, layout: row.pack(*values))


def _many(field: _Field, size: int) -> _Field:
    """Return a field with a counted list of fields of at least `size` bytes each, as a tuple."""
    return _Field(
        lambda reader, layout: tuple(field.read(reader, layout) for _ in range(reader.count(size))),
        lambda values, layout: INT.pack(len(values)) + b"".join(field.pack(value, layout) for value in values),
    )


def _since(flag: str, field: _Field, absent: Any) -> _Field:
    """Return a field that is only in bitstreams whose layout has a flag; `absent`: its value in others."""
    return _Field(
        lambda reader, layout: field.read(reader, layout) if layout.has[flag] else absent,
        lambda value, layout: field.pack(value, layout) if layout.has[flag] else b"",
    )


def _record(kind: Callable[..., Any], *of: _Field) -> _Field:
    """Return a field with a named tuple, whose elements are fields in the same order."""
    return _Field(
        lambda reader, layout: kind(*(field.read(reader, layout) for field in of)),
        lambda record, layout: b"".join(field.pack(value, layout) for field, value in zip(of, record, strict=True)),
    )


def _read_body_markers(reader: Reader, layout: BitstreamLayout) -> tuple[d.DescribedMarker, ...]:
    """Read the markers of a rigid body from consecutive arrays of positions, labels and names."""
    number = reader.count(VECTOR.size + 4 + layout.has["marker_names"])
    positions = reader.array(VECTOR, number)
    labels = reader.unpack(struct.Struct(f"<{number}i"))
    names = reader.names(number) if layout.has["marker_names"] else ("",) * number
    return tuple(map(d.DescribedMarker, positions, labels, names))


def _pack_body_markers(markers: tuple[d.DescribedMarker, ...], layout: BitstreamLayout) -> bytes:
    number = len(markers)
    positions, labels = chain.from_iterable(marker.position for marker in markers), (marker.label for marker in markers)
    names = b"".join(_NAME.pack(marker.name, layout) for marker in markers) if layout.has["marker_names"] else b""
    return struct.pack(f"<i{3 * number}f{number}i", number, *positions, *labels) + names


_NAME = _Field(lambda reader, layout: reader.name(), lambda name, layout: name.encode() + b"\0")
_INT, _FLOAT, _VECTOR, _QUATERNION = _number("i"), _number("f"), _floats(3), _floats(4)
_NAMES = _many(_NAME, 1)
_CORNERS = _Field(
    lambda reader, layout: tuple(reader.array(VECTOR, 4)),
    lambda corners, layout: b"".join(VECTOR.pack(*corner) for corner in corners),
)
_ROTATION = _since("rotation_offset", _QUATERNION, IDENTITY)
_BODY_MARKERS = _since("residual", _Field(_read_body_markers, _pack_body_markers), ())
_BODY = _record(d.RigidBodyDescription, _NAME, _INT, _INT, _VECTOR, _ROTATION, _BODY_MARKERS)
_BODIES = _many(_BODY, 21)
_ASSET_MARKERS = _many(_record(d.AssetMarkerDescription, _NAME, _INT, _VECTOR, _FLOAT, _number("h")), 23)
_PLATE = (_INT, _NAME, _FLOAT, _FLOAT, _VECTOR, _floats(144), _CORNERS, _INT, _INT, _NAMES)


class _Kind(NamedTuple):
    """Type of description.

    Attributes:
        description: class of the description.
        since: first bitstream whose frames contain the described object; before it the description is left out.
        fields: fields of its payload.
    """

    description: type[d.Description]
    since: Version
    fields: _Field


def _kind(description: type[d.Description], *of: _Field, since: Version = FIRST) -> _Kind:
    return _Kind(description, since, _record(description, *of))


_KINDS = {
    0: _kind(d.MarkerSetDescription, _NAME, _NAMES),
    1: _Kind(d.RigidBodyDescription, FIRST, _BODY),
    2: _kind(d.SkeletonDescription, _NAME, _INT, _BODIES),
    3: _kind(d.ForcePlateDescription, *_PLATE, since=SINCE["force_plates"]),
    4: _kind(d.DeviceDescription, _INT, _NAME, _NAME, _INT, _INT, _NAMES, since=SINCE["devices"]),
    5: _kind(d.CameraDescription, _NAME, _VECTOR, _QUATERNION),
    6: _kind(d.AssetDescription, _NAME, _INT, _INT, _BODIES, _ASSET_MARKERS, since=SINCE["assets"]),
}
"""Types of description by their number in the payload. The plate's fields are those of bitstream 3.0."""


def decode_model(layout: BitstreamLayout, data: bytes, offset: int = 0, end: int | None = None) -> d.ServerModel:
    """Return the model description in a payload.

    Args:
        layout: layout of the bitstream.
        data: datagram or payload.
        offset: start of the payload.
        end: end of the payload.

    Raises:
        CodecError: the payload cannot be read.
    """
    reader = Reader(data, offset, len(data) if end is None else end)
    descriptions = [_read_description(reader, layout) for _ in range(reader.count(8))]
    return d.ServerModel(
        tuple(description for description in descriptions if description is not None), reader.skipped + reader.left
    )


def _read_description(reader: Reader, layout: BitstreamLayout) -> d.Description | None:
    """Read one description; return None for an unknown type."""
    if not layout.has["sizes"]:
        kind = reader.integer()
        if kind not in _KINDS:
            raise CodecError(
                "unknown type",
                f"description of type {kind} at {reader.offset}; in bitstream {text(layout.version)} it cannot "
                "be skipped",
            )
        return _description(reader, layout, kind)
    kind, size = reader.integer(), reader.integer()
    return reader.sized(size, lambda inner: _description(inner, layout, kind) if kind in _KINDS else None)


def _description(reader: Reader, layout: BitstreamLayout, kind: int) -> d.Description:
    description: d.Description = _KINDS[kind].fields.read(reader, layout)
    return description


def encode_model(layout: BitstreamLayout, model: d.ServerModel) -> bytes:
    """Return the payload of a model description; types that the bitstream lacks are left out."""
    parts = []
    for description in model.descriptions:
        number, kind = next((number, kind) for number, kind in _KINDS.items() if kind.description is type(description))
        if layout.version >= kind.since:
            content = kind.fields.pack(description, layout)
            parts.append(INT.pack(number) + (INT.pack(len(content)) if layout.has["sizes"] else b"") + content)
    return INT.pack(len(parts)) + b"".join(parts)
