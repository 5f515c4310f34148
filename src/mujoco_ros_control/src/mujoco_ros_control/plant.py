"""MuJoCo plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hric_control.plant import Contact, FloatArray, JointReaction, Load, ReactingPlant, Surface
from hric_control.plants import EnginePlant, Model, Surfaces, Wrenches, load_masks, load_surfaces, load_world, payload
from hric_core.urdf import read
from mujoco_ros_control.contact import act, rigid_contacts
from mujoco_ros_control.robot import MujocoConfig, Robot
from mujoco_ros_control.world import World

MANY = 4
"""Number of free objects above which `integrator: auto` is semi-implicit (project default).

50 contacts of 20 objects cost a quarter of Runge-Kutta's time.
"""


class MujocoPlant(EnginePlant, ReactingPlant):
    """Plant on MuJoCo; see `hric_control.plant.Plant`.

    Attributes:
        config: checked parameters, with the chosen integrator.
        robot: the robot.
        world: models around the robot.
    """

    robot: Robot
    world: World

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]) -> None:
        self.joint_names = tuple(joint_names)
        self.config = MujocoConfig.of(config, "plant/", self.joint_names)
        self.time_step = self.config.time_step
        tree = read(urdf_xml)
        tree.check_actuated(self.joint_names)
        if not self.config.collision:
            tree = replace(tree, links={name: replace(link, collisions=()) for name, link in tree.links.items()})
        objects = load_world(self.config.world, self.config.contact_stiffness)
        if self.config.integrator == "auto":
            crowded = sum(item.mass > 0.0 for item in objects) > MANY
            self.config = replace(self.config, integrator="semi_implicit" if crowded else "accurate")
        self.integrator, self.gravity = self.config.integrator, self.config.gravity
        rules = Surfaces((*load_surfaces(self.config.world), *self.config.surfaces), self.config.contact_stiffness)
        self._tree = tree
        self._wrenches = Wrenches(self.time_step)
        self.robot = Robot(tree, self.joint_names, self.config)
        masks = load_masks(self.config.collision_masks)
        itself = Model(tree.name, urdf_xml, tree, np.eye(4), fixed=True)
        self.world = World(itself, self.robot, objects, rules, masks, self.config)
        self._pushed = False
        self._put([0.0] * len(self.joint_names), None)

    # -- state ---------------------------------------------------------------------------------------------------------

    def _put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        self.robot.put(q, [0.0] * len(q) if dq is None else dq)
        self._values = self.robot.joints.zeros
        self.world.penalty.forget()

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Reset robot and world by a new compilation, so that no contact memory or warm start reaches the next run."""
        self._wrenches.clear()
        self.world.reset()
        self._put(q, dq)

    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest; the world does not change."""
        self._put(q, None)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Read position, velocity and effort at the measuring instant.

        Semi-implicit, the position belongs to the end of the step and the velocity to its middle; q - dt dq/2
        synchronises both.
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
        """Return MuJoCo's own mass matrix at the present engine position, shape (n, n) [kg m^2]."""
        return self.robot.mass_matrix()

    # -- the step ------------------------------------------------------------------------------------------------------

    def apply(self, tau: Sequence[float]) -> None:
        """Set the commands for the next step: efforts [N m], or values by `set_modes`."""
        self._values = self.robot.joints.command(tau)

    def step(self) -> None:
        """Advance by `time_step`."""
        pushing = self.world.acts or bool(self._wrenches.active)
        if self._pushed:
            self.world.scene.d.xfrc_applied[:] = 0.0
        self.robot.step(self._values, self._push if pushing else None)
        self._pushed = pushing

    def _push(self) -> None:
        """Apply wrenches and the forces of the world in the coming step."""
        scene = self.world.scene
        for wrench in self._wrenches.active:
            T = scene.link_pose(wrench.body)
            point = T[:3, :3] @ wrench.point + T[:3, 3]
            act(scene, scene.bodies[scene.built.frames[wrench.body].body], wrench.force, wrench.torque, point)
        self._wrenches.count_step()
        self.world.act()

    # -- load ----------------------------------------------------------------------------------------------------------

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a payload to `link` (default: behind the last joint), replacing the previous; the scene is recompiled."""
        link = link or self._tree.joints[self.joint_names[-1]].child
        self._tree.check_link(link)
        self.world.set_load(None if load is None else (link, payload(load)))

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
        elif "::" not in body and self.world.has(body):
            self._wrenches.clear_model(body)
        else:
            self._wrenches.clear_link(self.world.full_name(body))

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.world.penalty.last + rigid_contacts(self.world.scene, self.time_step)

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest spring contact force of each pair since the last call [N]."""
        return self.world.penalty.springs.take_peaks()

    def joint_reactions(self) -> list[JointReaction]:
        """Return the loads of the robot's moving joints in the last step; empty before the first step."""
        return self.robot.reactions()

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model; the scene is compiled again, and all others continue where they are."""
        self.world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a model, and the wrenches on it."""
        self.world.delete(name)
        self._wrenches.clear_model(name)

    def model_names(self) -> list[str]:
        """Return the names of all models but the robot."""
        return self.world.names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, (4, 4), twist at the link's origin, world frame, linear then angular, (6,))."""
        link, scene = self.world.full_name(body), self.world.scene
        scene.update()
        T = scene.link_pose(link)
        return T, scene.twist(scene.bodies[scene.built.frames[link].body], T[:3, 3])
