"""Writers of URDF elements; numbers are written with full precision."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from hric_core.geometry.transforms import FloatArray, rpy_from_rotation
from hric_core.urdf.shapes import SIZES, Shape


def text(values: Sequence[float] | FloatArray) -> str:
    """Return numbers as the text of an XML attribute, with full precision."""
    return " ".join(repr(float(value)) for value in values)


def write_origin(parent: Element, T: FloatArray) -> None:
    """Add an `<origin>` to an element; T: pose, shape (4, 4) [m]."""
    SubElement(parent, "origin", xyz=text(T[:3, 3]), rpy=text(rpy_from_rotation(T[:3, :3])))


def write_inertial(link: Element, mass: float, T_link_inertial: FloatArray, inertia: FloatArray) -> None:
    """Add an `<inertial>` to a link.

    `mass` is in kg. `inertia` is about the origin of the inertial frame and in its axes, shape (3, 3) [kg m^2].
    `T_link_inertial` is the pose of the inertial frame in the link, shape (4, 4) [m]."""
    inertial = SubElement(link, "inertial")
    write_origin(inertial, T_link_inertial)
    SubElement(inertial, "mass", value=repr(float(mass)))
    elements = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j])) for i in range(3) for j in range(i, 3)}
    SubElement(inertial, "inertia", elements)


def write_shape(link: Element, purpose: str, shape: Shape, T_link_shape: FloatArray) -> None:
    """Add a shape to a link, as `<visual>` or `<collision>` (`purpose`), at the pose T_link_shape, shape (4, 4) [m]."""
    element = SubElement(link, purpose)
    write_origin(element, T_link_shape)
    names = SIZES[shape.kind].split()
    attributes = (
        {names[0]: text(shape.size)} if len(names) == 1 else dict(zip(names, map(repr, shape.size), strict=True))
    )
    attributes |= {"filename": shape.address} if shape.address else {}
    SubElement(SubElement(element, "geometry"), shape.kind, attributes)
    if shape.colour is not None:
        rgba = text(shape.colour)
        SubElement(SubElement(element, "material", name=rgba), "color", rgba=rgba)
