"""MuJoCo plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hric_control.plant import Contact, FloatArray, JointReaction, ReactingPlant
from hric_control.plants import EnginePlant, Model
from hric_core.geometry import MassProperties
from mujoco_ros_control.contact import act, rigid_contacts
from mujoco_ros_control.robot import MujocoConfig, MujocoRobot
from mujoco_ros_control.world import MujocoWorld

MANY = 4
"""Number of free objects above which `integrator: auto` selects the semi-implicit integrator (project default).

With 20 objects and 50 contacts that takes a quarter of the time of Runge-Kutta.
"""


class MujocoPlant(EnginePlant, ReactingPlant):
    """Physics plant on MuJoCo: a robot, the world around it, and external forces; implements `hric_control.Plant`.

    Attributes:
        config: checked parameters, with the chosen integrator.
        tree: description of the robot; without collision shapes if they are switched off.
    """

    config_type = MujocoConfig
    config: MujocoConfig
    robot: MujocoRobot
    world: MujocoWorld

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, object]) -> None:
        super().__init__(urdf_xml, joint_names, config)
        if not self.config.collision:
            links = {name: replace(link, collisions=()) for name, link in self.tree.links.items()}
            self.tree = replace(self.tree, links=links)
        if self.integrator == "auto":
            crowded = sum(item.mass > 0.0 for item in self._objects) > MANY
            self.integrator = "semi_implicit" if crowded else "accurate"
            self.config = replace(self.config, integrator=self.integrator)
        self.robot = MujocoRobot(self.tree, self.joint_names, self.config)
        itself = Model(self.tree.name, urdf_xml, self.tree, np.eye(4), fixed=True)
        self.world = MujocoWorld(itself, self.robot, self._objects, self._rules, self._masks, self.config)
        self._pushed = False
        self._begin()

    def step(self) -> None:
        """Advance the simulation by `time_step`."""
        world = self.world
        pushing = world.acts or bool(world.wrenches.active)
        if self._pushed:
            world.scene.d.xfrc_applied[:] = 0.0
        self.robot.step(self._values, self._push if pushing else None)
        self._pushed = pushing

    def _push(self) -> None:
        """Apply wrenches, penalty contact, bushings, and joint efforts of models in the coming step."""
        scene = self.world.scene
        for wrench in self.world.wrenches.active:
            T = scene.link_pose(wrench.body)
            point = T[:3, :3] @ wrench.point + T[:3, 3]
            act(scene, scene.bodies[scene.built.frames[wrench.body].body], wrench.force, wrench.torque, point)
        self.world.wrenches.count_step()
        self.world.act()

    def mjcf(self) -> str:
        """Return the scene as MJCF, written by MuJoCo with six digits, with its present state as keyframe `start`.

        It lacks everything that acts on the compiled scene from outside: control box, motors, penalty contact, laws of
        mimic joints, and persons' muscles. Physically impossible inertia tensors are replaced by those of spheres.
        """
        scene = self.world.scene
        spec = scene.built.spec.copy()
        spec.add_key(name="start", qpos=scene.d.qpos)
        spec.compile()
        return str(spec.to_xml())

    def _set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        self.world.set_loads(loads)

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        scene, penalty = self.world.scene, self.world.penalty.last
        return penalty + rigid_contacts(scene, self.time_step) if scene.d.ncon else penalty

    def joint_reactions(self) -> list[JointReaction]:
        """Return force and torque in each moving joint of the robot in the last step; empty before the first step."""
        return self.robot.reactions()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, shape (4, 4); twist of the link's origin, linear then angular, world axes, (6,))."""
        link, scene = self.world.full_name(body), self.world.scene
        scene.update()
        T = scene.link_pose(link)
        return T, scene.twist(scene.bodies[scene.built.frames[link].body], T[:3, 3])
