"""The models around the robot, and the one description in which all of them stand together with it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from hric_control.errors import DescriptionError
from hric_control.plants.spatial import FloatArray, rpy_from_rotation
from hric_control.plants.surfaces import Surface
from hric_control.plants.urdf_tree import UrdfTree, parse_urdf
from hric_control.plants.worlds import PLAIN_LINK, WorldObject

_PLANE_DRAWN = 2.0
"""Side of the square that stands for a plane in pictures [m]; our choice."""


@dataclass
class Model:
    """A model beside the robot.

    Attributes:
        tree: its description.
        T_world_start: of its root link, shape (4, 4).
        fixed: to the world.
        surface: of all its links.
        linear, angular: velocity of the root link's origin at the start, world frame [m/s], [rad/s].
        T_world_origin: where the frame of its free joint stands now: coordinates at zero put the root link there.
        planes: links whose collision shape is the half-space below z = 0.
    """

    name: str
    xml: str
    tree: UrdfTree
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


def model_of_urdf(name: str, xml: str, T_world_model: FloatArray, *, fixed: bool, surface: Surface | None = None) -> Model:
    """A model from a URDF. Raises DescriptionError when it cannot be used."""
    tree = parse_urdf(xml)
    if not fixed and not _carried(tree):
        raise DescriptionError(f"link {tree.root} of model {name}: it moves, but neither it nor what is fixed to it has a mass")
    return Model(name, xml, tree, T_world_model.copy(), fixed, surface or Surface())


def _carried(tree: UrdfTree) -> bool:
    """Whether the root, or something fixed to it, has a mass."""
    group = [tree.root]
    for link in group:
        mass = tree.links[link].mass
        if mass is not None and mass.mass > 0.0:
            return True
        group += [joint.child for joint in tree.joints if joint.parent == link and joint.type == "fixed"]
    return False


def model_of_object(item: WorldObject) -> Model:
    """A model from an object of a world file."""
    fixed = item.mass == 0.0
    if item.urdf is not None:
        model = model_of_urdf(item.name, item.urdf.read_text(encoding="utf-8"), item.T_world_object, fixed=fixed, surface=item.surface)
    else:
        xml = _shape_urdf(item)
        planes = frozenset([PLAIN_LINK]) if item.shape == "plane" else frozenset()
        model = Model(item.name, xml, parse_urdf(xml), item.T_world_object.copy(), fixed, item.surface, planes=planes)
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
    across = rod * (3 * r * r + length * length) / 12 + balls * (0.4 * r * r + 0.375 * r * length + 0.25 * length * length)
    return across, across, 0.5 * rod * r * r + 0.4 * balls * r * r


def _shape_urdf(item: WorldObject) -> str:
    robot = Element("robot", name=item.name)
    link = SubElement(robot, "link", name=PLAIN_LINK)
    if item.mass > 0.0:
        inertial = SubElement(link, "inertial")
        SubElement(inertial, "mass", value=repr(item.mass))
        ixx, iyy, izz = map(repr, _moments(item.shape, item.size, item.mass))
        SubElement(inertial, "inertia", ixx=ixx, iyy=iyy, izz=izz, ixy="0", ixz="0", iyz="0")
    for element, z in _parts(item.shape, item.size):
        for tag in ("visual",) if item.shape == "plane" else ("visual", "collision"):
            place = SubElement(link, tag)
            SubElement(place, "origin", xyz=f"0 0 {z!r}")
            SubElement(place, "geometry").append(deepcopy(element))
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
    """One URDF of the robot and the models, whose links and joints are called "model::name"; the robot's root link is the world.

    A free model hangs on a floating joint "model::free", a fixed one on "model::fixed".
    """
    if not models:
        return robot_xml
    robot = ElementTree.fromstring(robot_xml)
    root = parse_urdf(robot_xml).root
    for model in models:
        for element in ElementTree.fromstring(model.xml):
            if element.tag in ("link", "joint"):
                robot.append(_renamed(element, model.name))
        kind = ("fixed", f"{model.name}::fixed") if model.fixed else ("floating", model.free_joint)
        joint = SubElement(robot, "joint", type=kind[0], name=kind[1])
        SubElement(joint, "parent", link=root)
        SubElement(joint, "child", link=f"{model.name}::{model.tree.root}")
        T = model.T_world_origin
        xyz, rpy = (" ".join(repr(float(v)) for v in values) for values in (T[:3, 3], rpy_from_rotation(T[:3, :3])))
        SubElement(joint, "origin", xyz=xyz, rpy=rpy)
    return ElementTree.tostring(robot, encoding="unicode")


def _renamed(element: Element, model: str) -> Element:
    copy = deepcopy(element)
    copy.set("name", f"{model}::{copy.get('name', '')}")
    for tag, attribute in (("parent", "link"), ("child", "link"), ("mimic", "joint")):
        for part in copy.findall(tag):
            part.set(attribute, f"{model}::{part.get(attribute, '')}")
    for visual in copy.findall("visual"):
        for material in visual.findall("material"):
            visual.remove(material)  # it may refer to one that stands outside the link
    return copy
