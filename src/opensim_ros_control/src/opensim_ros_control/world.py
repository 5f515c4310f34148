"""World around the robot in OpenSim: the objects of the world file and the models that are spawned later."""

from collections.abc import Sequence

import numpy as np
import opensim

from hric_control.plant import JointReaction
from hric_control.plants import DrivenJoints, Model, Models, Surfaces, WorldObject, never_touching
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
"""Middle Euler angle of a free body beyond which its joint frame is moved to the body [rad].

The Euler angles are singular at a right angle. Project default, unconfirmed.
"""
_MIDDLE = 1


class OpenSimWorld(Models[OpenSimModelJoints]):
    """Models around the robot. Robot and models are one OpenSim model, which each addition or removal builds again.

    Args:
        robot: robot with the engine.
        objects: objects of the world file.
        rules: configured surfaces of single links.
        T_ground_world: pose of the world in OpenSim's ground, shape (4, 4).
        masks: pairs of patterns of the robot's links that do not collide.

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
        self.robot, self._R_ground_world = robot, T_ground_world[:3, :3]
        self._exempt = never_touching(robot.model.robot, masks)
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
        """Build the OpenSim model again.

        begin: models that start in their start pose, with their joints at the stored start positions.
        """
        self.robot.model.neighbours = list(self.models.values())
        self.robot.build_again(lambda engine: self._put(engine, begin))

    def _put(self, engine: OpenSimEngine, models: Sequence[Model]) -> None:
        """Set models in an engine to their initial states: start pose, start velocity, and joint positions."""
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
        """Write a free model's state into q and u: joint at zero, twist (angular, linear) in world axes, shape (6,)."""
        paths, R = engine.built.joints[model.free_joint], model.T_world_origin[:3, :3]
        indices = [engine.index[path] for path in paths]
        q[indices], u[indices] = 0.0, np.concatenate([R.T @ twist[:3], R.T @ twist[3:]])

    def reset(self) -> None:
        """Reset all models to their start states, and clear wrenches, drives, and states of contacts and bushings."""
        self.wrenches.clear()
        self.bushings.restart()
        self._restore()
        for model in self.models.values():
            model.T_world_origin = model.T_world_start
            self.joints[model.name].let_go()
        if self.models or self.robot.model.neighbours:
            self._build(list(self.models.values()))

    def _relocate_free_joints(self) -> None:
        """Move the joint frames of free bodies to the bodies if their Euler angles come near the singularity."""
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
        """Return the engine's frame name of "link" (robot) or "model::link". Raises UnknownNameError."""
        model, link = self.find(body)
        return link if model == self._name else f"{model}::{link}"

    def state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, shape (4, 4); twist of the link's origin, linear then angular, world axes, (6,))."""
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
        """Let contact, joints and bushings use the present build of the OpenSim model."""
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
            self._exempt,
            self._config.self_collision,
            self.bushings.apart(),
        )
        return collision.Collisions(pairs, engine.nu)

    def _bind_if_new(self) -> None:
        if self.robot.engine is not self._bound:
            self._bind()

    def act(self) -> None:
        """Compute contact, wrenches, bushings and models' joint efforts of the coming step; set them in the robot."""
        self._bind_if_new()
        if self._middle:
            self._relocate_free_joints()
        held = self.bushings.efforts(self.robot.y) if self.bushings.any else None
        for joints in self._acting:
            held = joints.act(held)
        self.forces.act(self.frame, held)

    def reactions(self) -> list[JointReaction]:
        """Return force and torque in each moving joint of the robot in the last step; empty before a build's first."""
        self._bind_if_new()
        return self.forces.reactions(self.bushings.loads())

    # -- joints of models, and bushings between links ------------------------------------------------------------------

    def joints_of(self, model: str) -> DrivenJoints:
        """Return the joints of a model around the robot. Raises UnknownNameError."""
        self._bind_if_new()
        return super().joints_of(model)

    def forget_contacts(self) -> None:
        """Clear contacts and the state of contact springs, after bodies were repositioned."""
        self.forces.forget()

    def bind_connected(self) -> None:
        """Update the pairs that may touch, and the links of the bushings, after bushings were added or removed."""
        self._bind_if_new()
        self.forces.look_at(self._collisions())
        self.bushings.bind(self.robot.engine, self._kinematics, self.frame)


def _spatial(vector: opensim.SpatialVec) -> FloatArray:
    """Return an OpenSim velocity as an array, angular then linear, shape (6,)."""
    return np.array([vector.get(i).get(j) for i in (0, 1) for j in range(3)])
