"""The models around a robot by name, each with its description; a plain shape of a world file gets one."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from hric_control.plant import Load, Surface
from hric_control.plants.surfaces import Surfaces
from hric_control.plants.worlds import PLAIN_LINK, WorldObject
from hric_core.errors import DescriptionError, HricError, ParameterError, UnknownNameError
from hric_core.geometry import FloatArray, MassProperties
from hric_core.resources import read_description
from hric_core.urdf import Robot, read, write_inertial

_PLANE_DRAWN = 2.0
"""Side of the square that represents a plane in pictures [m]; project default, unconfirmed."""
TRACE = 1e-12
"""Mass [kg] and moments of inertia [kg m^2] of a moving link that has none, where something with mass follows: engines
refuse zero, and nothing feels this. Default chosen by this project, unconfirmed."""


@dataclass
class Model:
    """A model beside the robot.

    Attributes:
        tree: its description.
        T_world_start: of its root link, shape (4, 4).
        fixed: to the world.
        surface: of its links.
        surfaces: of single links, by name, in place of it.
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
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
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
        text = read_description(item.urdf)
        model = model_of_urdf(item.name, text, item.T_world_object, fixed=fixed, surface=item.surface)
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


def payload(load: Load) -> MassProperties:
    """A load as a mass. Raises ParameterError where it is none."""
    if load.mass < 0.0 or len(load.com) != 3 or len(load.inertia) != 9:
        raise ParameterError(f"a load needs mass >= 0, com of 3 and inertia of 9 numbers; got {load}")
    return MassProperties(
        float(load.mass), np.array(load.com, dtype=float), np.array(load.inertia, dtype=float).reshape(3, 3)
    )


def moving_body(tree: Robot, link: str, total: MassProperties) -> MassProperties:
    """Return the mass of a moving link with what is fixed to it as an engine can have it.

    Args:
        tree: the description.
        link: the topmost of them.
        total: their sum, in axes of the link.

    Raises:
        DescriptionError: it is none, and nothing further out has one: nothing would resist the joint.
    """
    if total.mass <= 0.0:
        outer = (tree.links[joint.child].mass for joint, _ in tree.beyond(link))
        if total.inertia.any() or not any(mass is not None and mass.mass > 0.0 for mass in outer):
            raise DescriptionError(f"link {link}: it moves, but neither it nor what is fixed to it has a mass")
        total = MassProperties(TRACE, np.zeros(3), np.zeros((3, 3)))
    return as_point(total) if np.abs(total.inertia).max() < TRACE else total


def as_point(body: MassProperties) -> MassProperties:
    """Return a point mass with a trace of inertia."""
    return MassProperties(body.mass, body.com, body.inertia + TRACE * np.eye(3))


class Models(ABC):
    """Models around a robot by name; whenever one comes or goes the engine's model is built again and everything goes
    on where it is.

    Args:
        name: of the robot's model.
        tree: the robot's description.
        objects: of the world file; a subclass admits them by `_restore` once it is ready for them.
        rules: surfaces of single links.

    Attributes:
        models: besides the robot.

    Raises:
        HricError: an object or a rule that cannot be used.
    """

    def __init__(self, name: str, tree: Robot, objects: Sequence[WorldObject], rules: Surfaces) -> None:
        self._name, self._tree, self._rules = name, tree, rules
        self._surfaces = {name: rules.of_model(name, tree.links, Surface())}
        self._start = {item.name: model_of_object(item) for item in objects}
        self.models: dict[str, Model] = {}

    # -- coming and going ----------------------------------------------------------------------------------------------

    @abstractmethod
    def _build(self, begin: Sequence[Model] = ()) -> None:
        """Build the engine's model again, with the models of now; everything goes on where it is, but for those that
        begin. Raises HricError; the engine's model is then the one before."""

    def _check_name(self, name: str) -> None:
        taken = [self._name, *self.models]
        if not name or "::" in name or name in taken:
            raise HricError(f"model name {name!r} is taken, empty or has '::' in it; taken: {', '.join(sorted(taken))}")

    def _admit(self, model: Model) -> None:
        """Have a model from the next build on. Raises UnknownNameError when a rule for it fits none of its links;
        nothing has changed then."""
        self._surfaces[model.name] = self._rules.of_model(model.name, model.tree.links, model.surface, model.surfaces)
        self.models[model.name] = model

    def _dismiss(self, name: str) -> None:
        """Have a model no longer from the next build on."""
        del self.models[name], self._surfaces[name]

    def _restore(self) -> None:
        """Admit the objects of the world file that are not there; all of them come first again.

        Raises:
            HricError: the name of one is taken or bad, or a rule does not fit it.
        """
        for name, model in self._start.items():
            if name not in self.models:
                self._check_name(name)
                self._admit(model)
        self.models = {name: self.models[name] for name in dict.fromkeys([*self._start, *self.models])}

    def spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model with its root link at T_world_model, shape (4, 4); surfaces: of its links, by name.

        Raises:
            HricError: the name is taken, or the URDF or a surface is bad; the world is then as before.
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
        """Remove a model that is not the robot; an object of the world file comes back with the next reset.

        Raises:
            UnknownNameError: no such model.
        """
        if name not in self.models:
            raise UnknownNameError("model", name, self.models, "the world")
        self._dismiss(name)
        self._build()

    # -- names ---------------------------------------------------------------------------------------------------------

    def names(self) -> list[str]:
        """All models but the robot."""
        return list(self.models)

    def has(self, model: str) -> bool:
        """Whether there is such a model, the robot among them."""
        return model == self._name or model in self.models

    def _description(self, model: str) -> Robot:
        """Of a model or the robot. Raises UnknownNameError."""
        if not self.has(model):
            raise UnknownNameError("model", model, [self._name, *self.models], "the world")
        return self._tree if model == self._name else self.models[model].tree

    def find(self, body: str) -> tuple[str, str]:
        """(model, link) of "link" (of the robot) or "model::link".

        Raises:
            UnknownNameError: no such model or link.
        """
        model, separator, link = body.rpartition("::")
        model = model if separator else self._name
        links = self._description(model).links
        if link not in links:
            raise UnknownNameError("link", link, links, model)
        return model, link

    def full_name(self, body: str) -> str:
        """ "model::link" of a body that `find` takes. Raises UnknownNameError."""
        return "::".join(self.find(body))

    def near(self, body: str) -> list[str]:
        """ "model::link" of all that a grip on a body does not collide with. Raises UnknownNameError."""
        model, link = self.find(body)
        return [f"{model}::{name}" for name in self._description(model).near(link)]

    def base_link(self, model: str) -> str:
        """Root link of a model or the robot. Raises UnknownNameError."""
        return self._description(model).root

    def _surfaces_of_links(self) -> dict[str, Surface]:
        """Surfaces by "model::link", the robot's links among them."""
        return {
            f"{model}::{link}": surface for model, links in self._surfaces.items() for link, surface in links.items()
        }
