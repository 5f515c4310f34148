"""Decoder and encoder of the payload of FRAMEOFDATA, the NatNet message with a frame."""

import functools
import struct
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, TypeVar

from hric_core.geometry import Vector
from mocap_natnet.codec.layout import BitstreamLayout
from mocap_natnet.codec.reader import COUNT_AND_SIZE, INT, VECTOR, CodecError, Reader
from mocap_natnet.codec.types import (
    TRACKED,
    Analog,
    Asset,
    BodyMarker,
    Frame,
    Marker,
    MarkerSet,
    RigidBody,
    Skeleton,
    Suffix,
)

T = TypeVar("T")

_ASSET_BODY = struct.Struct("<i3f4ffh")
_ASSET_MARKER = struct.Struct("<i3ffhf")
_MIN_BODY = 32
"""Smallest size of a rigid body: id, position and orientation [bytes]."""
_BODY_HEAD = struct.Struct("<i3f4f")
_NOTHING, _NO_ELEMENTS = INT.pack(0), COUNT_AND_SIZE.pack(0, 0)
"""Empty sections, without and with their size."""


class FrameDecoder:
    """Decoder of the frames of one bitstream.

    Args:
        layout: layout of the bitstream.
    """

    def __init__(self, layout: BitstreamLayout) -> None:
        self._layout = layout
        self._sections: list[Callable[[Reader, int], Any]] = [_marker_sets, _unlabelled, self._bodies, self._skeletons]
        self._sections += [_assets] if layout.has["assets"] else [_nothing]
        self._sections += [self._markers]
        self._sections += [_analogs if layout.has[name] else _nothing for name in ("force_plates", "devices")]
        self._sized = layout.has["sizes"]

    def decode(self, data: bytes, offset: int = 0, end: int | None = None) -> Frame:
        """Return the frame of a payload.

        Args:
            data: datagram or payload.
            offset: start of the payload.
            end: end of the payload.

        Raises:
            CodecError: the payload cannot be read; no part of it may be used.
        """
        reader = Reader(data, offset, len(data) if end is None else end)
        number = reader.integer()
        section = self._section_with_size if self._sized else self._section
        values = [() if read is _nothing else section(reader, read) for read in self._sections]
        suffix = self._suffix(reader)
        return Frame(number, *values, suffix, reader.skipped + reader.left)  # type: ignore[arg-type, call-arg]

    def _section(self, reader: Reader, read: Callable[[Reader, int], T]) -> T | tuple[()]:
        number = reader.integer()
        if number == 0:
            return ()
        if number < 0:
            raise CodecError("count", f"negative number of elements, {number}, before byte {reader.offset}")
        return read(reader, number)

    def _section_with_size(self, reader: Reader, read: Callable[[Reader, int], T]) -> T | tuple[()]:
        number, size = reader.unpack(COUNT_AND_SIZE)
        if number == 0 and size == 0:
            return ()
        if number < 0:
            raise CodecError("count", f"negative number of elements, {number}, before byte {reader.offset}")
        end = reader.begin_sized(size)
        value = read(reader, number)
        reader.end_sized(end)
        return value

    def _bodies(self, reader: Reader, number: int) -> tuple[RigidBody, ...]:
        layout = self._layout
        if layout.has["body_markers"]:
            _check(reader, number, _MIN_BODY)
            return tuple(self._body_with_markers(reader) for _ in range(number))
        _check(reader, number, layout.body.size)
        return tuple([RigidBody(v[0], v[1:4], v[4:8], v[8], v[9]) for v in reader.array(layout.body, number)])

    def _body_with_markers(self, reader: Reader) -> RigidBody:
        head = reader.unpack(_BODY_HEAD)
        number = reader.count(20)
        positions = reader.array(VECTOR, number)
        ids = reader.unpack(struct.Struct(f"<{number}i"))
        markers = tuple(map(BodyMarker, positions, ids, reader.unpack(struct.Struct(f"<{number}f"))))
        mean_error, *flags = reader.unpack(self._layout.body_tail)
        return RigidBody(head[0], head[1:4], head[4:8], mean_error, flags[0] if flags else TRACKED, markers)

    def _skeletons(self, reader: Reader, number: int) -> tuple[Skeleton, ...]:
        _check(reader, number, 8)
        return tuple(Skeleton(reader.integer(), self._bodies(reader, reader.count(_MIN_BODY))) for _ in range(number))

    def _markers(self, reader: Reader, number: int) -> tuple[Marker, ...]:
        layout = self._layout
        _check(reader, number, layout.marker.size)
        return tuple([Marker(v[0], v[1:4], *v[4:]) for v in reader.array(layout.marker, number)])

    def _suffix(self, reader: Reader) -> Suffix:
        values = reader.unpack(self._layout.suffix)
        if values[-1] != 0 and self._layout.tail_known:
            raise CodecError("end tag", f"{values[-1]} instead of 0 at byte {reader.offset - INT.size}")
        if self._layout.plain_suffix:
            return Suffix(0.0, *values[:-1])
        return Suffix(**dict(zip(self._layout.suffix_fields[:-1], values, strict=False)))


def _check(reader: Reader, number: int, size: int) -> None:
    if number * size > reader.left:
        raise CodecError(
            "count", f"{number} elements of at least {size} bytes at byte {reader.offset}, only {reader.left} are left"
        )


def _nothing(reader: Reader, number: int) -> tuple[()]:
    """Return an empty section, in place of one that the bitstream lacks."""
    return ()


def _marker_sets(reader: Reader, number: int) -> tuple[MarkerSet, ...]:
    _check(reader, number, 5)
    return tuple([MarkerSet(reader.name(), reader.vectors()) for _ in range(number)])


