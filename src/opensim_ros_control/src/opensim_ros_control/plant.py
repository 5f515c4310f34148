"""OpenSim plant: one robot, the world around it, and the external forces on both."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hric_control.plant import Contact, FloatArray, JointReaction, Load, ReactingPlant
from hric_control.plants import EnginePlant, Surface, Surfaces, load_masks, load_surfaces, load_world, payload
from opensim_ros_control.robot import OpenSimConfig, Robot
from opensim_ros_control.robot_model import RobotModel
from opensim_ros_control.world import World
from urdf_to_osim import transforms


class OpenSimPlant(EnginePlant, ReactingPlant):
    """Plant on OpenSim; see `hric_control.plant.Plant`.

    The robot's base is rotated in OpenSim's ground so that the world's z points along y, as is usual in OpenSim. All
    public values are in the world frame.

    Attributes:
        config: checked parameters.
        robot: the robot, with OpenSim's model and state.
        world: models around the robot.
        T_ground_world: pose of the world in OpenSim's ground, shape (4, 4).
    """

    robot: Robot
    world: World

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]) -> None:
        self.joint_names = tuple(joint_names)
        self.config = OpenSimConfig.of(config, "plant/", self.joint_names)
        self.time_step, self.integrator = self.config.time_step, self.config.integrator
        self.gravity = self.config.gravity
        self.T_ground_world = transforms.base_pose("y")
        objects = load_world(self.config.world, self.config.contact_stiffness)
        self.robot = Robot(RobotModel(urdf_xml, self.joint_names, self.config.gravity), self.joint_names, self.config)
        rules = Surfaces((*load_surfaces(self.config.world), *self.config.surfaces), self.config.contact_stiffness)
        self.world = World(self.robot, objects, rules, self.T_ground_world, load_masks(self.config.collision_masks))
        half = self.config.half_step_readout and self.config.integrator == "semi_implicit"
        self._half_step = 0.5 * self.time_step if half else 0.0
        self._values = [0.0] * len(self.joint_names)
        self._put([0.0] * len(self.joint_names), None)

    # -- state ---------------------------------------------------------------------------------------------------------

    def _put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        self.robot.put(q, [0.0] * len(q) if dq is None else dq)
        self._values = [0.0] * len(self.joint_names)

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Reset the robot to q, dq, and the world to its start."""
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
        robot, half = self.robot, self._half_step
        dq[:] = robot.pick(robot.u)
        q[:] = robot.pick(robot.q)
        if half:
            q[:] = [x - half * v for x, v in zip(q, dq, strict=True)]
        tau[:] = robot.effort

    def motor_effort(self) -> list[float]:
        """Return the motor efforts of the last step, n floats [N m]."""
        return list(self.robot.motor_effort)

    def engine_state(self) -> tuple[list[float], list[float]]:
        """Return the engine's raw q, dq."""
        return self.robot.pick(self.robot.q), self.robot.pick(self.robot.u)

    def mass_matrix(self) -> FloatArray:
        """Return OpenSim's own mass matrix at the present engine position, shape (n, n) [kg m^2]."""
        J = self.robot.law_jacobian()[:, self.robot.user]
        return np.asarray(J.T @ self.robot.synchronised().mass_matrix() @ J)

    # -- the step ------------------------------------------------------------------------------------------------------

    def apply(self, tau: Sequence[float]) -> None:
        """Set the commands for the next step: efforts [N m], or values by `set_modes`."""
        values: list[float] = tau.tolist() if isinstance(tau, np.ndarray) else list(tau)
        self._check_length(values, "efforts")
        self._values = values

    def step(self) -> None:
        """Advance by `time_step`."""
        self.world.act()
        self.robot.step(self._values)

    # -- load ----------------------------------------------------------------------------------------------------------

    def set_load(self, load: Load | None, link: str | None = None) -> None:
        """Fix a payload to `link` (default: behind the last joint), replacing the previous; the model is rebuilt."""
        model = self.robot.model
        link = link or model.last_link
        model.robot.check_link(link)
        before = model.load
        model.load = None if load is None else (link, payload(load))
        try:
            self.robot.build_again()
        except BaseException:
            model.load = before
            raise

    # -- the world -----------------------------------------------------------------------------------------------------

    def apply_wrench(
        self, body: str, force: Sequence[float], torque: Sequence[float], point: Sequence[float], duration: float
    ) -> None:
        """Apply a wrench to "link" or "model::link" for `duration` [s], in whole steps (negative: until cleared)."""
        self.world.forces.wrenches.add(self.world.full_name(body), force, torque, point, duration)

    def clear_wrenches(self, body: str | None = None) -> None:
        """End the wrenches on one body ("model" for all its links), or all."""
        if body is None:
            self.world.forces.wrenches.clear()
        elif "::" not in body and self.world.has(body):
            self.world.forces.wrenches.clear_model(body)
        else:
            self.world.forces.wrenches.clear_link(self.world.full_name(body))

    def contacts(self) -> list[Contact]:
        """Return the contacts of the last step."""
        return self.world.forces.contacts()

    def joint_reactions(self) -> list[JointReaction]:
        """Return the loads of the robot's moving joints in the last step; empty before the first step."""
        return self.world.reactions()

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Return the largest spring contact force of each pair since the last call [N]."""
        return self.world.forces.springs.take_peaks()

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model; OpenSim's model is built again, and all others continue where they are."""
        self.world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a model, and the wrenches on it."""
        self.world.delete(name)

    def model_names(self) -> list[str]:
        """Return the names of all models but the robot."""
        return self.world.names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """Return (T_world_link, (4, 4), twist at the link's origin, world frame, linear then angular, (6,))."""
        return self.world.state(body)
