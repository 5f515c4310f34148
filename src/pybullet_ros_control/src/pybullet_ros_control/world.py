"""World around the robot in PyBullet: the objects of the world file and the models that are spawned later."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import pybullet

from hric_control.plants import PLAIN_LINK, Model, Models, PlantConfig, Surfaces, WorldObject
from hric_core import urdf
from hric_core.geometry import quaternion_from_rotation
from pybullet_ros_control.contact import EngineLink, PybulletPenaltyContact
from pybullet_ros_control.engine import BodyState, LoadedBody, PhysicsClient
from pybullet_ros_control.external_forces import ExternalForces
from pybullet_ros_control.model_joints import FreeModelJoints, PybulletModelJoints
from pybullet_ros_control.robot import PybulletRobot
from pybullet_ros_control.urdf_model import EngineModel, prepare

if TYPE_CHECKING:  # bushings import this module
    from pybullet_ros_control.bushings import PybulletBushings

_GEOMETRY = {
    "box": lambda s: {"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.5 * x for x in s]},
    "sphere": lambda s: {"shapeType": pybullet.GEOM_SPHERE, "radius": s[0]},
    "cylinder": lambda s: {"shapeType": pybullet.GEOM_CYLINDER, "radius": s[0], "height": s[1]},
    "capsule": lambda s: {"shapeType": pybullet.GEOM_CAPSULE, "radius": s[0], "height": s[1]},
    "plane": lambda s: {"shapeType": pybullet.GEOM_PLANE, "planeNormal": [0.0, 0.0, 1.0]},
}


class PybulletWorld(Models[PybulletModelJoints]):
    """Bodies by name, the robot first, with their surfaces and the penalty contact between them.

    Args:
        engine: engine with the bodies.
        robot: robot in the engine.
        tree: description of the robot.
        objects: objects of the world file.
        rules: configured surfaces of single links.
        config: parameters of the plant.

    Attributes:
        bodies: bodies by the name of their model.
        by_id: bodies by PyBullet's number.
        forces: external forces on bodies.
        penalty: penalty contact.
        bushings: bushings between links; the plant adds them.
    """

    bushings: "PybulletBushings"

    def __init__(
        self,
        engine: PhysicsClient,
        robot: PybulletRobot,
        tree: urdf.Robot,
        objects: Sequence[WorldObject],
        rules: Surfaces,
        config: PlantConfig,
    ) -> None:
        super().__init__(tree, objects, rules, config)
        self._engine, self._robot = engine, robot
        self._prepared: dict[str, EngineModel] = {}
        self.bodies: dict[str, LoadedBody] = {}
        self.by_id: dict[int, LoadedBody] = {}
        self._apart: set[tuple[str, str]] = set()
        self.forces = ExternalForces(engine)
        self.penalty = PybulletPenaltyContact(engine, self.springs)
        self._restore()
        self._fill()

    # -- models --------------------------------------------------------------------------------------------------------

    def _admit(self, model: Model) -> None:
        if model.plain is None:
            prepared = prepare(model.tree, fixed_base=model.fixed, visual=self._engine.gui, stops=False)
            self._prepared[model.name] = prepared
        super()._admit(model)

    def _dismiss(self, name: str) -> None:
        # Links that its bushings kept from touching get their contact back while the engine still has the body.
        self.bushings.forget_model(name)
        self.bushings.bind()
        super()._dismiss(name)
        if name in self.bodies:
            self._engine.remove(self.bodies.pop(name))

    def _build(self, begin: Sequence[Model] = ()) -> None:
        for model in begin:
            self._load(model)
        self._changed()

    def reset(self) -> None:
        """Load all bodies again in their start state, so that nothing in the engine's memory affects the next run."""
        self.wrenches.clear()
        self._restore()
        self._build_again(None)
        self.bushings.restart()

    def rebuild(self) -> None:
        """Load all bodies again in their present state."""
        self._build_again({name: self._engine.state(self.bodies[name]) for name in self.models})

    def _build_again(self, states: dict[str, BodyState] | None) -> None:
        """Load all bodies again; states: states of the models by name, None: their start states."""
        self._engine.settings()
        self._robot.load_again()
        self._fill(states)
        self.bushings.bind()

    def _fill(self, states: dict[str, BodyState] | None = None) -> None:
        """Load all models into an engine with only the robot; states: states by name, None: their start states."""
        self.bodies = {}
        self._add(self._robot.body)
        for model in self.models.values():
            self._load(model)
        for name, state in (states or {}).items():
            self._engine.set_state(self.bodies[name], state)
        if states is None:
            for joints in self.joints.values():
                joints.reset()
        self._changed()

    def _load(self, model: Model) -> None:
        body = self._load_model(model) if model.plain is None else self._load_shape(model.plain)
        if not model.fixed:
            pybullet.resetBaseVelocity(body.id, model.linear, model.angular, physicsClientId=self._engine.client)
        self._add(body)

    def _load_model(self, model: Model) -> LoadedBody:
        T, prepared = model.T_world_start, self._prepared[model.name]
        body = self._engine.load(model.name, prepared, T, fixed_base=model.fixed, self_collision=False)
        if model.name in self.joints:
            self.joints[model.name].bind(body)
        elif body.joints:
            kind = PybulletModelJoints if model.fixed else FreeModelJoints
            self.joints[model.name] = kind(self._engine, body, model.tree, T, self._config)
        return body

    def _load_shape(self, item: WorldObject) -> LoadedBody:
        client, T = self._engine.client, item.T_world_object
        shape = pybullet.createCollisionShape(**_GEOMETRY[item.shape](item.size), physicsClientId=client)
        body_id = pybullet.createMultiBody(
            item.mass, shape, -1, T[:3, 3].tolist(), quaternion_from_rotation(T[:3, :3]), physicsClientId=client
        )
        pybullet.changeDynamics(body_id, -1, linearDamping=0.0, angularDamping=0.0, physicsClientId=client)
        return LoadedBody(item.name, body_id, None, {PLAIN_LINK: -1}, {}, {})

    def _add(self, body: LoadedBody) -> None:
        self.bodies[body.name] = body
        for link, index in body.links.items():
            friction = self._surfaces[body.name][link].friction
            pybullet.changeDynamics(body.id, index, lateralFriction=friction, physicsClientId=self._engine.client)

    # -- contact -------------------------------------------------------------------------------------------------------

    def _changed(self) -> None:
        self.by_id = {body.id: body for body in self.bodies.values()}
        self.forces.clear()
        apart = [(self._engine_link(a), self._engine_link(b)) for a, b in self._apart]
        surfaces = self._surfaces
        self.penalty.set_pairs(self.bodies, lambda body, index: surfaces[body.name][body.link_names[index]], apart)
        for pair in apart:
            self._let_touch(pair, False)

    def _engine_link(self, name: str) -> EngineLink:
        body, link = self.body_of(name)
        return body.id, body.frame(link)[0]

    def _let_touch(self, pair: tuple[EngineLink, EngineLink], touching: bool) -> None:
        (body_a, link_a), (body_b, link_b) = pair
        pybullet.setCollisionFilterPair(
            body_a, body_b, link_a, link_b, int(touching), physicsClientId=self._engine.client
        )

    def keep_apart(self, pairs: Iterable[tuple[str, str]]) -> bool:
        """Set the link pairs ("model::link") that must not touch; return True if a former pair may touch again."""
        before, self._apart = self._apart, set(pairs)
        free = before - self._apart
        for a, b in free:
            self._let_touch((self._engine_link(a), self._engine_link(b)), True)
        if before != self._apart:
            self._changed()
        return bool(free)

    def forget_contacts(self) -> None:
        """Clear contacts and the state of contact springs, after bodies were repositioned."""
        self.penalty.forget()

    def bind_connected(self) -> None:
        """Find the links of the bushings again, after bushings were added or removed."""
        self.bushings.bind()

    def body_of(self, name: str) -> tuple[LoadedBody, str]:
        """Return (body, link name) for "link" (of the robot) or "model::link". Raises UnknownNameError."""
        model, link = self.find(name)
        return self.bodies[model], link
