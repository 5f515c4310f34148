"""Writers of URDF elements, with numbers that keep every bit."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from hric_core.geometry.transforms import FloatArray, rpy_from_rotation
from hric_core.urdf.shapes import SIZES, Shape


def text(values: Sequence[float] | FloatArray) -> str:
    """Return numbers as text of an attribute."""
    return " ".join(repr(float(value)) for value in values)


def write_origin(parent: Element, T: FloatArray) -> None:
    """Write an `<origin>`; T: shape (4, 4) [m]."""
    SubElement(parent, "origin", xyz=text(T[:3, 3]), rpy=text(rpy_from_rotation(T[:3, :3])))


def write_inertial(link: Element, mass: float, T_link_inertial: FloatArray, inertia: FloatArray) -> None:
    """Write an `<inertial>`: mass [kg], and inertia about the inertial frame's origin, shape (3, 3) [kg m^2].

    The tensor is in axes of the inertial frame."""
    inertial = SubElement(link, "inertial")
    write_origin(inertial, T_link_inertial)
    SubElement(inertial, "mass", value=repr(float(mass)))
    elements = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j])) for i in range(3) for j in range(i, 3)}
    SubElement(inertial, "inertia", elements)


def write_shape(link: Element, purpose: str, shape: Shape, T_link_shape: FloatArray) -> None:
    """Write a `<visual>` or `<collision>` at a pose, shape (4, 4) [m]."""
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
