"""Everything around the robot: the objects of the world file and the models spawned later."""

from collections.abc import Sequence

import numpy as np
import opensim

from hric_control.errors import HricError, UnknownNameError
from hric_control.geometry import FloatArray, homogeneous
from hric_control.plants import Surface, Surfaces, WorldObject
from hric_control.urdf import Robot as Description
from opensim_ros_control import collision, shapes
from opensim_ros_control.bodies import Kinematics, Reactions
from opensim_ros_control.engine import Engine
from opensim_ros_control.forces import Forces
from opensim_ros_control.robot import Robot
from opensim_ros_control.scene import Model, model_of_object, model_of_urdf
from urdf_to_osim.transforms import matrix

_FAR_ROTATED = 1.0
"""Where a free body's middle angle passes this, its joint frame is laid again: at a right angle its three angles fail
[rad] (project default, unconfirmed)."""
_MIDDLE = 1
_ROBOT_SURFACE = Surface()


class World:
    """Models by name; whenever one comes or goes the whole model is built again and everything goes on where it is.

    Args:
        robot: with the engine.
        objects: of the world file.
        rules: surfaces of single links.
        T_ground_world: pose of the world in OpenSim's ground, shape (4, 4).
        masks: pairs of link patterns of the robot that do not collide.

    Attributes:
        models: besides the robot.
        forces: contact and wrenches.
    """

    def __init__(
        self,
        robot: Robot,
        objects: Sequence[WorldObject],
        rules: Surfaces,
        T_ground_world: FloatArray,
        masks: Sequence[tuple[str, str]],
    ) -> None:
        config = robot.config
        self.robot, self._masks, self._config = robot, list(masks), config
        self._name = robot.model.robot.name
        self._R_ground_world, self._rules = T_ground_world[:3, :3], rules
        self.forces = Forces(robot, self._R_ground_world)
        self._bound: Engine | None = None
        self._middle: dict[str, int] = {}
        self._shapes = self._shapes_of(robot.model.robot, "") if config.collision else {}
        self._surfaces = {self._name: rules.of_model(self._name, robot.model.robot.links, _ROBOT_SURFACE)}
        self._start = {item.name: model_of_object(item) for item in objects}
        self.models: dict[str, Model] = {}
        for model in self._start.values():
            self._check_name(model.name)
            self._admit(model)
        if self._start:
            self._build(self._start)

    # -- models --------------------------------------------------------------------------------------------------------

    def _check_name(self, name: str) -> None:
        taken = [self._name, *self.models]
        if not name or "::" in name or name in taken:
            raise HricError(f"model name {name!r} is taken, empty or has '::' in it; taken: {', '.join(sorted(taken))}")

    @staticmethod
    def _shapes_of(description: Description | Model, prefix: str) -> dict[str, list[shapes.Shape]]:
        links = description.tree.links if isinstance(description, Model) else description.links
        found = {f"{prefix}{name}": shapes.shapes(link.collisions) for name, link in links.items()}
        if isinstance(description, Model):
            found.update({f"{prefix}{name}": [shapes.plane()] for name in description.planes})
        return {link: of_link for link, of_link in found.items() if of_link}

    def _admit(self, model: Model) -> None:
        self._surfaces[model.name] = self._rules.of_model(model.name, model.tree.links, model.surface)
        self._shapes.update(self._shapes_of(model, f"{model.name}::"))
        self.models[model.name] = model
        model.T_world_origin = model.T_world_start

    def _dismiss(self, name: str) -> None:
        del self.models[name], self._surfaces[name]
        self._shapes = {link: of_link for link, of_link in self._shapes.items() if not link.startswith(f"{name}::")}
        self.forces.wrenches.clear_model(name)

    def _build(self, again: Sequence[str] | dict[str, Model]) -> None:
        """The engine with the models of now; those named start at their origins, the others go on."""
        self.robot.model.beside = list(self.models.values())
        self.robot.build_again(lambda engine: self._put(engine, {name: self.models[name] for name in again}))

    def _put(self, engine: Engine, models: dict[str, Model]) -> None:
        """Put free models at their origins with their velocities of the start."""
        q, u = engine.q(), engine.u()
        for model in models.values():
            for joint in model.tree.joints:
                for path in engine.built.joints.get(f"{model.name}::{joint}", ()):
                    q[engine.index[path]] = u[engine.index[path]] = 0.0
            if not model.fixed:
                self._put_free(engine, model, q, u, np.concatenate([model.angular, model.linear]))
        engine.put(q, u)

    @staticmethod
    def _put_free(engine: Engine, model: Model, q: FloatArray, u: FloatArray, twist: FloatArray) -> None:
        """Coordinates of a free joint at zero; its speeds are (angular, linear) velocity of the body in axes of the
        joint's frame."""
        paths, R = engine.built.joints[model.free_joint], model.T_world_origin[:3, :3]
        indices = [engine.index[path] for path in paths]
        q[indices], u[indices] = 0.0, np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])

    def spawn(self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool) -> None:
        """Add a model. Raises HricError when the name is taken or the URDF is bad; the world is then as before."""
        self._check_name(name)
        model = model_of_urdf(name, urdf_xml, T_world_model, fixed=fixed)
        self._admit(model)
        try:
            self._build([name])
        except BaseException:
            self._dismiss(name)
            self.robot.model.beside = list(self.models.values())
            raise

    def delete(self, name: str) -> None:
        """Remove a model that is not the robot; an object of the world file comes back with the next reset."""
        if name not in self.models:
            raise UnknownNameError("model", name, self.models, "the world")
        self._dismiss(name)
        self._build([])

    def reset(self) -> None:
        """All models as at the start, those spawned where they were put, no wrench, no memory of contact."""
        self.forces.wrenches.clear()
        self.forces.forget()
        for name in self._start:
            if name not in self.models:
                self._admit(self._start[name])
        self.models = {name: self.models[name] for name in dict.fromkeys([*self._start, *self.models])}
        for model in self.models.values():
            model.T_world_origin = model.T_world_start
        if self.models or self.robot.model.beside:
            self._build(self.models)

    def _relocate_free_joints(self) -> None:
        """Put the joint frames of free bodies that have rotated far where the bodies are."""
        turned = [self.models[name] for name, index in self._middle.items() if abs(self.robot.y[index]) > _FAR_ROTATED]
        if not turned:
            return
        states = {model.name: self.state(f"{model.name}::{model.tree.root}") for model in turned}
        for model in turned:
            model.T_world_origin = states[model.name][0]
        self.robot.model.beside = list(self.models.values())

        def put(engine: Engine) -> None:
            q, u = engine.q(), engine.u()
            for model in turned:
                twist = states[model.name][1]
                self._put_free(engine, model, q, u, np.concatenate([twist[3:], twist[:3]]))
            engine.put(q, u)

        self.robot.build_again(put)
        self._bind()

    # -- names ---------------------------------------------------------------------------------------------------------

    def find(self, body: str) -> tuple[str, str]:
        """(model, link) of "link" (of the robot) or "model::link".

        Raises:
            UnknownNameError: no such model or link.
        """
        model, separator, link = body.rpartition("::")
        model = model if separator else self._name
        if model != self._name and model not in self.models:
            raise UnknownNameError("model", model, [self._name, *self.models], "the world")
        links = self.robot.model.robot.links if model == self._name else self.models[model].tree.links
        if link not in links:
            raise UnknownNameError("link", link, links, model)
        return model, link

    def base_link(self, model: str) -> str:
        """Root link of a model. Raises UnknownNameError."""
        if not self.has(model):
            raise UnknownNameError("model", model, [self._name, *self.models], "the world")
        return self.robot.model.robot.root if model == self._name else self.models[model].tree.root

    def has(self, model: str) -> bool:
        """Whether there is such a model, the robot among them."""
        return model == self._name or model in self.models

    def frame(self, body: str) -> str:
        """Name of a body's frame in the engine. Raises UnknownNameError."""
        model, link = self.find(body)
        return link if model == self._name else f"{model}::{link}"

    def state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """(T_world_link shape (4, 4), twist at the link frame's origin in the world frame, linear then angular, shape
        (6,))."""
        engine = self.robot.synchronised()
        frame, R = engine.frame(self.frame(body)), self._R_ground_world.T
        T_ground_link, twist = (
            matrix(frame.getTransformInGround(engine.system_state)),
            _spatial(frame.getVelocityInGround(engine.system_state)),
        )
        T_world_link = homogeneous(R @ T_ground_link[:3, :3], R @ T_ground_link[:3, 3])
        return T_world_link, np.concatenate([R @ twist[3:], R @ twist[:3]])

    # -- the step ------------------------------------------------------------------------------------------------------

    def _bind(self) -> None:
        """Everything that depends on one build of the model."""
        engine = self._bound = self.robot.engine
        description, kinematics = engine.built.description, Kinematics(engine)
        indices = {joint: [engine.index[path] for path in paths] for joint, paths in engine.built.joints.items()}
        made = collision.make_colliders(description, self._shapes, engine, kinematics, indices, self._name)
        pairs = collision.colliding_pairs(description, made, self._name, self._masks, self._config.self_collision)
        surfaces = {
            f"{model}::{link}": surface for model, links in self._surfaces.items() for link, surface in links.items()
        }
        joints = [(name, joint.child) for name, joint in self.robot.model.joints.items()]
        self.forces.bind(
            kinematics, collision.Collisions(pairs, engine.nu), surfaces, Reactions(engine, joints, kinematics)
        )
        self._middle = {
            name: indices[model.free_joint][_MIDDLE] for name, model in self.models.items() if not model.fixed
        }

    def act(self) -> None:
        """Decide what acts on all bodies in the coming step, and set it in the robot."""
        if self.robot.engine is not self._bound:
            self._bind()
        if self._middle:
            self._relocate_free_joints()
        self.forces.act(self.frame)


def _spatial(vector: opensim.SpatialVec) -> FloatArray:
    """Angular and linear part of a velocity of OpenSim's, shape (6,)."""
    return np.array([vector.get(i).get(j) for i in (0, 1) for j in range(3)])
