"""Visual and collision elements of links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf.elements import number, numbers, origin

SIZES = {"box": "size", "sphere": "radius", "cylinder": "radius length", "capsule": "radius length", "mesh": "scale"}
"""Kinds of geometry, and the attributes of their dimensions."""

FAR = 1e9
"""Length from which on a solid is invalid [m] (project default, unconfirmed)."""
_SAME = 1e-6
"""Distance below which two ends coincide [m]."""
Colour = tuple[float, ...]
"""Red, green, blue, opacity, each from 0 to 1."""


@dataclass(frozen=True)
class Shape:
    """Visual or collision element.

    Attributes:
        where: its name in errors, e.g. "link hand: <visual> number 1".
        kind: key of SIZES; cylinders and capsules lie along z.
        size: box: edges along x, y, z; sphere: radius; cylinder and capsule: radius, length (of the straight part) [m];
            mesh: scale along x, y, z [1]. Not negative, except for a mesh.
        T_link_shape: shape (4, 4) [m].
        address: address of a mesh, as in the description.
        colour: None if the description gives none.
    """

    where: str
    kind: str
    size: tuple[float, ...]
    T_link_shape: FloatArray
    address: str = ""
    colour: Colour | None = None

    @property
    def measures(self) -> str:
        """Kind and size for messages, e.g. "<sphere> of radius 0.1"."""
        return f"<{self.kind}> of {SIZES[self.kind]} {' '.join(f'{length:g}' for length in self.size)}"


def read_shape(element: Element, where: str, colours: Mapping[str, Colour]) -> Shape:
    """Return the shape of a `<visual>` or `<collision>`; colours: colours of the named materials.

    Raises:
        DescriptionError: its geometry is missing, unknown or incomplete; other elements next to a known one are
            ignored.
    """
    elements = element.findall("geometry/*")
    known = [geometry for geometry in elements if geometry.tag in SIZES]
    if len(known) != 1:
        got = ", ".join(f"<{geometry.tag}>" for geometry in elements) or "none"
        raise DescriptionError(f"{where}: its geometry is {got}; valid: one of {', '.join(SIZES)}")
    (geometry,) = known
    kind = geometry.tag
    if kind == "mesh" and not geometry.get("filename"):
        raise DescriptionError(f"{where}: <mesh> has no filename")
    if kind in ("box", "mesh"):
        size = numbers(geometry, SIZES[kind], 3, "1 1 1" if kind == "mesh" else "", where)
    else:
        size = [number(geometry, name, where) for name in SIZES[kind].split()]
    material = element.find("material")
    colour = None if material is None else read_colour(material, where) or colours.get(material.get("name", ""))
    shape = Shape(where, kind, tuple(size), origin(element, where), geometry.get("filename", ""), colour)
    if kind != "mesh" and min(size) < 0.0:
        raise DescriptionError(f"{where}: a {shape.measures} m; none may be negative")
    return shape


def read_colour(material: Element, where: str) -> Colour | None:
    """Return the colour of a `<material>`; None if it only refers to a name or a texture."""
    tag = material.find("color")
    return None if tag is None else tuple(min(max(value, 0.0), 1.0) for value in numbers(tag, "rgba", 4, "", where))


def _ball_at(centre: FloatArray, radius: float, shapes: Sequence[Shape]) -> Shape | None:
    balls = (shape for shape in shapes if shape.kind == "sphere" and abs(shape.size[0] - radius) < _SAME)
    return next((ball for ball in balls if float(np.linalg.norm(ball.T_link_shape[:3, 3] - centre)) < _SAME), None)


def join_capsules(shapes: Sequence[Shape]) -> list[Shape]:
    """Return the shapes of a link, with a capsule for each cylinder that has balls of its radius at both ends.

    A URDF before 1.2 has no capsules. One is the same body as its three parts, but one shape to test instead of three,
    and one contact where the parts would touch together.
    """
    used: set[int] = set()
    result = []
    for shape in shapes:
        if shape.kind == "cylinder":
            radius, length = shape.size
            T = shape.T_link_shape
            ends = [_ball_at(T[:3, 3] + side * 0.5 * length * T[:3, 2], radius, shapes) for side in (-1.0, 1.0)]
            if all(ends):
                used.update(map(id, ends))
                shape = replace(shape, kind="capsule")
        result.append(shape)
    return [shape for shape in result if id(shape) not in used]


def solids(shapes: Sequence[Shape]) -> list[Shape]:
    """Return the collision shapes of a link, the same for every engine.

    Raises:
        DescriptionError: a shape without extent, which cannot collide.
    """
    for shape in shapes:
        if not all(0.0 < (abs(length) if shape.kind == "mesh" else length) < FAR for length in shape.size):
            raise DescriptionError(f"{shape.where}: a {shape.measures}; all must be above 0 and below {FAR:g}")
    return join_capsules(shapes)
