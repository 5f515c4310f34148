"""Writes the payload of FRAMEOFDATA: the other direction of `frame`."""

from __future__ import annotations

import functools
import struct
from collections.abc import Sequence
from itertools import chain

from mocap_natnet.codec.layout import Layout
from mocap_natnet.codec.reader import COUNT_AND_SIZE, INT, VECTOR
from mocap_natnet.codec.types import Analog, Asset, Frame, Marker, MarkerSet, RigidBody, Skeleton, Suffix, Vector

BODY_HEAD = struct.Struct("<i3f4f")
NOTHING, NO_ELEMENTS = INT.pack(0), COUNT_AND_SIZE.pack(0, 0)
"""Empty sections, without and with their size."""


class FrameEncoder:
    """Writes frames of one bitstream; what the bitstream lacks is left out.

    Args:
        layout: of the bitstream.
    """

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._body_tail = struct.Struct("<fh" if layout.body_flags else "<f")
        self._plain_body = not layout.body_markers and layout.body_flags
        self._plain_suffix = layout.suffix_fields == (*Suffix._fields[1:], "end_tag")

    def encode(self, frame: Frame) -> bytes:
        """The payload."""
        layout = self._layout
        parts = [INT.pack(frame.number)]
        parts.append(self._section(frame.marker_sets, _marker_set))
        parts.append(self._section(frame.unlabelled, _vector))
        parts.append(self._section(frame.bodies, self._body))
        parts.append(self._section(frame.skeletons, self._skeleton))
        if layout.assets:
            parts.append(self._section(frame.assets, _asset))
        parts.append(self._section(frame.markers, self._marker))
        for elements, there in ((frame.force_plates, layout.force_plates), (frame.devices, layout.devices)):
            if there:
                parts.append(self._section(elements, _analog))
        parts.append(self._suffix(frame.suffix))
        return b"".join(parts)

    def _suffix(self, suffix: Suffix) -> bytes:
        if self._plain_suffix:
            return self._layout.suffix.pack(*suffix[1:], 0)
        fields = suffix._asdict()
        return self._layout.suffix.pack(*(fields[name] for name in self._layout.suffix_fields[:-1]), 0)

    def _section(self, elements: Sequence[object], write) -> bytes:  # type: ignore[no-untyped-def]
        if not elements:
            return NO_ELEMENTS if self._layout.sizes else NOTHING
        content = b"".join(map(write, elements))
        head = COUNT_AND_SIZE.pack(len(elements), len(content)) if self._layout.sizes else INT.pack(len(elements))
        return head + content

    def _body(self, body: RigidBody) -> bytes:
        if self._plain_body:
            return self._layout.body.pack(body.id, *body.position, *body.orientation, body.mean_error, body.flags)
        head = BODY_HEAD.pack(body.id, *body.position, *body.orientation)
        tail = (body.mean_error, body.flags)[: 1 + self._layout.body_flags]
        return head + (_body_markers(body) if self._layout.body_markers else b"") + self._body_tail.pack(*tail)

    def _skeleton(self, skeleton: Skeleton) -> bytes:
        return struct.pack("<ii", skeleton.id, len(skeleton.bodies)) + b"".join(map(self._body, skeleton.bodies))

    def _marker(self, marker: Marker) -> bytes:
        layout = self._layout
        if layout.residual:
            return layout.marker.pack(marker.id, *marker.position, marker.size, marker.flags, marker.residual)
        return layout.marker.pack(*(marker.id, *marker.position, marker.size, marker.flags)[: 5 + layout.marker_flags])


def _body_markers(body: RigidBody) -> bytes:
    number = len(body.markers)
    positions = chain.from_iterable(marker.position for marker in body.markers)
    ids, sizes = (marker.id for marker in body.markers), (marker.size for marker in body.markers)
    return struct.pack(f"<i{3 * number}f{number}i{number}f", number, *positions, *ids, *sizes)


def _vector(position: Vector) -> bytes:
    return VECTOR.pack(*position)


def _marker_set(markers: MarkerSet) -> bytes:
    number = len(markers.positions)
    return markers.name.encode() + b"\0" + _counted_vectors(number).pack(number, *chain.from_iterable(markers.positions))


@functools.lru_cache(maxsize=64)
def _counted_vectors(number: int) -> struct.Struct:
    return struct.Struct(f"<i{3 * number}f")


def _asset(asset: Asset) -> bytes:
    bodies = [struct.pack("<i3f4ffh", body.id, *body.position, *body.orientation, body.mean_error, body.flags) for body in asset.bodies]
    markers = [struct.pack("<i3ffhf", marker.id, *marker.position, marker.size, marker.flags, marker.residual) for marker in asset.markers]
    return INT.pack(asset.id) + INT.pack(len(bodies)) + b"".join(bodies) + INT.pack(len(markers)) + b"".join(markers)


def _analog(analog: Analog) -> bytes:
    channels = [struct.pack(f"<i{len(samples)}f", len(samples), *samples) for samples in analog.channels]
    return struct.pack("<ii", analog.id, len(channels)) + b"".join(channels)
