"""Models around the robot: the objects of the world file and the models spawned later."""

from collections.abc import Sequence

import numpy as np
import opensim

from hric_control.plant import JointReaction
from hric_control.plants import DrivenJoints, Model, Models, Surfaces, WorldObject
from hric_core.geometry import FloatArray, homogeneous
from hric_core.urdf import Robot as Description
from opensim_ros_control import collision, shapes
from opensim_ros_control.bodies import Kinematics, Reactions
from opensim_ros_control.bushings import OpenSimBushings
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.forces import Forces
from opensim_ros_control.model_joints import OpenSimModelJoints
from opensim_ros_control.robot import OpenSimRobot
from urdf_to_osim.transforms import matrix

_FAR_ROTATED = 1.0
"""Middle angle beyond which a free body's joint frame is moved to the body [rad] (project default, unconfirmed).

At a right angle its three angles are singular.
"""
_MIDDLE = 1


class OpenSimWorld(Models[OpenSimModelJoints]):
    """Models around the robot, in one OpenSim model with it, which is built again for each addition or removal.

    Args:
        robot: the robot with the engine.
        objects: objects of the world file.
        rules: surfaces of single links.
        T_ground_world: pose of the world in OpenSim's ground, shape (4, 4).
        masks: pairs of link patterns of the robot that do not collide.

    Attributes:
        forces: contact and wrenches.
        bushings: bushings between links.
    """

    bushings: OpenSimBushings

    def __init__(
        self,
        robot: OpenSimRobot,
        objects: Sequence[WorldObject],
        rules: Surfaces,
        T_ground_world: FloatArray,
        masks: Sequence[tuple[str, str]],
    ) -> None:
        super().__init__(robot.model.robot, objects, rules, robot.config)
        self.robot, self._masks, self._R_ground_world = robot, list(masks), T_ground_world[:3, :3]
        self.forces = Forces(robot, self._R_ground_world, self.wrenches, self.springs)
        self.bushings = OpenSimBushings(self.full_name, self.near, self._R_ground_world)
        self._bound: OpenSimEngine | None = None
        self._middle: dict[str, int] = {}
        self._shapes = self._shapes_of(robot.model.robot, "") if robot.config.collision else {}
        self._restore()
        if self.models:
            self._build(list(self.models.values()))

    # -- models --------------------------------------------------------------------------------------------------------

    @staticmethod
    def _shapes_of(description: Description | Model, prefix: str) -> dict[str, list[shapes.LinkShape]]:
        links = description.tree.links if isinstance(description, Model) else description.links
        by_link = {f"{prefix}{name}": shapes.shapes(link.collisions) for name, link in links.items()}
        if isinstance(description, Model):
            by_link.update({f"{prefix}{name}": [shapes.plane()] for name in description.planes})
        return {link: of_link for link, of_link in by_link.items() if of_link}

    def _admit(self, model: Model) -> None:
        of_links = self._shapes_of(model, f"{model.name}::")
        super()._admit(model)
        self.joints[model.name] = OpenSimModelJoints(model, self.robot)
        self._shapes.update(of_links)
        model.T_world_origin = model.T_world_start

    def _dismiss(self, name: str) -> None:
        super()._dismiss(name)
        self.robot.model.neighbours = list(self.models.values())
        self._shapes = {link: of_link for link, of_link in self._shapes.items() if not link.startswith(f"{name}::")}

    def _build(self, begin: Sequence[Model] = ()) -> None:
        """Build the model; those in `begin` start at their origins, with their joints where they were set last."""
        self.robot.model.neighbours = list(self.models.values())
        self.robot.build_again(lambda engine: self._put(engine, begin))

    def _put(self, engine: OpenSimEngine, models: Sequence[Model]) -> None:
        """Put models in their initial state: free ones at their origins with their initial velocities."""
        q, u = engine.q(), engine.u()
        for model in models:
            for joint in model.tree.joints:
                for path in engine.built.joints.get(f"{model.name}::{joint}", ()):
                    q[engine.index[path]] = u[engine.index[path]] = 0.0
            if not model.fixed:
                self._put_free(engine, model, q, u, np.concatenate([model.angular, model.linear]))
            self.joints[model.name].write_start(engine, q, u)
        engine.put(q, u)

    @staticmethod
    def _put_free(engine: OpenSimEngine, model: Model, q: FloatArray, u: FloatArray, twist: FloatArray) -> None:
        """Set a free joint to zero; its speeds are the body's (angular, linear) velocity in axes of the joint frame."""
        paths, R = engine.built.joints[model.free_joint], model.T_world_origin[:3, :3]
        indices = [engine.index[path] for path in paths]
        q[indices], u[indices] = 0.0, np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])

    def reset(self) -> None:
        """Reset all models to their start, and clear wrenches, drives and the memory of contact and slip."""
        self.wrenches.clear()
        self.bushings.restart()
        self._restore()
        for model in self.models.values():
            model.T_world_origin = model.T_world_start
            self.joints[model.name].let_go()
        if self.models or self.robot.model.neighbours:
            self._build(list(self.models.values()))

    def _relocate_free_joints(self) -> None:
        """Move the joint frames of free bodies that have rotated far to the bodies."""
        turned = [self.models[name] for name, index in self._middle.items() if abs(self.robot.y[index]) > _FAR_ROTATED]
        if not turned:
            return
        states = {model.name: self.state(f"{model.name}::{model.tree.root}") for model in turned}
        for model in turned:
            model.T_world_origin = states[model.name][0]
        self.robot.model.neighbours = list(self.models.values())

        def put(engine: OpenSimEngine) -> None:
            q, u = engine.q(), engine.u()
            for model in turned:
                twist = states[model.name][1]
                self._put_free(engine, model, q, u, np.concatenate([twist[3:], twist[:3]]))
            engine.put(q, u)

        self.robot.build_again(put)
        self._bind()

    # -- names ---------------------------------------------------------------------------------------------------------

    def frame(self, body: str) -> str:
        """Return the engine's frame name of a body. Raises UnknownNameError."""
        model, link = self.find(body)
        return link if model == self._name else f"{model}::{link}"

    def state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, (4, 4), twist at the link's origin, world frame, linear then angular, (6,))."""
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
        """Bind everything that depends on one build of the model."""
        engine = self._bound = self.robot.engine
        description, self._kinematics = engine.built.description, Kinematics(engine)
        indices = {joint: [engine.index[path] for path in paths] for joint, paths in engine.built.joints.items()}
        kinematics = self._kinematics
        self._colliders = collision.make_colliders(description, self._shapes, engine, kinematics, indices, self._name)
        joints = [(joint.name, joint.child) for joint in self.robot.joints.joints]
        reactions = Reactions(engine, joints, kinematics)
        self.forces.bind(kinematics, self._collisions(), self._surfaces_of_links(), reactions)
        self._middle = {
            name: indices[model.free_joint][_MIDDLE] for name, model in self.models.items() if not model.fixed
        }
        for of_model in self.joints.values():
            of_model.bind(engine)
        self._acting = [of_model for of_model in self.joints.values() if of_model.joints.names]
        self.bushings.bind(engine, kinematics, self.frame)

    def _collisions(self) -> collision.Collisions:
        engine = self.robot.engine
        pairs = collision.colliding_pairs(
            engine.built.description,
            self._colliders,
            self._name,
            self._masks,
            self._config.self_collision,
            self.bushings.apart(),
        )
        return collision.Collisions(pairs, engine.nu)

    def _bind_if_new(self) -> None:
        if self.robot.engine is not self._bound:
            self._bind()

    def act(self) -> None:
        """Compute the efforts on all bodies in the coming step, and set them in the robot."""
        self._bind_if_new()
        if self._middle:
            self._relocate_free_joints()
        held = self.bushings.efforts(self.robot.y) if self.bushings.any else None
        for joints in self._acting:
            held = joints.act(held)
        self.forces.act(self.frame, held)

    def reactions(self) -> list[JointReaction]:
        """Return the loads of the robot's moving joints in the last step; empty before the first step of a build."""
        self._bind_if_new()
        return self.forces.reactions(self.bushings.loads())

    # -- joints of models, and bushings between links ------------------------------------------------------------------

    def joints_of(self, model: str) -> DrivenJoints:
        """Return the joints of a model around the robot. Raises UnknownNameError."""
        self._bind_if_new()
        return super().joints_of(model)

    def forget_contacts(self) -> None:
        """Forget contacts and spring memory, after bodies were put elsewhere."""
        self.forces.forget()

    def bind_connected(self) -> None:
        """Bind collisions and bushings after a change of the connections."""
        self._bind_if_new()
        self.forces.look_at(self._collisions())
        self.bushings.bind(self.robot.engine, self._kinematics, self.frame)


def _spatial(vector: opensim.SpatialVec) -> FloatArray:
    """Return angular and linear part of an OpenSim velocity, shape (6,)."""
    return np.array([vector.get(i).get(j) for i in (0, 1) for j in range(3)])