def _unlabelled(reader: Reader, number: int) -> tuple[Vector, ...]:
    _check(reader, number, VECTOR.size)
    return tuple(reader.array(VECTOR, number))


def _assets(reader: Reader, number: int) -> tuple[Asset, ...]:
    _check(reader, number, 12)
    return tuple(_asset(reader) for _ in range(number))


def _asset(reader: Reader) -> Asset:
    asset = reader.integer()
    bodies = [
        RigidBody(v[0], v[1:4], v[4:8], v[8], v[9]) for v in reader.array(_ASSET_BODY, reader.count(_ASSET_BODY.size))
    ]
    markers = [Marker(v[0], v[1:4], *v[4:]) for v in reader.array(_ASSET_MARKER, reader.count(_ASSET_MARKER.size))]
    return Asset(asset, tuple(bodies), tuple(markers))


def _analogs(reader: Reader, number: int) -> tuple[Analog, ...]:
    _check(reader, number, 8)
    return tuple(
        Analog(reader.integer(), tuple(_samples(reader) for _ in range(reader.count(4)))) for _ in range(number)
    )


def _samples(reader: Reader) -> tuple[float, ...]:
    return reader.unpack(struct.Struct(f"<{reader.count(4)}f"))


class FrameEncoder:
    """Encoder of frames of one bitstream; fields that the bitstream lacks are left out.

    Args:
        layout: layout of the bitstream.
    """

    def __init__(self, layout: BitstreamLayout) -> None:
        self._layout = layout
        self._plain_body = not layout.has["body_markers"] and layout.has["body_flags"]

    def encode(self, frame: Frame) -> bytes:
        """Return the payload of a frame."""
        layout = self._layout
        parts = [
            INT.pack(frame.number),
            self._section(frame.marker_sets, _pack_marker_set),
            self._section(frame.unlabelled, _pack_vector),
            self._section(frame.bodies, self._body),
            self._section(frame.skeletons, self._skeleton),
            self._section(frame.assets, _pack_asset) if layout.has["assets"] else b"",
            self._section(frame.markers, self._marker),
            self._section(frame.force_plates, _pack_analog) if layout.has["force_plates"] else b"",
            self._section(frame.devices, _pack_analog) if layout.has["devices"] else b"",
            self._suffix(frame.suffix),
        ]
        return b"".join(parts)

    def _suffix(self, suffix: Suffix) -> bytes:
        if self._layout.plain_suffix:
            return self._layout.suffix.pack(*suffix[1:], 0)
        fields = suffix._asdict()
        return self._layout.suffix.pack(*(fields[name] for name in self._layout.suffix_fields[:-1]), 0)

    def _section(self, elements: Sequence[object], write) -> bytes:  # type: ignore[no-untyped-def]
        if not elements:
            return _NO_ELEMENTS if self._layout.has["sizes"] else _NOTHING
        content = b"".join(map(write, elements))
        head = (
            COUNT_AND_SIZE.pack(len(elements), len(content)) if self._layout.has["sizes"] else INT.pack(len(elements))
        )
        return head + content

    def _body(self, body: RigidBody) -> bytes:
        if self._plain_body:
            return self._layout.body.pack(body.id, *body.position, *body.orientation, body.mean_error, body.flags)
        head = _BODY_HEAD.pack(body.id, *body.position, *body.orientation)
        tail = (body.mean_error, body.flags)[: 1 + self._layout.has["body_flags"]]
        markers = _pack_body_markers(body) if self._layout.has["body_markers"] else b""
        return head + markers + self._layout.body_tail.pack(*tail)

    def _skeleton(self, skeleton: Skeleton) -> bytes:
        return struct.pack("<ii", skeleton.id, len(skeleton.bodies)) + b"".join(map(self._body, skeleton.bodies))

    def _marker(self, marker: Marker) -> bytes:
        layout = self._layout
        if layout.has["residual"]:
            return layout.marker.pack(marker.id, *marker.position, marker.size, marker.flags, marker.residual)
        return layout.marker.pack(
            *(marker.id, *marker.position, marker.size, marker.flags)[: 5 + layout.has["marker_flags"]]
        )


def _pack_body_markers(body: RigidBody) -> bytes:
    number = len(body.markers)
    positions = chain.from_iterable(marker.position for marker in body.markers)
    ids, sizes = (marker.id for marker in body.markers), (marker.size for marker in body.markers)
    return struct.pack(f"<i{3 * number}f{number}i{number}f", number, *positions, *ids, *sizes)


def _pack_vector(position: Vector) -> bytes:
    return VECTOR.pack(*position)


def _pack_marker_set(markers: MarkerSet) -> bytes:
    number = len(markers.positions)
    return (
        markers.name.encode() + b"\0" + _counted_vectors(number).pack(number, *chain.from_iterable(markers.positions))
    )


@functools.lru_cache(maxsize=64)
def _counted_vectors(number: int) -> struct.Struct:
    return struct.Struct(f"<i{3 * number}f")


def _pack_asset(asset: Asset) -> bytes:
    bodies = [
        _ASSET_BODY.pack(body.id, *body.position, *body.orientation, body.mean_error, body.flags)
        for body in asset.bodies
    ]
    markers = [
        _ASSET_MARKER.pack(marker.id, *marker.position, marker.size, marker.flags, marker.residual)
        for marker in asset.markers
    ]
    return INT.pack(asset.id) + INT.pack(len(bodies)) + b"".join(bodies) + INT.pack(len(markers)) + b"".join(markers)


def _pack_analog(analog: Analog) -> bytes:
    channels = [struct.pack(f"<i{len(samples)}f", len(samples), *samples) for samples in analog.channels]
    return struct.pack("<ii", analog.id, len(channels)) + b"".join(channels)
