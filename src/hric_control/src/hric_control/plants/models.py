"""Models in the surroundings of a robot. Each has a URDF; for simple shapes of a world file it is generated."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Generic, TypeVar
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_control.plant import Load, Surface
from hric_control.plants.bushings import Bushings
from hric_control.plants.config import PlantConfig
from hric_control.plants.driven_joints import DrivenJoints
from hric_control.plants.spring_step import Springs
from hric_control.plants.surfaces import Surfaces
from hric_control.plants.worlds import PLAIN_LINK, WorldObject
from hric_control.plants.wrenches import Wrenches
from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.resources import read_description
from hric_core.urdf import Robot, read, write_inertial

_PLANE_DRAWN = 2.0
"""Edge length of the square that represents a plane in images [m] (project default, unconfirmed)."""
TRACE = 1e-12
"""Mass [kg] and moments of inertia [kg m^2] used for a moving link without mass whose children have mass.

Engines refuse zero; this value is too small to have an effect (project default, unconfirmed)."""
JointsT = TypeVar("JointsT", bound=DrivenJoints)


@dataclass
class Model:
    """Model in the world, other than the robot.

    Attributes:
        name: name of the model.
        xml: URDF of the model.
        tree: parsed URDF.
        T_world_start: pose of the root link at the start, shape (4, 4).
        fixed: True if the root link is fixed to the world.
        surface: contact surface of the links.
        surfaces: contact surfaces of single links by name, which replace `surface`.
        linear, angular: velocity of the root link's origin at the start, in the world frame [m/s], [rad/s].
        T_world_origin: present pose of the free joint's frame, the root link's pose if the joint's coordinates are 0.
        planes: links whose collision shape is the half-space below z = 0.
        plain: object of a world file, if the model is a simple shape; None for a model with a URDF file.
    """

    name: str
    xml: str
    tree: Robot
    T_world_start: FloatArray
    fixed: bool
    surface: Surface = field(default_factory=Surface)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    linear: Sequence[float] = (0.0, 0.0, 0.0)
    angular: Sequence[float] = (0.0, 0.0, 0.0)
    planes: frozenset[str] = frozenset()
    plain: WorldObject | None = None

    def __post_init__(self) -> None:
        self.T_world_origin = self.T_world_start

    @property
    def free_joint(self) -> str:
        """Name of the free joint between world and model, unique in the world."""
        return f"{self.name}::free"


def model_of_urdf(
    name: str, xml: str, T_world_model: FloatArray, *, fixed: bool, surface: Surface | None = None
) -> Model:
    """Return a model with a given URDF. Raises DescriptionError if the URDF is not usable."""
    tree = read(xml, f"model {name}")
    if not fixed and not _has_moving_mass(tree):
        raise DescriptionError(
            f"link {tree.root} of model {name}: it can move, but neither it nor a link fixed to it has a mass"
        )
    return Model(name, xml, tree, T_world_model.copy(), fixed, surface or Surface())


def _has_moving_mass(tree: Robot) -> bool:
    """Return True if the root link, or a link fixed to it, has a mass."""
    fixed = [tree.links[link].mass for link, (top, _) in tree.rigid_groups().items() if top == tree.root]
    return any(mass is not None and mass.mass > 0.0 for mass in fixed)


def model_of_object(item: WorldObject) -> Model:
    """Return the model of an object in a world file."""
    fixed = item.mass == 0.0
    if item.urdf is not None:
        text = read_description(item.urdf)
        model = model_of_urdf(item.name, text, item.T_world_object, fixed=fixed, surface=item.surface)
    else:
        xml = _shape_urdf(item)
        planes = frozenset([PLAIN_LINK]) if item.shape == "plane" else frozenset()
        T = item.T_world_object.copy()
        model = Model(item.name, xml, read(xml), T, fixed, item.surface, planes=planes, plain=item)
    model.linear, model.angular = item.linear, item.angular
    return model


def _moments(shape: str, size: Sequence[float], mass: float) -> tuple[float, float, float]:
    """Return the principal moments of inertia of a solid of uniform density about its centre [kg m^2]."""
    if shape == "box":
        x, y, z = size
        return mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z), mass / 12 * (x * x + y * y)
    if shape == "sphere":
        return (0.4 * mass * size[0] ** 2,) * 3
    r, length = size
    if shape == "cylinder":
        across = mass / 12 * (3 * r * r + length * length)
        return across, across, 0.5 * mass * r * r
    # A capsule is a cylinder and two hemispheres, whose centres of mass are 3 r / 8 beyond the cylinder's ends.
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
    """Return (URDF geometry element, z of its centre [m]) of each part of a shape; a capsule has three.

    shape, size: as in `WorldObject`.
    """
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


def payload(load: Load) -> MassProperties:
    """Return the mass properties of a payload. Raises ParameterError if they are invalid."""
    if load.mass < 0.0 or len(load.com) != 3 or len(load.inertia) != 9:
        raise ParameterError(f"a payload needs mass >= 0, com with 3 and inertia with 9 numbers; got {load}")
    return MassProperties(
        float(load.mass), np.array(load.com, dtype=float), np.array(load.inertia, dtype=float).reshape(3, 3)
    )


def moving_body(tree: Robot, link: str, total: MassProperties) -> MassProperties:
    """Return the mass properties of a moving link and the links fixed to it, adapted to what an engine accepts.

    A zero mass or inertia is replaced by a very small one.

    Args:
        tree: robot description.
        link: topmost link of the group of links that are fixed to each other.
        total: mass properties of the group, in the frame of the link.

    Raises:
        DescriptionError: neither the group nor any link below it has a mass, so that nothing would resist the joint.
    """
    if total.mass <= 0.0:
        outer = (tree.links[joint.child].mass for joint, _ in tree.beyond(link))
        if total.inertia.any() or not any(mass is not None and mass.mass > 0.0 for mass in outer):
            raise DescriptionError(f"link {link}: it can move, but neither it nor a link fixed to it has a mass")
        total = MassProperties(TRACE, np.zeros(3), np.zeros((3, 3)))
    return as_point(total)


def as_point(body: MassProperties) -> MassProperties:
    """Return a body's mass properties, with a very small inertia added if it has none about an axis.

    Engines need it for point masses and thin rods."""
    if np.abs(np.linalg.eigvalsh(body.inertia)).min() >= TRACE:
        return body
    return MassProperties(body.mass, body.com, body.inertia + TRACE * np.eye(3))


class Models(ABC, Generic[JointsT]):
    """Models in the surroundings of a robot, by name.

    Adding or removing a model rebuilds the engine's model; the states of all other models are preserved.

    Args:
        tree: robot description.
        objects: objects of the world file; a subclass adds them by `_restore` when its engine is ready.
        rules: rules for the contact surfaces of single links.
        config: the plant's parameters.

    Attributes:
        models: all models except the robot.
        joints: joints of a model by the model's name; a model without moving joints may be missing.
        wrenches: external wrenches that act now.
        springs: springs of penalty contact.
        bushings: connections between links.

    Raises:
        HricError: an object or a rule is not usable.
    """

    bushings: Bushings

    def __init__(self, tree: Robot, objects: Sequence[WorldObject], rules: Surfaces, config: PlantConfig) -> None:
        self._name, self._tree, self._rules, self._config = tree.name, tree, rules, config
        self._surfaces = {tree.name: rules.of_model(tree.name, tree.links, Surface())}
        self._start = {item.name: model_of_object(item) for item in objects}
        self.models: dict[str, Model] = {}
        self.joints: dict[str, JointsT] = {}
        self.wrenches, self.springs = Wrenches(config.time_step), Springs(config.time_step)

    @abstractmethod
    def reset(self) -> None:
        """Reset all models to their start, remove wrenches and joint efforts, and clear contact and slip states."""

    @abstractmethod
    def forget_contacts(self) -> None:
        """Discard contacts and the states of contact springs; called after bodies were moved."""

    @abstractmethod
    def bind_connected(self) -> None:
        """Update the engine after connections between bodies were added or removed."""

    def joints_of(self, model: str) -> DrivenJoints:
        """Return the joints of a model. Raises UnknownNameError if there is no such model."""
        if (joints := self.joints.get(model)) is not None:
            return joints
        self._check_model(model)
        return DrivenJoints(model, (), self._config)

    def _check_model(self, name: str) -> None:
        if name not in self.models:
            raise UnknownNameError("model", name, self.models, "the world")

    # -- adding and removing models ------------------------------------------------------------------------------------

    @abstractmethod
    def _build(self, begin: Sequence[Model] = ()) -> None:
        """Rebuild the engine's model with the present models.

        The models `begin` are set to their start; the states of all others are preserved. If a HricError is raised, the
        engine's model is unchanged."""

    def _check_name(self, name: str) -> None:
        taken = [self._name, *self.models]
        if not name or "::" in name or name in taken:
            raise HricError(
                f"model name {name!r} is taken, empty or contains '::'; taken names: {', '.join(sorted(taken))}"
            )

    def _admit(self, model: Model) -> None:
        """Add a model, which appears in the engine after the next `_build`.

        Raises UnknownNameError if a surface rule for the model matches none of its links; then nothing is changed."""
        self._surfaces[model.name] = self._rules.of_model(model.name, model.tree.links, model.surface, model.surfaces)
        self.models[model.name] = model

    def _dismiss(self, name: str) -> None:
        """Remove a model with its wrenches and connections; it disappears from the engine at the next `_build`."""
        del self.models[name], self._surfaces[name]
        self.joints.pop(name, None)
        self.bushings.forget_model(name)
        self.wrenches.clear_model(name)

    def _restore(self) -> None:
        """Add the missing objects of the world file, and put all of its objects first in `models`.

        Raises:
            HricError: the name of an object is taken or invalid, or a surface rule matches none of its links.
        """
        for name, model in self._start.items():
            if name not in self.models:
                self._check_name(name)
                self._admit(model)
        self.models = {name: self.models[name] for name in dict.fromkeys([*self._start, *self.models])}

    def spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model with its root link at T_world_model, shape (4, 4); `surfaces`: contact surfaces by link name.

        Raises:
            HricError: the name is taken, or the URDF or a surface is invalid; the world is then unchanged.
        """
        self._check_name(name)
        model = model_of_urdf(name, urdf_xml, T_world_model, fixed=fixed)
        model.surfaces = dict(surfaces)
        self._admit(model)
        try:
            self._build([model])
        except BaseException:
            self._dismiss(name)
            raise

    def delete(self, name: str) -> None:
        """Remove a model; an object of the world file is added again by the next reset.

        Raises:
            UnknownNameError: there is no such model.
        """
        self._check_model(name)
        self._dismiss(name)
        self._build()

    # -- names ---------------------------------------------------------------------------------------------------------

    def has(self, model: str) -> bool:
        """Return True if `model` is the name of the robot or of a model."""
        return model == self._name or model in self.models

    def _description(self, model: str) -> Robot:
        """Return the parsed URDF of a model or of the robot. Raises UnknownNameError if there is no such model."""
        if not self.has(model):
            raise UnknownNameError("model", model, [self._name, *self.models], "the world")
        return self._tree if model == self._name else self.models[model].tree

    def find(self, body: str) -> tuple[str, str]:
        """Return (model, link) of a body's name, "link" (of the robot) or "model::link".

        Raises:
            UnknownNameError: there is no such model or link.
        """
        model, separator, link = body.rpartition("::")
        model = model if separator else self._name
        links = self._description(model).links
        if link not in links:
            raise UnknownNameError("link", link, links, model)
        return model, link

    def full_name(self, body: str) -> str:
        """Return the name "model::link" of a body that is given as "link" or "model::link". Raises UnknownNameError."""
        return "::".join(self.find(body))

    def near(self, body: str) -> list[str]:
        """Return the names "model::link" of a link and its neighbours in its model. Raises UnknownNameError."""
        model, link = self.find(body)
        return [f"{model}::{name}" for name in self._description(model).near(link)]

    def base_link(self, model: str) -> str:
        """Return the name of the root link of a model or of the robot. Raises UnknownNameError."""
        return self._description(model).root

    def _surfaces_of_links(self) -> dict[str, Surface]:
        """Return the contact surfaces of all links by "model::link", including the robot's links."""
        return {
            f"{model}::{link}": surface for model, links in self._surfaces.items() for link, surface in links.items()
        }
