"""Recognises capsules that a URDF, which has no such shape, describes as a cylinder with a ball at each end.

One capsule is the same body as its three parts, but one shape to test instead of three, and one contact where the parts would touch together.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_control.plants.spatial import FloatArray
from hric_control.plants.urdf_tree import origin

_TOLERANCE = 1e-6
"""[m]"""


def _size(shape: Element, kind: str, *attributes: str) -> tuple[float, ...] | None:
    element = shape.find(f"geometry/{kind}")
    return None if element is None else tuple(float(element.get(a, "nan")) for a in attributes)


def _ball_at(centre: FloatArray, radius: float, balls: Sequence[tuple[Element, FloatArray, float]]) -> Element | None:
    for shape, at, r in balls:
        if abs(r - radius) < _TOLERANCE and float(np.linalg.norm(at - centre)) < _TOLERANCE:
            return shape
    return None


def join_capsules(shapes: Sequence[Element], where: str) -> list[Element]:
    """The shapes of a link, with each cylinder that has balls of its radius at both ends turned into a capsule and those balls left out.

    Args:
        shapes: collision elements; not changed.
        where: what they belong to, for error texts.
    """
    poses = [origin(shape.find("origin"), where) for shape in shapes]
    sizes = [_size(shape, "sphere", "radius") for shape in shapes]
    balls = [(shape, T[:3, 3], size[0]) for shape, T, size in zip(shapes, poses, sizes, strict=True) if size is not None]
    used: set[int] = set()
    result = []
    for shape, T in zip(shapes, poses, strict=True):
        cylinder = _size(shape, "cylinder", "radius", "length")
        if cylinder is not None:
            radius, length = cylinder
            ends = [_ball_at(T[:3, 3] + side * 0.5 * length * T[:3, 2], radius, balls) for side in (-1.0, 1.0)]
            if ends[0] is not None and ends[1] is not None:
                used.update(id(ball) for ball in ends)
                shape = _capsule(shape, radius, length)
        result.append(shape)
    return [shape for shape in result if id(shape) not in used]


def _capsule(cylinder: Element, radius: float, length: float) -> Element:
    shape = Element("collision")
    place = cylinder.find("origin")
    if place is not None:
        shape.append(place)
    SubElement(SubElement(shape, "geometry"), "capsule", radius=repr(radius), length=repr(length))
    return shape
