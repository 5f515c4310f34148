"""Visual and collision shapes of links as OpenSim geometry."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import opensim

from hric_core.errors import DescriptionError
from hric_core.geometry import FloatArray, homogeneous
from urdf_to_osim import transforms
from urdf_to_osim.options import Options
from urdf_to_osim.prepare import ConversionPlan

Carriers = dict[str, tuple[opensim.PhysicalFrame, FloatArray]]
GREY = (0.7, 0.7, 0.7, 1.0)  # colour of visuals without material; project default, unconfirmed
# Rotation that aligns the axis of an OpenSim cylinder (y) with that of a URDF cylinder (z).
Z_TO_Y = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class OsimShape:
    """Visual or collision element of a link, to be added to the OpenSim model.

    Attributes:
        link: link of the element.
        name: unique name in the model, e.g. "panda_link1_visual_1".
        visual: True: it is drawn; False: it is contact geometry.
        kind: box, sphere, cylinder, capsule or mesh.
        size: box: edges along x, y, z; sphere: radius; cylinder and capsule: radius, length (of the straight part) [m];
            mesh: scale.
        address: address of a mesh in the description.
        carrier: path of the OpenSim body (or ground) to which the link belongs.
        T_carrier_shape: pose in that body, shape (4, 4) [m].
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


def add(
    model: opensim.Model, plan: ConversionPlan, options: Options, carriers: Carriers, notes: list[str]
) -> list[OsimShape]:
    """Add the shapes that the options select to the model; return those that still need a mesh file.

    Args:
        model: OpenSim model with its bodies.
        plan: decisions of the conversion.
        options: options of the conversion.
        carriers: OpenSim body (or ground) to which each link belongs, and the link's pose in it.
        notes: list to which texts about omissions are added.

    Raises:
        DescriptionError: a collision shape has no extent; names the link.
    """
    waiting = []
    for shape in _included(plan, options, carriers, notes):
        carrier = carriers[shape.link][0]
        if shape.visual and shape.kind != "mesh":
            for geometry, T in _drawn(shape):
                attach(carrier, shape, geometry, T)
        elif not shape.visual and shape.kind == "sphere":
            location = transforms.vec3(shape.T_carrier_shape[:3, 3])
            model.addContactGeometry(opensim.ContactSphere(shape.size[0], location, carrier, shape.name))
        else:
            waiting.append(shape)
    return waiting


def attach(
    carrier: opensim.PhysicalFrame, shape: OsimShape, geometry: opensim.Geometry, T_carrier_geometry: FloatArray
) -> None:
    """Attach a visible geometry to a body (or ground) at a pose, with the colour of a shape."""
    frame = opensim.PhysicalOffsetFrame()
    frame.setName(geometry.getName())
    frame.setParentFrame(carrier)
    transforms.set_offset(frame, T_carrier_geometry)
    geometry.setColor(transforms.vec3(shape.colour[:3]))
    geometry.setOpacity(shape.colour[3])
    frame.attachGeometry(geometry)
    carrier.addComponent(frame)


def _drawn(shape: OsimShape) -> Iterator[tuple[opensim.Geometry, FloatArray]]:
    """Yield the OpenSim primitives that make up a shape, with their poses in the body."""
    if shape.kind == "box":
        pieces = [(opensim.Brick(transforms.vec3(0.5 * np.array(shape.size))), np.eye(4))]
    elif shape.kind == "sphere":
        pieces = [(opensim.Sphere(shape.size[0]), np.eye(4))]
    else:
        radius, length = shape.size
        pieces = [(opensim.Cylinder(radius, 0.5 * length), Z_TO_Y)]
        if shape.kind == "capsule":
            pieces += [
                (opensim.Sphere(radius), homogeneous(np.eye(3), (0.0, 0.0, z))) for z in (0.5 * length, -0.5 * length)
            ]
    for number, (geometry, T_shape_piece) in enumerate(pieces):
        geometry.setName(shape.name if number == 0 else f"{shape.name}_end{number}")
        yield geometry, shape.T_carrier_shape @ T_shape_piece


def _included(plan: ConversionPlan, options: Options, carriers: Carriers, notes: list[str]) -> Iterator[OsimShape]:
    for link in plan.robot.links.values():
        carrier, T_carrier_link = carriers[link.name]
        for purpose, shapes in (
            ("visual", link.visuals if options.meshes else ()),
            ("collision", link.collisions if options.contact else ()),
        ):
            for number, shape in enumerate(shapes, 1):
                if 0.0 in shape.size and (purpose == "visual" or shape.kind != "mesh"):
                    if purpose == "collision":
                        raise DescriptionError(f"{shape.where}: a {shape.measures}; all must be above 0")
                    notes.append(f"{shape.where}: left out, since a {shape.measures} shows nothing")
                    continue
                yield OsimShape(
                    link.name,
                    f"{plan.links[link.name]}_{purpose}_{number}",
                    purpose == "visual",
                    shape.kind,
                    shape.size,
                    shape.address,
                    carrier.getAbsolutePathString(),
                    T_carrier_link @ shape.T_link_shape,
                    shape.colour or GREY,
                )
