"""The models around the robot, and the one description of all of them together with it."""

import math
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_control.errors import DescriptionError
from hric_control.geometry import FloatArray
from hric_control.plants import PLAIN_LINK, Surface, WorldObject
from hric_control.urdf import Robot, read, write_inertial, write_origin

_PLANE_DRAWN = 2.0
"""Side of the square that represents a plane in pictures [m]; project default, unconfirmed."""


@dataclass
class Model:
    """A model beside the robot.

    Attributes:
        tree: its description.
        T_world_start: of its root link, shape (4, 4).
        fixed: to the world.
        surface: of all its links.
        linear, angular: velocity of the root link's origin at the start, world frame [m/s], [rad/s].
        T_world_origin: where the frame of its free joint is now: coordinates at zero put the root link there.
        planes: links whose collision shape is the half-space below z = 0.
    """

    name: str
    xml: str
    tree: Robot
    T_world_start: FloatArray
    fixed: bool
    surface: Surface = field(default_factory=Surface)
    linear: Sequence[float] = (0.0, 0.0, 0.0)
    angular: Sequence[float] = (0.0, 0.0, 0.0)
    planes: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        self.T_world_origin = self.T_world_start

    @property
    def free_joint(self) -> str:
        """Name of its joint to the world in the description of all."""
        return f"{self.name}::free"


def model_of_urdf(
    name: str, xml: str, T_world_model: FloatArray, *, fixed: bool, surface: Surface | None = None
) -> Model:
    """A model from a URDF. Raises DescriptionError when it cannot be used."""
    tree = read(xml, f"model {name}")
    if not fixed and not _carried(tree):
        raise DescriptionError(
            f"link {tree.root} of model {name}: it moves, but neither it nor what is fixed to it has a mass"
        )
    return Model(name, xml, tree, T_world_model.copy(), fixed, surface or Surface())


def _carried(tree: Robot) -> bool:
    """Whether the root, or something fixed to it, has a mass."""
    fixed = [tree.links[link].mass for link, (top, _) in tree.rigid_groups().items() if top == tree.root]
    return any(mass is not None and mass.mass > 0.0 for mass in fixed)


def model_of_object(item: WorldObject) -> Model:
    """A model from an object of a world file."""
    fixed = item.mass == 0.0
    if item.urdf is not None:
        model = model_of_urdf(
            item.name, item.urdf.read_text(encoding="utf-8"), item.T_world_object, fixed=fixed, surface=item.surface
        )
    else:
        xml = _shape_urdf(item)
        planes = frozenset([PLAIN_LINK]) if item.shape == "plane" else frozenset()
        model = Model(item.name, xml, read(xml), item.T_world_object.copy(), fixed, item.surface, planes=planes)
    model.linear, model.angular = item.linear, item.angular
    return model


def _moments(shape: str, size: Sequence[float], mass: float) -> tuple[float, float, float]:
    """Principal moments of a solid of even density about its centre [kg m^2]; textbook formulas."""
    if shape == "box":
        x, y, z = size
        return mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y)
    if shape == "sphere":
        return (0.4 * mass * size[0] ** 2,) * 3
    r, length = size
    if shape == "cylinder":
        across = mass / 12 * (3 * r * r + length * length)
        return across, across, 0.5 * mass * r * r
    # A capsule: a cylinder, and two half balls whose centres of mass lie 3 r / 8 beyond its ends.
    volume = math.pi * r * r * length + 4 / 3 * math.pi * r**3
    rod, balls = mass * math.pi * r * r * length / volume, mass * 4 / 3 * math.pi * r**3 / volume
    across = rod * (3 * r * r + length * length) / 12 + balls * (
        0.4 * r * r + 0.375 * r * length + 0.25 * length * length
    )
    return across, across, 0.5 * rod * r * r + 0.4 * balls * r * r


def _shape_urdf(item: WorldObject) -> str:
    robot = Element("robot", name=item.name)
    link = SubElement(robot, "link", name=PLAIN_LINK)
    if item.mass > 0.0:
        write_inertial(link, item.mass, np.eye(4), np.diag(_moments(item.shape, item.size, item.mass)))
    for element, z in _parts(item.shape, item.size):
        for tag in ("visual",) if item.shape == "plane" else ("visual", "collision"):
            shape = SubElement(link, tag)
            SubElement(shape, "origin", xyz=f"0 0 {z!r}")
            SubElement(shape, "geometry").append(deepcopy(element))
    return ElementTree.tostring(robot, encoding="unicode")


def _parts(shape: str, size: Sequence[float]) -> list[tuple[Element, float]]:
    """(shape of a URDF, z of its centre [m]): a capsule is a cylinder and two balls there."""
    if shape == "box":
        return [(Element("box", size=" ".join(map(repr, size))), 0.0)]
    if shape == "sphere":
        return [(Element("sphere", radius=repr(size[0])), 0.0)]
    if shape == "plane":
        return [(Element("box", size=f"{_PLANE_DRAWN} {_PLANE_DRAWN} 0.001"), -0.0005)]
    rod = (Element("cylinder", radius=repr(size[0]), length=repr(size[1])), 0.0)
    if shape == "cylinder":
        return [rod]
    return [rod, *((Element("sphere", radius=repr(size[0])), side * 0.5 * size[1]) for side in (-1.0, 1.0))]


def together(robot_xml: str, models: Sequence[Model]) -> str:
    """One URDF of the robot and the models, whose links and joints are called "model::name"; the robot's root link is
    the world.

    A free model hangs on a floating joint "model::free", a fixed one on "model::fixed".
    """
    if not models:
        return robot_xml
    robot = ElementTree.fromstring(robot_xml)
    root = read(robot_xml).root
    for model in models:
        for element in ElementTree.fromstring(model.xml):
            if element.tag in ("link", "joint"):
                robot.append(_renamed(element, model.name))
        kind = ("fixed", f"{model.name}::fixed") if model.fixed else ("floating", model.free_joint)
        joint = SubElement(robot, "joint", type=kind[0], name=kind[1])
        SubElement(joint, "parent", link=root)
        SubElement(joint, "child", link=f"{model.name}::{model.tree.root}")
        write_origin(joint, model.T_world_origin)
    return ElementTree.tostring(robot, encoding="unicode")


def _renamed(element: Element, model: str) -> Element:
    copy = deepcopy(element)
    copy.set("name", f"{model}::{copy.get('name', '')}")
    for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
        for part in copy.findall(tag):
            part.set(attribute, f"{model}::{part.get(attribute, '')}")
    for visual in copy.findall("visual"):
        for material in visual.findall("material"):
            visual.remove(material)  # it may refer to one outside the link
    return copy
