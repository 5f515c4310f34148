"""The MuJoCo plant: one robot, the world around it, and the forces that act on both from outside."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hric_control.errors import CommandError
from hric_control.plant import (
    Articulated,
    Bushing,
    BushingLoad,
    Contact,
    DrivenPlant,
    FloatArray,
    JointReaction,
    Load,
    Mode,
    ReactingPlant,
    Surface,
)
from hric_control.plants import Model, Surfaces, Wrenches, load_masks, load_surfaces, load_world, payload
from hric_control.urdf import read
from mujoco_ros_control.contact import act, rigid_contacts
from mujoco_ros_control.robot import MujocoConfig, Robot
from mujoco_ros_control.world import World

MANY = 4
"""With more free objects than this in the world file `integrator: auto` takes the semi-implicit step: 50 contacts of 20
objects cost a quarter of Runge-Kutta's (project default)."""


class MujocoPlant(DrivenPlant, ReactingPlant, Articulated):
    """See `hric_control.plant.Plant`.

    Attributes:
        config: the parameters as checked, with the integrator that was chosen.
    """

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]) -> None:
        self.joint_names = tuple(joint_names)
        self.config = MujocoConfig.of(config, "plant/", self.joint_names)
        self.time_step = self.config.time_step
        tree = read(urdf_xml)
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
        self._robot = Robot(tree, self.joint_names, self.config)
        masks = load_masks(self.config.collision_masks)
        itself = Model(tree.name, urdf_xml, tree, np.eye(4), fixed=True)
        self._world = World(itself, self._robot, objects, rules, masks, self.config)
        self._pushed = False
        self._put([0.0] * len(self.joint_names), None)

    # -- state ---------------------------------------------------------------------------------------------------------

    def _put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        self._robot.put(q, [0.0] * len(q) if dq is None else dq)
        self._values = self._robot.joints.zeros
        self._world.penalty.forget()

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Compiled again, so that nothing of the past (contact memory, warm starts) can reach the next run."""
        self._wrenches.clear()
        self._world.reset()
        self._put(q, dq)

    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest and leave the world as it is."""
        self._put(q, None)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Semi-implicit, the position belongs to the end of the step and the velocity to its middle; q - dt dq/2 brings
        both together."""
        robot = self._robot
        robot.joints.read((robot.at, robot.dq, robot.effort), q, dq, tau)

    def motor_effort(self) -> list[float]:
        """Efforts of the motors in the last step, n floats [N m]."""
        return self._robot.joints.pick(self._robot.motor_effort)

    def engine_state(self) -> tuple[list[float], list[float]]:
        """Raw q, dq of the engine."""
        robot = self._robot
        return robot.joints.pick(robot.q), robot.joints.pick(robot.dq)

    def mass_matrix(self) -> FloatArray:
        """MuJoCo's own mass matrix at the present engine position, shape (n, n) [kg m^2]."""
        return self._robot.mass_matrix()

    # -- the step ------------------------------------------------------------------------------------------------------

    def apply(self, tau: Sequence[float]) -> None:
        """Commands for the next step: efforts [N m], or what `set_modes` made of them."""
        self._values = self._robot.joints.command(tau)

    def step(self) -> None:
        """Advance by `time_step`."""
        pushing = self._world.acts or bool(self._wrenches.active)
        if self._pushed:
            self._world.scene.d.xfrc_applied[:] = 0.0
        self._robot.step(self._values, self._push if pushing else None)
        self._pushed = pushing

    def _push(self) -> None:
        """Wrenches, and what acts in the world, in the coming step."""
        scene = self._world.scene
        for wrench in self._wrenches.active:
            T = scene.link_pose(wrench.body)
            point = T[:3, :3] @ wrench.point + T[:3, 3]
            act(scene, scene.bodies[scene.built.frames[wrench.body].body], wrench.force, wrench.torque, point)
        self._wrenches.count_step()
        self._world.act()

    # -- modes, brakes, load -------------------------------------------------------------------------------------------

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What `apply` means for each joint: an effort, or the target of a stiff velocity or position drive within the
        URDF's limits."""
        self._check_length(modes, "modes")
        self._robot.set_modes(modes)

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free each joint."""
        self._check_length(on, "brakes")
        self._robot.set_brakes(on)

    def _check_length(self, values: Sequence[object], what: str) -> None:
        if len(values) != len(self.joint_names):
            raise CommandError(
                f"{what}: got {len(values)} values for {len(self.joint_names)} joints ({', '.join(self.joint_names)})"
            )

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a payload to `link` (default: the link behind the last joint); it replaces the one before. The scene is
        compiled again where everything is."""
        link = link or self._tree.joints[self.joint_names[-1]].child
        self._tree.check_link(link)
        self._world.set_load(None if load is None else (link, payload(load)))

    # -- the world -----------------------------------------------------------------------------------------------------

    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Act on "link" or "model::link" for the steps that `duration` [s] covers (negative: until cleared)."""
        self._wrenches.add(self._world.full_name(body), force, torque, point, duration)

    def clear_wrenches(self, body: str | None = None) -> None:
        """End the wrenches on one body ("model" for all of its links), or all."""
        if body is None:
            self._wrenches.clear()
        elif "::" not in body and self._world.has(body):
            self._wrenches.clear_model(body)
        else:
            self._wrenches.clear_link(self._world.full_name(body))

    def contacts(self) -> list[Contact]:
        """Contacts of the last step."""
        return self._world.penalty.last + rigid_contacts(self._world.scene, self.time_step)

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Largest force of each pair that met by a spring since the last call [N]."""
        return self._world.penalty.springs.take_peaks()

    def joint_reactions(self) -> list[JointReaction]:
        """Loads of the robot's moving joints in the last step; empty before the first."""
        return self._robot.reactions()

    def base_link(self, model: str) -> str:
        """Name of a model's root link."""
        return self._world.base_link(model)

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model. The scene is compiled again, everything else goes on where it is."""
        self._world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a model, and the wrenches on it."""
        self._world.delete(name)
        self._wrenches.clear_model(name)

    def model_names(self) -> list[str]:
        """Names of all models but the robot."""
        return self._world.names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """(T_world_link shape (4, 4), twist at the link frame's origin in the world frame, linear then angular, shape
        (6,))."""
        link, scene = self._world.full_name(body), self._world.scene
        scene.update()
        T = scene.link_pose(link)
        return T, scene.twist(scene.bodies[scene.built.frames[link].body], T[:3, 3])

    # -- joints of models, and what holds links together ---------------------------------------------------------------

    def model_joints(self, model: str) -> tuple[str, ...]:
        """Names of the moving joints of a model."""
        return tuple(self._world.joints_of(model).joints.names)

    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """State of a model's joints at the measuring instant."""
        self._world.joints_of(model).read(q, dq)

    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put a model's joints at q, dq, now and after each reset."""
        self._world.put_joints(model, q, dq)

    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Efforts in a model's joints from the next step on."""
        self._world.joints_of(model).drive(tau)

    def connect(self, name: str, bushing: Bushing) -> None:
        """Hold two bodies together from the next step on."""
        self._world.connect(name, bushing)

    def disconnect(self, name: str) -> None:
        """Let go."""
        self._world.disconnect(name)

    def connections(self) -> list[str]:
        """Names of what is connected."""
        return list(self._world.bushings.laws)

    def bushing_load(self, name: str) -> BushingLoad:
        """What a bushing did in the last step."""
        return self._world.bushings.load(name)
