"""The PyBullet plant: one robot, the world around it, and the forces that act on both from outside."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pybullet

from hric_control.errors import CommandError, FailureError
from hric_control.plant import Articulated, Bushing, BushingLoad, Contact, DrivenPlant, FloatArray, Load, Mode, Surface
from hric_control.plants import PlantConfig, Surfaces, Wrenches, load_masks, load_surfaces, load_world, payload
from hric_control.urdf import read
from pybullet_ros_control.bushings import EngineBushings
from pybullet_ros_control.engine import BodyState, Engine
from pybullet_ros_control.model_joints import ModelJoints
from pybullet_ros_control.robot import Robot
from pybullet_ros_control.world import World


class PyBulletPlant(DrivenPlant, Articulated):
    """See `hric_control.plant.Plant`.

    Attributes:
        config: the parameters as checked.
    """

    def __init__(self, urdf_xml: str, joint_names: Sequence[str], config: Mapping[str, Any]) -> None:
        self.joint_names = tuple(joint_names)
        self.config = PlantConfig.of(config, "plant/", self.joint_names)
        self.time_step, self.integrator = self.config.time_step, self.config.integrator
        self.gravity = self.config.gravity
        tree = read(urdf_xml)
        masks = load_masks(self.config.collision_masks)
        objects = load_world(self.config.world, self.config.contact_stiffness)
        rules = Surfaces((*load_surfaces(self.config.world), *self.config.surfaces), self.config.contact_stiffness)
        self._wrenches = Wrenches(self.time_step)
        self._engine = Engine(self.config.gui, self.time_step, self.config.gravity)
        try:
            self._robot = Robot(self._engine, tree, self.joint_names, self.config, masks)
            self._world = World(self._engine, self.config, objects, rules)
            self._world.build(self._robot.body)
            self._bushings = EngineBushings(self._engine, self._world, self._robot, self.config)
            self._put([0.0] * len(self.joint_names), None)
        except BaseException:
            self._engine.close()
            raise

    def close(self) -> None:
        """Release the engine; safe to call twice."""
        self._engine.close()

    # -- state ---------------------------------------------------------------------------------------------------------

    def _put(self, q: Sequence[float], dq: Sequence[float] | None) -> None:
        self._robot.put(q, [0.0] * len(q) if dq is None else dq)
        self._values = self._robot.joints.zeros
        self._world.penalty.forget()

    def reset(self, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Everything is built again, so that nothing of the past (contact memory, warm starts) can reach the next
        run."""
        self._wrenches.clear()
        self._build_again(None)
        self._bushings.restart()
        self._put(q, dq)

    def _build_again(self, states: dict[str, BodyState] | None) -> None:
        self._engine.settings()
        self._robot.load_again()
        self._world.build(self._robot.body, states)
        self._bushings.bind()

    def set_configuration(self, q: Sequence[float]) -> None:
        """Put the robot at q at rest and leave the world as it is."""
        self._put(q, None)

    def read_state(self, q: list[float], dq: list[float], tau: list[float]) -> None:
        """The engine's position belongs to the end of the step, its velocity to the middle; q - dt dq/2 brings both
        together."""
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
        """The engine's own mass matrix at the present engine position, shape (n, n) [kg m^2]."""
        robot = self._robot
        return np.array(robot.mass_matrix(robot.q))[np.ix_(robot.joints.user, robot.joints.user)]

    # -- the step ------------------------------------------------------------------------------------------------------

    def apply(self, tau: Sequence[float]) -> None:
        """Commands for the next step: efforts [N m], or what `set_modes` made of them."""
        self._values = self._robot.joints.command(tau)

    def step(self) -> None:
        """Advance by `time_step`."""
        world = self._world
        pushing = self._wrenches.active or world.penalty.pairs or world.joints or self._bushings.laws
        try:
            self._robot.step(self._values, self._push() if pushing else None)
            if pushing:
                for joints in world.joints.values():
                    joints.read()
        except pybullet.error as error:
            raise FailureError(
                f"PyBullet stopped ({error})" + ("; was its window closed?" if self.config.gui else "")
            ) from error

    def _push(self) -> list[float] | None:
        """Apply wrenches, penalty contact, bushings, and what acts in the joints of models; returns what the first two
        amount to in the robot's joints."""
        world, robot = self._world, self._robot
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
        self._bushings.act()
        for joints in world.joints.values():
            joints.act(world.forces.efforts(joints.body))
        return world.forces.efforts(robot.body)

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
        """Fix a payload to `link` (default: the link behind the last joint); it replaces the one before.

        Everything is built again where it is: the engine's inverse dynamics does not notice a changed mass, and may
        even take a new body for an old one that stood at the same address.
        """
        if load is None:
            self._robot.set_load(None)
        else:
            self._robot.set_load((link or self._robot.last_link, payload(load)))
        self._build_again(self._world.states())

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
        elif "::" not in body and body in self._world.bodies:
            self._wrenches.clear_model(body)
        else:
            self._wrenches.clear_link(self._world.full_name(body))

    def contacts(self) -> list[Contact]:
        """Contacts of the last step."""
        return self._world.contacts()

    def take_contact_peaks(self) -> dict[tuple[str, str], float]:
        """Largest force of each pair that met by a spring since the last call [N]."""
        return self._world.penalty.springs.take_peaks()

    def base_link(self, model: str) -> str:
        """Name of a model's root link."""
        return self._world.base_link(model)

    def _spawn(
        self, name: str, urdf_xml: str, T_world_model: FloatArray, fixed: bool, surfaces: Mapping[str, Surface]
    ) -> None:
        """Add a model."""
        self._world.spawn(name, urdf_xml, T_world_model, fixed, surfaces)

    def delete(self, name: str) -> None:
        """Remove a model, the wrenches on it, and what holds it."""
        self._world.check_model(name)
        self._bushings.forget_model(name)
        self._bushings.bind()
        self._world.delete(name)
        self._wrenches.clear_model(name)

    def model_names(self) -> list[str]:
        """Names of all models but the robot."""
        return self._world.model_names()

    def link_state(self, body: str) -> tuple[FloatArray, FloatArray]:
        """(T_world_link shape (4, 4), twist at the link frame's origin in the world frame, linear then angular, shape
        (6,))."""
        model, link = self._world.find(body)
        index, T_body_frame = model.frame(link)
        T_world_link = self._engine.pose(model, index) @ T_body_frame
        com, _, linear, angular = self._engine.motion(model, index)
        return T_world_link, np.concatenate([linear + np.cross(angular, T_world_link[:3, 3] - com), angular])

    # -- joints of models, and what holds links together ---------------------------------------------------------------

    def _joints(self, model: str, values: Sequence[float] = ()) -> ModelJoints | None:
        """None where no joint of the model moves; there must be no values for it then."""
        joints = self._world.joints.get(model)
        if joints is None:
            self._world.check_model(model)
            if len(values) > 0:
                raise CommandError(f"got {len(values)} values for model {model}, of which no joint moves")
        return joints

    def model_joints(self, model: str) -> tuple[str, ...]:
        """Names of the moving joints of a model."""
        joints = self._joints(model)
        return () if joints is None else joints.joints.actuated

    def read_joints(self, model: str, q: list[float], dq: list[float]) -> None:
        """State of a model's joints at the measuring instant."""
        joints = self._joints(model)
        q[:], dq[:] = ((), ()) if joints is None else (joints.at, joints.dq)

    def set_joints(self, model: str, q: Sequence[float], dq: Sequence[float] | None = None) -> None:
        """Put a model's joints at q, dq, now and after each reset."""
        joints = self._joints(model, q)
        if joints is not None:
            joints.put(q, dq)
            self._world.penalty.forget()

    def drive_joints(self, model: str, tau: Sequence[float]) -> None:
        """Efforts in a model's joints from the next step on."""
        joints = self._joints(model, tau)
        if joints is not None:
            joints.drive(tau)

    def connect(self, name: str, bushing: Bushing) -> None:
        """Hold two bodies together from the next step on."""
        self._bushings.connect(name, bushing)
        self._bushings.bind()

    def disconnect(self, name: str) -> None:
        """Let go."""
        self._bushings.disconnect(name)
        self._bushings.bind()

    def connections(self) -> list[str]:
        """Names of what is connected."""
        return list(self._bushings.laws)

    def bushing_load(self, name: str) -> BushingLoad:
        """What a bushing did in the last step."""
        return self._bushings.load(name)
