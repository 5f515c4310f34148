"""Models around the robot in one engine: the objects of the world file and the models spawned later."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import pybullet

from hric_control.plant import Contact
from hric_control.plants import PLAIN_LINK, PlantConfig, Surface, Surfaces, WorldObject
from hric_core.errors import HricError, UnknownNameError
from hric_core.geometry import FloatArray, quaternion_from_rotation
from hric_core.urdf import Robot, read
from pybullet_ros_control.contact import EngineLink, PenaltyContact, rigid_contacts
from pybullet_ros_control.engine import Body, BodyState, Engine
from pybullet_ros_control.external_forces import ExternalForces
from pybullet_ros_control.model_joints import FreeModelJoints, ModelJoints, NoModelJoints
from pybullet_ros_control.urdf_model import EngineModel, prepare

if TYPE_CHECKING:  # bushings import this module
    from pybullet_ros_control.bushings import EngineBushings

_ROBOT_SURFACE = Surface()
_GEOMETRY = {
    "box": lambda s: {"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.5 * x for x in s]},
    "sphere": lambda s: {"shapeType": pybullet.GEOM_SPHERE, "radius": s[0]},
    "cylinder": lambda s: {"shapeType": pybullet.GEOM_CYLINDER, "radius": s[0], "height": s[1]},
    "capsule": lambda s: {"shapeType": pybullet.GEOM_CAPSULE, "radius": s[0], "height": s[1]},
    "plane": lambda s: {"shapeType": pybullet.GEOM_PLANE, "planeNormal": [0.0, 0.0, 1.0]},
}


@dataclass
class World:
    """Bodies by name, the robot first, with their surfaces and the penalty contact between them.

    Args:
        engine: the engine.
        config: the plant's parameters.
        objects: objects of the world file.
        rules: surfaces of single links.

    Attributes:
        spawned: loader of each spawned model, for an emptied engine, and the surfaces of its links.
        joints: joints of the models that have some.
        forces: external forces on bodies.
        bushings: bushings between links; the plant adds them.
    """

    engine: Engine
    config: PlantConfig
    objects: list[WorldObject]
    rules: Surfaces
    bodies: dict[str, Body] = field(default_factory=dict)
    spawned: dict[str, tuple[Callable[[], Body], Mapping[str, Surface]]] = field(default_factory=dict)
    surfaces: dict[str, dict[str, Surface]] = field(default_factory=dict)
    joints: dict[str, ModelJoints] = field(default_factory=dict)
    bushings: "EngineBushings" = field(init=False)

    def __post_init__(self) -> None:
        self._apart: set[tuple[str, str]] = set()
        self.forces = ExternalForces(self.engine)
        self.penalty = PenaltyContact(self.engine)
        self.by_id: dict[int, Body] = {}
        self._robot = ""

    def states(self) -> dict[str, BodyState]:
        """Return the states of all models but the robot."""
        return {name: self.engine.state(self.bodies[name]) for name in self.model_names()}

    def build(self, robot: Body, states: dict[str, BodyState] | None = None) -> None:
        """Fill an engine that contains only the robot: the world at its start, or the models and states of `states`."""
        self._robot = robot.name
        self.bodies, self.surfaces = {}, {}
        self._add(robot.name, robot, _ROBOT_SURFACE)
        for item in self.objects:
            if item.name == robot.name:
                raise HricError(f"object {item.name}: the robot has this name; give the object another one")
            if states is None or item.name in states:
                self._add(item.name, self._load_object(item), item.surface)
        for name, (load, surfaces) in self.spawned.items():
            self._add(name, load(), Surface(), surfaces)
        for name, state in (states or {}).items():
            self.engine.set_state(self.bodies[name], state)
        if states is None:
            for joints in self.joints.values():
                joints.reset()
        self._changed()

    def _add(self, name: str, body: Body, surface: Surface, own: Mapping[str, Surface] = {}) -> None:
        links = body.links if body.model is None else body.model.frames
        self.bodies[name], self.surfaces[name] = body, self.rules.of_model(name, links, surface, own)
        for link, index in body.links.items():
            friction = self.surfaces[name][link].friction
            pybullet.changeDynamics(body.id, index, lateralFriction=friction, physicsClientId=self.engine.client)

    def _changed(self) -> None:
        self.by_id = {body.id: body for body in self.bodies.values()}
        self.forces.clear()
        apart = [(self._engine_link(a), self._engine_link(b)) for a, b in self._apart]
        self.penalty.set_pairs(self.bodies, lambda body, index: self.surfaces[body.name][body.link_names[index]], apart)
        for pair in apart:
            self._let_touch(pair, False)

    def _engine_link(self, name: str) -> EngineLink:
        body, link = self.find(name)
        return body.id, body.frame(link)[0]

    def _let_touch(self, pair: tuple[EngineLink, EngineLink], touching: bool) -> None:
        (body_a, link_a), (body_b, link_b) = pair
        pybullet.setCollisionFilterPair(
            body_a, body_b, link_a, link_b, int(touching), physicsClientId=self.engine.client
        )

    def keep_apart(self, pairs: Iterable[tuple[str, str]]) -> bool:
        """Separate link pairs, by "model::link", that must not touch; return True if others may touch again."""
        before, self._apart = self._apart, set(pairs)
        free = before - self._apart
        for a, b in free:
            self._let_touch((self._engine_link(a), self._engine_link(b)), True)
        if before != self._apart:
            self._changed()
        return bool(free)

    def _load_object(self, item: WorldObject) -> Body:
        T = item.T_world_object
        if item.urdf is not None:
            tree, fixed = read(item.urdf.read_text(encoding="utf-8"), f"model {item.name}"), item.mass == 0.0
            body = self._load_model(item.name, tree, self._prepare(tree, fixed), T, fixed)
        else:
            body = self._load_shape(item)
        if item.mass > 0.0:
            pybullet.resetBaseVelocity(body.id, item.linear, item.angular, physicsClientId=self.engine.client)
        return body

    def _prepare(self, tree: Robot, fixed: bool) -> EngineModel:
        return prepare(tree, fixed_base=fixed, visual=self.engine.gui, stops=False)

    def _load_model(self, name: str, tree: Robot, model: EngineModel, T: FloatArray, fixed: bool) -> Body:
        body = self.engine.load(name, model, T, fixed_base=fixed, self_collision=False)
        if name in self.joints:
            self.joints[name].bind(body)
        elif body.joints:
            self.joints[name] = (ModelJoints if fixed else FreeModelJoints)(self.engine, body, tree, T, self.config)
        return body

    def _load_shape(self, item: WorldObject) -> Body:
        client, T = self.engine.client, item.T_world_object
        shape = pybullet.createCollisionShape(**_GEOMETRY[item.shape](item.size), physicsClientId=client)
        body_id = pybullet.createMultiBody(
            item.mass, shape, -1, T[:3, 3].tolist(), quaternion_from_rotation(T[:3, :3]), physicsClientId=client
        )
        pybullet.changeDynamics(body_id, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
        return Body(item.name, body_id, None, {PLAIN_LINK: -1}, {}, {})

    def spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model. Raises HricError if the name is taken or the URDF or a surface is invalid."""
        if not name or name in self.bodies:
            raise HricError(f"model name {name!r} is taken or empty; taken: {', '.join(sorted(self.bodies))}")
        tree = read(urdf_xml)
        model = self._prepare(tree, fixed)
        own = dict(surfaces)
        self.rules.of_model(name, model.frames, Surface(), own)  # surfaces that do not fit are refused before loading
        load = partial(self._load_model, name, tree, model, T_world_model.copy(), fixed)
        self._add(name, load(), Surface(), own)
        self.spawned[name] = load, own
        self._changed()

    def delete(self, name: str) -> None:
        """Remove a model that is not the robot; an object of the world file returns with the next reset."""
        self.engine.remove(self.bodies.pop(name))
        self.surfaces.pop(name)
        self.spawned.pop(name, None)
        self.joints.pop(name, None)
        self._changed()

    def check_model(self, name: str) -> None:
        """Raise UnknownNameError if there is no such model besides the robot."""
        if name not in self.model_names():
            raise UnknownNameError("model", name, self.model_names(), "the world")

    def model_names(self) -> list[str]:
        """Return the names of all bodies but the robot."""
        return [name for name in self.bodies if name != self._robot]

    def joints_of(self, model: str) -> ModelJoints | NoModelJoints:
        """Return the joints of a model around the robot. Raises UnknownNameError."""
        if model not in self.joints:
            self.check_model(model)
            return NoModelJoints(model)
        return self.joints[model]

    def put_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None) -> None:
        """Put the joints of a model at q, dq. Raises UnknownNameError, CommandError."""
        self.joints_of(model).put(q, dq)
        self.penalty.forget()

    def bind_connected(self) -> None:
        """Bind the bushings after a change of the connections."""
        self.bushings.bind()

    def base_link(self, name: str) -> str:
        """Return the root link of a model. Raises UnknownNameError."""
        if name not in self.bodies:
            raise UnknownNameError("model", name, self.bodies, "the world")
        model = self.bodies[name].model
        return PLAIN_LINK if model is None else model.root

    def find(self, name: str) -> tuple[Body, str]:
        """Return (body, link) of "link" (of the robot) or "model::link".

        Raises:
            UnknownNameError: no such model; the link is checked by the body.
        """
        model, separator, link = name.rpartition("::")
        if not separator:
            return self.bodies[self._robot], name
        if model not in self.bodies:
            raise UnknownNameError("model", model, self.bodies, "the world")
        return self.bodies[model], link

    def near(self, name: str) -> list[str]:
        """Return "model::link" of all links that a grip on a body must not collide with. Raises UnknownNameError."""
        body, link = self.find(name)
        if body.model is None:
            return [f"{body.name}::{link}"]
        return [f"{body.name}::{of}" for of in body.model.description.near(link)]

    def full_name(self, name: str) -> str:
        """Return the full "model::link" of a body name for `find`. Raises UnknownNameError."""
        body, link = self.find(name)
        body.frame(link)
        return f"{body.name}::{link}"

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.penalty.last + rigid_contacts(self.engine, self.by_id)
