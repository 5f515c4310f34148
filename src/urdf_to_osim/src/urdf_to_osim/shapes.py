"""Visual and collision elements of links, read; and the shapes among them that OpenSim has by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import opensim

from hric_control import urdf as xml
from hric_control.errors import DescriptionError
from hric_control.plants.spatial import FloatArray
from urdf_to_osim import turns, urdf
from urdf_to_osim.options import Options
from urdf_to_osim.prepare import Plan

Carriers = dict[str, tuple[opensim.PhysicalFrame, FloatArray]]
GREY = (0.7, 0.7, 0.7, 1.0)  # where a visual has no material; our choice
SIZES = {"box": "size", "sphere": "radius", "cylinder": "radius length", "capsule": "radius length", "mesh": "filename"}
MEASURES = SIZES | {"mesh": "scale"}
# z of a URDF cylinder along y, the axis of OpenSim's.
Z_TO_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Shape:
    """A visual or collision element.

    Attributes:
        link: whose it is.
        name: unique in the model, e.g. "panda_link1_visual_1".
        visual: drawn; else it is for contact.
        kind: box, sphere, cylinder, capsule or mesh.
        size: box: edges along x, y, z; sphere: radius; cylinder and capsule: radius, length (of the straight part) [m]; mesh: scale.
        address: of a mesh, as the description has it.
        carrier: path of the body or ground that carries the link.
        T_carrier_shape: shape (4, 4) [m].
        colour: red, green, blue, opacity, each from 0 to 1.
    """

    link: str
    name: str
    visual: bool
    kind: str
    size: tuple[float, ...]
    address: str
    carrier: str
    T_carrier_shape: FloatArray
    colour: tuple[float, ...] = GREY


def add(model: opensim.Model, plan: Plan, options: Options, carriers: Carriers, notes: list[str]) -> list[Shape]:
    """Attach what the options ask for; returns the shapes that wait for a mesh file (`geometry.lay`).

    Args:
        notes: gets what was left out.

    Raises:
        DescriptionError: a geometry that is incomplete or unknown; names the link.
    """
    waiting = []
    for shape in _wanted(plan, options, carriers, notes):
        carrier = carriers[shape.link][0]
        if shape.visual and shape.kind != "mesh":
            for geometry, T in _drawn(shape):
                attach(carrier, shape, geometry, T)
        elif not shape.visual and shape.kind == "sphere":
            location = turns.vec3(shape.T_carrier_shape[:3, 3])
            model.addContactGeometry(opensim.ContactSphere(shape.size[0], location, carrier, shape.name))
        else:
            waiting.append(shape)
    return waiting


def attach(carrier: opensim.PhysicalFrame, shape: Shape, geometry: opensim.Geometry, T_carrier_geometry: FloatArray) -> None:
    """Draw a geometry at a pose on a body or ground, in the shape's colour."""
    frame = opensim.PhysicalOffsetFrame()
    frame.setName(geometry.getName())
    frame.setParentFrame(carrier)
    turns.set_place(frame, T_carrier_geometry)
    geometry.setColor(turns.vec3(shape.colour[:3]))
    geometry.setOpacity(shape.colour[3])
    frame.attachGeometry(geometry)
    carrier.addComponent(frame)


def _drawn(shape: Shape) -> Iterator[tuple[opensim.Geometry, FloatArray]]:
    """OpenSim's geometry for a shape, with poses in the carrier."""
    if shape.kind == "box":
        pieces = [(opensim.Brick(turns.vec3(0.5 * np.array(shape.size))), np.eye(4))]
    elif shape.kind == "sphere":
        pieces = [(opensim.Sphere(shape.size[0]), np.eye(4))]
    else:
        radius, length = shape.size
        pieces = [(opensim.Cylinder(radius, 0.5 * length), Z_TO_Y)]
        if shape.kind == "capsule":
            pieces += [(opensim.Sphere(radius), _lifted(0.5 * length)), (opensim.Sphere(radius), _lifted(-0.5 * length))]
    for number, (geometry, T_shape_piece) in enumerate(pieces):
        geometry.setName(shape.name if number == 0 else f"{shape.name}_end{number}")
        yield geometry, shape.T_carrier_shape @ T_shape_piece


def _lifted(z: float) -> FloatArray:
    T = np.eye(4)
    T[2, 3] = z
    return T


def _wanted(plan: Plan, options: Options, carriers: Carriers, notes: list[str]) -> Iterator[Shape]:
    for link in plan.robot.links.values():
        carrier, T_carrier_link = carriers[link.name]
        for purpose, elements in (("visual", link.visuals if options.meshes else []), ("collision", link.collisions if options.contact else [])):
            for number, element in enumerate(elements, 1):
                where = f"link {link.name}: <{purpose}> number {number}"
                kind, size, address = _geometry(element, where)
                if purpose == "visual" and 0.0 in size:
                    notes.append(
                        f"{where}: left out, since a <{kind}> of {MEASURES[kind]} {' '.join(f'{length:g}' for length in size)} shows nothing"
                    )
                    continue
                _check_size(kind, size, where)
                T = T_carrier_link @ urdf.origin(element, where)
                name = f"{plan.links[link.name]}_{purpose}_{number}"
                colour = _colour(element, plan.robot.colours, where)
                yield Shape(link.name, name, purpose == "visual", kind, size, address, carrier.getAbsolutePathString(), T, colour)


def _geometry(element: Element, where: str) -> tuple[str, tuple[float, ...], str]:
    geometry = element.find("geometry")
    shape = None if geometry is None else next(iter(geometry), None)
    if shape is None or shape.tag not in SIZES:
        got = "none" if shape is None else f"<{shape.tag}>"
        raise DescriptionError(f"{where}: its geometry is {got}; valid: {', '.join(SIZES)}; or leave meshes or contact out")
    if shape.tag == "mesh":
        return "mesh", tuple(urdf.floats(shape, "scale", 3, "1 1 1", where)), shape.get("filename", "")
    names = SIZES[shape.tag].split()
    size = urdf.floats(shape, "size", 3, "", where) if shape.tag == "box" else [xml.number(shape, name, where) for name in names]
    return shape.tag, tuple(size), ""


def _check_size(kind: str, size: tuple[float, ...], where: str) -> None:
    """What is wrong with a mesh's scale is told when its file is looked for."""
    if kind != "mesh" and min(size) <= 0.0:
        raise DescriptionError(f"{where}: a <{kind}> of {MEASURES[kind]} {' '.join(map(str, size))} m; all must be above 0")


def _colour(element: Element, named: dict[str, tuple[float, ...]], where: str) -> tuple[float, ...]:
    material = element.find("material")
    if material is None:
        return GREY
    return urdf.colour(material, where) or named.get(material.get("name", ""), GREY)
