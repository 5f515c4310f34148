"""The robot in the engine: its joints, what acts in them, and one step of that."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pybullet

from hric_control.errors import CommandError, HricError, UnknownNameError
from hric_control.plants.config import PlantConfig
from hric_control.plants.friction import JointLosses, sigmoid_parameters
from hric_control.plants.modes import Mode
from hric_control.plants.spatial import MassProperties
from hric_control.plants.urdf_tree import Joint, UrdfTree
from pybullet_ros_control.balance import Matrix, Vector
from pybullet_ros_control.engine import Body, Engine
from pybullet_ros_control.masks import apply_masks
from pybullet_ros_control.motors import JointMotors
from pybullet_ros_control.rotor_inertia import RotorInertia
from pybullet_ros_control.stops import JointStops
from pybullet_ros_control.urdf_model import EngineModel, prepare

_DIVERGED = 1e9
"""A joint velocity beyond any [rad/s]."""


class Robot:
    """One robot with a fixed base.

    All vectors are in the engine's order of the moving joints; `user` holds the places of the actuated joints in it, in the user's order.

    Args:
        tree: the description.
        joint_names: the actuated joints.
        config: the plant's parameters.
        masks: pairs of link patterns whose collision is not tested.

    Attributes:
        q, dq: the engine's state after the last step [rad, rad/s].
        effort: joint efforts applied in the last step [N m].
    """

    def __init__(self, engine: Engine, tree: UrdfTree, joint_names: Sequence[str], config: PlantConfig, masks: list[tuple[str, str]]) -> None:
        self.engine, self.joint_names = engine, tuple(joint_names)
        self._client = engine.client
        self._tree, self._config, self._masks = tree, config, masks
        moving = {joint.name: joint for joint in tree.joints if joint.type != "fixed"}
        for name in self.joint_names:
            if name not in moving:
                raise UnknownNameError("moving joint", name, moving, f"robot {tree.name}")
        self._model = self._prepare(None)
        self._load_body()
        names = sorted(self.body.joints, key=self.body.joints.__getitem__)
        self._joints = [self.body.joints[name] for name in names]
        self.user = [names.index(name) for name in self.joint_names]
        self.straight = self.user == list(range(len(names)))
        self.zeros = [0.0] * len(names)
        self.q: Vector = self.zeros
        self.dq: Vector = self.zeros
        self.effort = list(self.zeros)
        self._set_up([moving[name] for name in names])

    def _prepare(self, load: tuple[str, MassProperties] | None) -> EngineModel:
        loads = None if load is None else dict([load])
        return prepare(self._tree, loads=loads, collision=self._config.collision, visual=self._config.gui)

    def _load_body(self) -> None:
        model, touching = self._model, self._config.self_collision
        self.body: Body = self.engine.load(model.name, model, np.eye(4), fixed_base=True, self_collision=touching)
        if touching:
            apply_masks(self.engine, self.body, self._masks)

    def _set_up(self, joints: list[Joint]) -> None:
        config = self._config
        inertia = self.spread(config.rotor_inertia, self.zeros)
        sigmoid = [(0.0, 0.0, 0.0)] * len(joints)
        if config.friction == "identified":
            for i, phi in zip(self.user, sigmoid_parameters(config.friction_parameters, self.joint_names), strict=True):
                sigmoid[i] = phi
        losses = JointLosses([joint.damping for joint in joints], sigmoid if config.friction == "identified" else None)
        self._losses = losses if losses.any else None
        coulomb = [joint.friction if config.friction == "coulomb" else 0.0 for joint in joints]
        balanced = any(inertia) or any(coulomb)
        self.rotor = RotorInertia(inertia, coulomb, config.time_step, self.engine.client) if balanced else None
        self._motors = JointMotors(self.engine, self.body, self._joints, [joint.effort for joint in joints], [joint.velocity for joint in joints])
        self._bind()
        self._stops = JointStops(self.engine, self.body, self._joints, [(joint.lower, joint.upper) for joint in joints])
        self._half = 0.5 * config.time_step if config.half_step_readout else 0.0
        self._modes = [Mode.EFFORT] * len(self.joint_names)
        self._brakes = [False] * len(self.joint_names)
        self._send_modes()

    def _bind(self) -> None:
        if self.rotor is not None:
            self.rotor.body_id = self.body.id

    def spread(self, values: Sequence[float], rest: Sequence[float]) -> list[float]:
        """Values of the actuated joints among all moving ones; `rest` fills the others."""
        if len(values) != len(self.joint_names):
            raise CommandError(f"got {len(values)} values for {len(self.joint_names)} joints ({', '.join(self.joint_names)})")
        full = list(rest)
        for i, value in zip(self.user, values, strict=True):
            full[i] = float(value)
        return full

    def mass_matrix(self, q: Vector) -> Matrix:
        """The engine's joint-space mass matrix [kg m^2]."""
        result: Matrix = pybullet.calculateMassMatrix(self.body.id, q, physicsClientId=self.engine.client)
        return result

    # -- putting the robot somewhere -----------------------------------------------------------------------------------------------------

    def place(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Put the actuated joints at q, dq; the others stay where they are, at rest."""
        full_q, full_dq = self.spread(q, self.q), self.spread(dq, self.zeros)
        if not all(map(math.isfinite, full_q + full_dq)):
            raise CommandError(f"q and dq must be finite; got {list(q)} and {list(dq)}")
        # The read-out goes half a step back, so the engine starts half a step ahead.
        self._set_state([x + self._half * v for x, v in zip(full_q, full_dq, strict=True)], full_dq)
        self.effort = list(self.zeros)
        self._motors.lock_at(self.q)
        self._stops.place(self.q)
        if self.rotor is not None:
            self.rotor.forget()

    def _set_state(self, q: Vector, dq: Vector) -> None:
        for joint, x, v in zip(self._joints, q, dq, strict=True):
            pybullet.resetJointState(self.body.id, joint, x, v, physicsClientId=self.engine.client)
        states = pybullet.getJointStates(self.body.id, self._joints, self._client)
        self.q, self.dq, _, self._motor_effort = zip(*states, strict=True)

    def load_again(self) -> None:
        """After the engine was emptied: the robot anew, in the state of its joints; modes, brakes and stops as they were."""
        self._load_body()
        self._set_state(self.q, self.dq)
        self._motors.restore(self.body)
        self._stops.restore(self.body)
        self._bind()

    def set_load(self, load: tuple[str, MassProperties] | None) -> None:
        """Payload on a link, from the next `load_again` on."""
        self._model = self._prepare(load)

    @property
    def last_link(self) -> str:
        """The link behind the last actuated joint."""
        return next(joint.child for joint in self._tree.joints if joint.name == self.joint_names[-1])

    # -- modes and brakes ----------------------------------------------------------------------------------------------------------------

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """What the commands of the actuated joints mean from now on."""
        self._modes = list(modes)
        self._send_modes()

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free the actuated joints."""
        self._brakes = [bool(b) for b in on]
        self._send_modes()

    def _send_modes(self) -> None:
        full = [Mode.BRAKE if self._config.passive_joints == "locked" else Mode.EFFORT] * len(self.zeros)
        for i, mode, braked in zip(self.user, self._modes, self._brakes, strict=True):
            full[i] = Mode.BRAKE if braked else mode
        if full != self._motors.modes:
            self._motors.set_modes(full, self.q)

    # -- one step ------------------------------------------------------------------------------------------------------------------------

    def step(self, values: list[float], external: list[float] | None) -> None:
        """Act in the joints, advance the engine, read the state that this leads to. Bare positional calls of the engine: this runs every millisecond.

        Args:
            values: commands of all moving joints, in the meaning of their modes.
            external: joint efforts of the forces that the plant applies in this step [N m]; None for none.
        """
        client, body, joints, motors = self._client, self.body.id, self._joints, self._motors
        tau = values if self._losses is None else self._losses.subtract(values, self.dq)
        if motors.all_effort:
            self.effort = values
            if self.rotor is not None:
                tau = self.rotor.torque(self.q, self.dq, tau, external)
            pybullet.setJointMotorControlArray(body, joints, pybullet.TORQUE_CONTROL, forces=tau, physicsClientId=client)
        else:
            self._drive(values, tau, external)
        pybullet.stepSimulation(client)
        self.q, self.dq, _, self._motor_effort = zip(*pybullet.getJointStates(body, joints, client), strict=True)
        # The dynamics couples all joints, so one that is not finite spoils the first.
        if not -_DIVERGED < self.dq[0] < _DIVERGED:
            raise HricError(f"the simulation diverged: joint velocities {self.dq} rad/s")
        if not motors.all_effort:
            for i, mode in enumerate(motors.modes):
                if mode is not Mode.EFFORT:
                    self.effort[i] = self._motor_effort[i]
        if self._stops.waiting:
            self._stops.check(self.q)

    def _drive(self, values: list[float], tau: list[float], external: list[float] | None) -> None:
        """A step in which some joints are braked, or driven by velocity or position."""
        motors, dt = self._motors, self.engine.time_step
        targets = motors.target_velocities(self.q, values)
        if self.rotor is not None:
            wanted = [None if mode is Mode.EFFORT else (t - v) / dt for mode, t, v in zip(motors.modes, targets, self.dq, strict=True)]
            tau = self.rotor.torque(self.q, self.dq, tau, external, wanted)
        if motors.effort:
            pybullet.setJointMotorControlArray(
                self.body.id,
                motors.effort_joints,
                pybullet.TORQUE_CONTROL,
                forces=[tau[i] for i in motors.effort],
                physicsClientId=self.engine.client,
            )
        motors.drive(targets)
        self.effort = list(values)
