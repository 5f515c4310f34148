"""Base class of the plants of all engines, which contain a robot and a world of models."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from hric_control.plant import Articulated, Bushing, BushingLoad, DrivenPlant, FloatArray, Load, Mode, Surface
from hric_control.plants.config import PlantConfig, carried, rotor_inertia
from hric_control.plants.engine_robot import EngineRobot
from hric_control.plants.models import Models, payload
from hric_control.plants.surfaces import Surfaces
from hric_control.plants.worlds import load_masks, load_surfaces, load_world
from hric_core.errors import CommandError
from hric_core.geometry import MassProperties
from hric_core.urdf import read


class EnginePlant(DrivenPlant, Articulated):
    """Plant with a robot and a world in one physics engine.

    The constructor of a subclass creates `robot` and `world`, and then sets all joints to zero with `_put`.

    Attributes:
        config: checked parameters.
        tree: description of the robot.
        robot: the simulated robot.
        world: all models around the robot.
    """

    config_type: ClassVar[type[PlantConfig]] = PlantConfig
    config: PlantConfig
    robot: EngineRobot
    world: Models[Any]

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, object]) -> None:
        self.joint_names = tuple(joint_names)
        self.tree = read(urdf_xml)
        self.tree.check_actuated(self.joint_names)
        config = {**config, "rotor_inertia": rotor_inertia(config, self.joint_names, self.tree)}
        self.config = self.config_type.of(config, "plant/", self.joint_names)
        self.time_step, self.integrator = self.config.time_step, self.config.integrator
        self.gravity = self.config.gravity
        self._masks = load_masks(self.config.collision_masks)
        self._objects = load_world(self.config.world, self.config.contact_stiffness)
        rules = (*load_surfaces(self.config.world), *self.config.surfaces)
        self._rules = Surfaces(rules, self.config.contact_stiffness)

    # -- state ---------------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Set all joints to 0 and attach the payloads of the parameters, at the end of a plant's construction."""
        self._put([0.0] * len(self.joint_names))
        loads = carried(self.config.payload, self.tree, self.joint_names)
        if loads:
            self._set_loads(loads)
        self._loads = loads

    def _put(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        self.robot.put(q, [0.0] * len(q) if dq is None else dq)
        self.robot.check_inertia()
        self._values = self.robot.joints.zeros
        self.world.forget_contacts()

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Set the robot's joint positions q and velocities dq (None: zero), and reset the world to its start."""
        self.world.reset()
        self._put(q, dq)

    def set_configuration(self, q: Sequence[float]) -> None:
        """Set the robot's joint positions [rad or m], with zero velocity; the world is not changed."""
        self._put(q)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """Write joint positions, velocities and efforts at the measuring instant into the lists, in place.

        With the semi-implicit integrator, q is the position at the end of the step and dq the velocity at its middle;
        q - dt dq/2 is the position at the instant of dq.
        """
        robot, joints = self.robot, self.robot.joints
        if joints.straight:
            q[:], dq[:], tau[:] = robot.at, robot.dq, robot.effort
        else:
            q[:], dq[:], tau[:] = map(joints.pick, (robot.at, robot.dq, robot.effort))

    def motor_effort(self) -> list[float]:
        """Return the motor efforts of the last step, n floats [N m]."""
        return self.robot.joints.pick(self.robot.motor_effort)

    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return the joint positions and velocities as the engine has them."""
        robot = self.robot
        return robot.joints.pick(robot.q), robot.joints.pick(robot.dq)

    def mass_matrix(self) -> FloatArray:
        """Return the mass matrix of the actuated joints as the engine computes it now, shape (n, n) [kg m^2]."""
        J = self.robot.joints.law_jacobian()[:, self.robot.joints.user]
        return np.asarray(J.T @ self.robot.mass_matrix() @ J)

    # -- commands ------------------------------------------------------------------------------------------------------

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set each joint's command mode: effort, or setpoint of a stiff velocity or position drive with URDF limits."""
        self._check_length(modes, "modes")
        self.robot.set_modes(modes)

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock (True) or release (False) the brake of each joint."""
        self._check_length(on, "brakes")
        self.robot.set_brakes(on)

    def _check_length(self, values: Sequence[object], what: str) -> None:
        if len(values) != len(self.joint_names):
            raise CommandError(
                f"{what}: got {len(values)} values for {len(self.joint_names)} joints ({', '.join(self.joint_names)})"
            )

    def apply(self, tau: Sequence[float]) -> None:
        """Set the commands for the next step: efforts [N m or N], or velocities or positions as set by `set_modes`."""
        self._values = self.robot.joints.command(tau)

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Replace the payload of a link, by default the child of the last actuated joint; see `Plant`."""
        named = link or self.tree.joints[self.joint_names[-1]].child
        self.tree.check_link(named)
        kept = {} if load is None and link is None else {k: v for k, v in self._loads.items() if k != named}
        loads = kept if load is None else {**kept, named: payload(load)}
        self._set_loads(loads)
        self._loads = loads

    @abstractmethod
    def _set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        """Set the payloads by link, in the link's frame, in place of all present ones. All states are unchanged."""

    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to "link" or "model::link" for `duration` [s], in whole steps (negative: until cleared)."""
        self.world.wrenches.add(self.world.full_name(body), force, torque, point, duration)

    def clear_wrenches(self, body: str | None = None) -> None:
        """Remove the applied wrenches on one body (a model's name: on all its links), or on all bodies."""
        if body is None:
            self.world.wrenches.clear()
        elif "::" not in body and self.world.has(body):
            self.world.wrenches.clear_model(body)
        else:
            self.world.wrenches.clear_link(self.world.full_name(body))

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest penalty contact force of each pair of bodies since the last call [N]."""
        return self.world.springs.take_peaks()

    # -- models --------------------------------------------------------------------------------------------------------

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        self.world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a spawned model, the wrenches on it, and its connections."""
        self.world.delete(name)

    def model_names(self) -> list[str]:
        """Return the names of all models except the robot."""
        return list(self.world.models)

    def base_link(self, model: str) -> str:
        """Return the name of a model's root link."""
        return self.world.base_link(model)

    def model_joints(self, model: str) -> tuple[str, ...]:
        """Return the names of a model's moving joints."""
        return tuple(self.world.joints_of(model).joints.names)

    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """Write a model's joint positions [rad or m] and velocities [rad/s or m/s] into the lists, in place."""
        self.world.joints_of(model).read(q, dq)

    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Set a model's joint positions and velocities (None: zero), now and after each reset."""
        self.world.joints_of(model).put(q, dq)
        self.world.forget_contacts()

    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Set the efforts of a model's joints from the next step on [N m or N]."""
        self.world.joints_of(model).drive(tau)

    def connect(self, name: str, bushing: Bushing) -> None:
        """Connect two bodies by a bushing (spring and damper) from the next step on."""
        self.world.bushings.connect(name, bushing)
        self.world.bind_connected()

    def disconnect(self, name: str) -> None:
        """Remove a connection between two bodies."""
        self.world.bushings.disconnect(name)
        self.world.bind_connected()

    def connections(self) -> list[str]:
        """Return the names of the present connections between bodies."""
        return list(self.world.bushings.laws)

    def bushing_load(self, name: str) -> BushingLoad:
        """Return the load of a connection between two bodies in the last step."""
        return self.world.bushings.load(name)
