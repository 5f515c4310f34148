"""Visual and collision shapes of a URDF's links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray
from hric_core.urdf.elements import number, numbers, origin

SIZES = {"box": "size", "sphere": "radius", "cylinder": "radius length", "capsule": "radius length", "mesh": "scale"}
"""XML attributes with the dimensions of each kind of geometry."""

FAR = 1e9
"""Length of a solid from which on it is refused [m] (project default, unconfirmed)."""
_SAME = 1e-6
"""Distance below which two points coincide [m]."""
Colour = tuple[float, ...]
"""Red, green, blue, opacity, each from 0 to 1."""


@dataclass(frozen=True)
class Shape:
    """Visual or collision element of a link.

    Attributes:
        where: name of the element in error messages, e.g. "link hand: <visual> number 1".
        kind: kind of geometry, a key of SIZES; the axis of cylinders and capsules is z.
        size: box: edges along x, y, z; sphere: radius; cylinder and capsule: radius, length (of the straight part) [m];
            mesh: scale along x, y, z [1]. Not negative, except for a mesh.
        T_link_shape: pose of the shape in the link's frame, shape (4, 4) [m].
        address: file of a mesh, as written in the description.
        colour: red, green, blue, opacity, each 0 to 1; None if the description gives none.
    """

    where: str
    kind: str
    size: tuple[float, ...]
    T_link_shape: FloatArray
    address: str = ""
    colour: Colour | None = None

    @property
    def measures(self) -> str:
        """Kind and size as text for error messages, e.g. "<sphere> of radius 0.1"."""
        return f"<{self.kind}> of {SIZES[self.kind]} {' '.join(f'{length:g}' for length in self.size)}"


def read_shape(element: Element, where: str, colours: Mapping[str, Colour]) -> Shape:
    """Return the shape in a `<visual>` or `<collision>` element; `colours`: colours of the named materials.

    Unknown elements in `<geometry>` are ignored if there is a known one, too.

    Raises:
        DescriptionError: the geometry is missing, unknown or incomplete.
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
    """Return the shapes of a link, with each cylinder and the two spheres at its ends replaced by a capsule.

    The spheres must have the cylinder's radius. URDF before version 1.2 has no capsules. A capsule is the same body,
    but one shape to test for collision instead of three, and one contact instead of up to three.
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
    """Return the collision shapes of a link as every physics engine uses them, with joined capsules.

    Raises:
        DescriptionError: a dimension of a shape is 0 or too large, so that it cannot collide.
    """
    for shape in shapes:
        if not all(0.0 < (abs(length) if shape.kind == "mesh" else length) < FAR for length in shape.size):
            raise DescriptionError(f"{shape.where}: a {shape.measures}; all must be above 0 and below {FAR:g}")
    return join_capsules(shapes)
