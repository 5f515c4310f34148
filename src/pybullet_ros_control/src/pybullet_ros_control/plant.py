"""PyBullet plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pybullet

from hric_control.plant import Contact, FloatArray, Load, Surface
from hric_control.plants import (
    EnginePlant,
    PlantConfig,
    Surfaces,
    Wrenches,
    load_masks,
    load_surfaces,
    load_world,
    payload,
)
from hric_core.errors import FailureError
from hric_core.urdf import read
from pybullet_ros_control.bushings import EngineBushings
from pybullet_ros_control.engine import BodyState, Engine
from pybullet_ros_control.robot import Robot
from pybullet_ros_control.world import World


class PyBulletPlant(EnginePlant):
    """Plant on PyBullet; see `hric_control.plant.Plant`.

    Attributes:
        config: checked parameters.
        robot: the robot.
        world: models around the robot.
    """

    robot: Robot
    world: World

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]) -> None:
        self.joint_names = tuple(joint_names)
        self.config = PlantConfig.of(config, "plant/", self.joint_names)
        self.time_step, self.integrator = self.config.time_step, self.config.integrator
        self.gravity = self.config.gravity
        tree = read(urdf_xml)
        tree.check_actuated(self.joint_names)
        masks = load_masks(self.config.collision_masks)
        objects = load_world(self.config.world, self.config.contact_stiffness)
        rules = Surfaces((*load_surfaces(self.config.world), *self.config.surfaces), self.config.contact_stiffness)
        self._wrenches = Wrenches(self.time_step)
        self._engine = Engine(self.config.gui, self.time_step, self.config.gravity)
        try:
            self.robot = Robot(self._engine, tree, self.joint_names, self.config, masks)
            self.world = World(self._engine, self.config, objects, rules)
            self.world.build(self.robot.body)
            self.world.bushings = EngineBushings(self._engine, self.world, self.robot, self.config)
            self._put([0.0] * len(self.joint_names), None)
        except BaseException:
            self._engine.close()
            raise

    def close(self) -> None:
        """Release the engine; safe to call twice."""
        self._engine.close()

    # -- state ---------------------------------------------------------------------------------------------------------

    def _put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        self.robot.put(q, [0.0] * len(q) if dq is None else dq)
        self._values = self.robot.joints.zeros
        self.world.penalty.forget()

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Reset robot and world by a new build, so that no contact memory or warm start reaches the next run."""
        self._wrenches.clear()
        self._build_again(None)
        self.world.bushings.restart()
        self._put(q, dq)

    def _build_again(self, states: dict[str, BodyState] | None) -> None:
        self._engine.settings()
        self.robot.load_again()
        self.world.build(self.robot.body, states)
        self.world.bushings.bind()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest; the world does not change."""
        self._put(q, None)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Read position, velocity and effort at the measuring instant.

        The engine's position belongs to the end of the step, its velocity to the middle; q - dt dq/2 synchronises both.
        """
        robot = self.robot
        robot.joints.read((robot.at, robot.dq, robot.effort), q, dq, tau)

    def motor_effort(self) -> list[float]:
        """Return the motor efforts of the last step, n floats [N m]."""
        return self.robot.joints.pick(self.robot.motor_effort)

    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return the engine's raw q, dq."""
        robot = self.robot
        return robot.joints.pick(robot.q), robot.joints.pick(robot.dq)

    def mass_matrix(self) -> FloatArray:
        """Return the engine's own mass matrix at the present engine position, shape (n, n) [kg m^2]."""
        robot = self.robot
        J = robot.joints.law_jacobian()[:, robot.joints.user]
        return np.asarray(J.T @ np.array(robot.mass_matrix(robot.q)) @ J)

    # -- the step ------------------------------------------------------------------------------------------------------

    def apply(self, tau: Sequence[float]) -> None:
        """Set the commands for the next step: efforts [N m], or values by `set_modes`."""
        self._values = self.robot.joints.command(tau)

    def step(self) -> None:
        """Advance by `time_step`."""
        world = self.world
        pushing = self._wrenches.active or world.penalty.pairs or world.joints or world.bushings.laws
        try:
            self.robot.step(self._values, self._push() if pushing else None)
            if pushing:
                for joints in world.joints.values():
                    joints.refresh()
        except pybullet.error as error:
            raise FailureError(
                f"PyBullet stopped ({error})" + ("; was its window closed?" if self.config.gui else "")
            ) from error

    def _push(self) -> list[float] | None:
        """Apply wrenches, penalty contact, bushings and models' joint efforts.

        Returns the efforts of the first two in the robot's joints.
        """
        world, robot = self.world, self.robot
        summed = [joints.body for joints in world.joints.values() if joints.fixed]
        world.forces.begin([robot.body, *summed] if robot.balanced else summed)
        for wrench in self._wrenches.active:
            body, link = world.find(wrench.body)
            index, T_body_frame = body.frame(link)
            T_world_link = self._engine.pose(body, index) @ T_body_frame
            point = T_world_link[:3, :3] @ wrench.point + T_world_link[:3, 3]
            world.forces.apply(body, index, wrench.force.tolist(), wrench.torque.tolist(), point.tolist())
        self._wrenches.count_step()
        if world.penalty.pairs:
            world.penalty.apply(world.forces, robot, world.joints)
        self.world.bushings.act()
        for joints in world.joints.values():
            joints.act(world.forces.efforts(joints.body))
        return world.forces.efforts(robot.body)

    # -- load ----------------------------------------------------------------------------------------------------------

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a payload to `link` (default: the link behind the last joint) instead of the previous one.

        Everything is built again in its present state: the engine's inverse dynamics ignores a changed mass, and may
        confuse a new body with an old one at the same address.
        """
        if load is None:
            self.robot.set_load(None)
        else:
            self.robot.set_load((link or self.robot.last_link, payload(load)))
        self._build_again(self.world.states())

    # -- the world -----------------------------------------------------------------------------------------------------

    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to "link" or "model::link" for `duration` [s], in whole steps (negative: until cleared)."""
        self._wrenches.add(self.world.full_name(body), force, torque, point, duration)

    def clear_wrenches(self, body: str | None = None) -> None:
        """End the wrenches on one body ("model" for all its links), or all."""
        if body is None:
            self._wrenches.clear()
        elif "::" not in body and body in self.world.bodies:
            self._wrenches.clear_model(body)
        else:
            self._wrenches.clear_link(self.world.full_name(body))

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.world.contacts()

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest spring contact force of each pair since the last call [N]."""
        return self.world.penalty.springs.take_peaks()

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model."""
        self.world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a model, the wrenches on it, and its bushings."""
        self.world.check_model(name)
        self.world.bushings.forget_model(name)
        self.world.bushings.bind()
        self.world.delete(name)
        self._wrenches.clear_model(name)

    def model_names(self) -> list[str]:
        """Return the names of all models but the robot."""
        return self.world.model_names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, (4, 4), twist at the link's origin, world frame, linear then angular, (6,))."""
        model, link = self.world.find(body)
        index, T_body_frame = model.frame(link)
        T_world_link = self._engine.pose(model, index) @ T_body_frame
        com, _, linear, angular = self._engine.motion(model, index)
        return T_world_link, np.concatenate([linear + np.cross(angular, T_world_link[:3, 3] - com), angular])
