"""Robot in PyBullet: its joints, their efforts, and one step of the simulation."""

from collections.abc import Mapping, Sequence, Set
from itertools import combinations

import numpy as np
import pybullet

from hric_control.plant import Mode
from hric_control.plants import EngineRobot, Losses, MovingJoints, PlantConfig, never_touching
from hric_core import urdf
from hric_core.geometry import FloatArray, MassProperties
from pybullet_ros_control.engine import LoadedBody, PhysicsClient
from pybullet_ros_control.joint_dynamics import CompiledDynamics, Vector, added, half_step, make_dynamics
from pybullet_ros_control.motors import JointMotors
from pybullet_ros_control.urdf_model import EngineModel, prepare


class PybulletRobot(EngineRobot):
    """Robot in PyBullet; vectors are in the engine's order of the moving joints.

    Args:
        engine: engine to load the robot into.
        tree: robot description.
        joint_names: names of the actuated joints.
        config: parameters of the plant.
        masks: pairs of patterns of link names whose collision is not tested.

    Attributes:
        dynamics: compiled joint dynamics of the present model.
        balanced: True if the joint dynamics correct PyBullet's own step, for which they need the efforts of all applied
            forces.
        T_world_base: pose of the engine's base link, shape (4, 4): the description's root is at the world's origin.
    """

    def __init__(
        self,
        engine: PhysicsClient,
        tree: urdf.Robot,
        joint_names: Sequence[str],
        config: PlantConfig,
        masks: list[tuple[str, str]],
    ) -> None:
        self.engine, self._client = engine, engine.client
        self._tree, self._config = tree, config
        self._exempt = never_touching(tree, masks)
        self._model = self._prepare({})
        self._load_body()
        moving = [tree.joints[name] for name in sorted(self.body.joints, key=self.body.joints.__getitem__)]
        super().__init__(MovingJoints(moving, joint_names, tree.name), config)
        self._joints = [self.body.joints[name] for name in self.joints.names]
        self._held: Vector | None = None
        self.balanced = (
            config.integrator != "semi_implicit"
            or bool(self.joints.followers)
            or any(loss != Losses() for loss in self.losses)
        )
        self._half = half_step(config)
        self.T_world_base = self._model.T_root_base
        self._bind()
        efforts, speeds = [joint.effort for joint in moving], [joint.velocity for joint in moving]
        self._motors = JointMotors(engine, self.body, self._joints, efforts, speeds)
        self._send_modes()

    def _prepare(self, loads: Mapping[str, MassProperties]) -> EngineModel:
        return prepare(self._tree, loads=loads, collision=self._config.collision, visual=self._config.gui)

    def _load_body(self) -> None:
        model = self._model
        self.body: LoadedBody = self.engine.load(
            model.name, model, np.eye(4), fixed_base=True, self_collision=self._config.self_collision
        )
        self.mask()

    def mask(self) -> None:
        """Switch self-collision off for links with a common joint and for pairs in the collision masks."""
        if self._config.self_collision:
            apply_masks(self.engine, self.body, self._exempt)

    def _bind(self) -> None:
        """Create the compiled joint dynamics of the present model."""
        config = self._config
        self.dynamics: CompiledDynamics = make_dynamics(
            self._model,
            self.joints.names,
            self.losses,
            config.gravity,
            config.time_step,
            second_order=config.integrator == "accurate",
            half=self._half,
            quiet=self._divergence.quiet,
        )

    @property
    def free_joints(self) -> list[int]:
        """Indices of the joints without brake or drive."""
        return self._motors.effort

    def mass_matrix(self) -> FloatArray:
        """Return the engine's mass matrix of all moving joints without rotors, shape (m, m) [kg m^2]."""
        try:
            return np.array(pybullet.calculateMassMatrix(self.body.id, self.q, physicsClientId=self.engine.client))
        except SystemError:  # for an impossible inertia, PyBullet has none
            return self._links_matrix()

    def _links_matrix(self) -> FloatArray:
        return np.array(self.dynamics.mass_matrix(self.q)).reshape(len(self.q), -1)

    def check_inertia(self) -> None:
        """Check the inertia of the joints, also without the rotors, as the engine moves the links alone."""
        for rotors in (True, False):
            self._check_positive(self._links_matrix(), rotors)

    # -- setting the state ---------------------------------------------------------------------------------------------

    def put(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Set positions and velocities of the actuated joints; other joints keep their positions, at rest."""
        full_q, full_dq = self.joints.start(q, dq, self.q)
        # The read-out subtracts half a step, so the engine starts half a step ahead.
        self._set_state([x + self._half * v for x, v in zip(full_q, full_dq, strict=True)], full_dq)
        self.effort = self.motor_effort = self.joints.zeros
        self._motors.lock_at(self.q)
        self._send_stops(self.stops.restart(self.q))
        self.dynamics.forget()
        self._held = None

    def hold(self, efforts: Vector) -> None:
        """Add joint efforts [N m or N] for the coming step that are equivalent to forces on links, e.g. of bushings."""
        self._held = added(self._held, efforts)

    def _set_state(self, q: Vector, dq: Vector) -> None:
        for joint, x, v in zip(self._joints, q, dq, strict=True):
            pybullet.resetJointState(self.body.id, joint, x, v, physicsClientId=self.engine.client)
        states = self.engine.joint_states(self.body, self.joints, self._joints)
        self.q, self.dq, self.at, _, _ = self.dynamics.read(states, self.joints.zeros)

    def load_again(self) -> None:
        """Load the robot into an emptied engine, with the same joint states, modes, brakes and stops."""
        self._load_body()
        self._set_state(self.q, self.dq)
        self._motors.restore(self.body)
        self._send_stops(self.stops.waiting)
        self._bind()

    def set_loads(self, loads: Mapping[str, MassProperties]) -> None:
        """Set the payloads by link, in the link's frame; they take effect at the next `load_again`."""
        self._model = self._prepare(loads)

    # -- modes and brakes ----------------------------------------------------------------------------------------------

    def _send_modes(self) -> None:
        modes = self._modes()
        if modes != self._motors.modes:
            self._motors.set_modes(modes, self.q)

    def _send_stop(self, i: int, low: float, high: float) -> None:
        pybullet.changeDynamics(
            self.body.id,
            self._joints[i],
            jointLowerLimit=low,
            jointUpperLimit=high,
            physicsClientId=self.engine.client,
        )

    # -- one step ------------------------------------------------------------------------------------------------------

    def step(self, values: list[float], external: Vector | None) -> None:
        """Apply the commands, advance the engine, and read the new state.

        Engine functions get positional arguments here to save time, since this runs every millisecond.

        Args:
            values: commands of all moving joints; the mode of each joint decides on the quantity.
            external: joint efforts of the forces that the plant applies in this step [N m]; None: no forces.
        """
        client, body, joints, motors = self._client, self.body.id, self._joints, self._motors
        held = self._held
        if held is not None:
            self._held, external = None, added(external, held)
        if not motors.all_effort:
            self._drive(values, external, held)
        else:
            tau: Vector = values
            if self.balanced:
                tau = self.dynamics.torque(self.q, self.dq, values, external, None)
            if held is not None:
                tau = added(held, tau)
            pybullet.setJointMotorControlArray(
                body, joints, pybullet.TORQUE_CONTROL, forces=tau, physicsClientId=client
            )
        pybullet.stepSimulation(client)
        states = self.engine.joint_states(self.body, self.joints, joints)
        self.q, self.dq, self.at, self.effort, quiet = self.dynamics.read(states, values)
        self.motor_effort = values
        self._check_state(quiet=quiet)
        if not motors.all_effort:
            self._add_drives([state[3] for state in states])

    def _add_drives(self, engine_efforts: list[float]) -> None:
        """Set the efforts of braked and driven joints to those of the engine's motors, which act on the links."""
        taken = self.dynamics.rotor_efforts(self.dq)
        for i, mode in enumerate(self._motors.modes):
            if mode is not Mode.EFFORT:
                self.effort[i] = engine_efforts[i]
        self.motor_effort = [
            x if mode is Mode.EFFORT else e + t
            for mode, x, e, t in zip(self._motors.modes, self.motor_effort, engine_efforts, taken, strict=True)
        ]

    def _drive(self, values: list[float], external: Vector | None, held: Vector | None) -> None:
        """Send the commands of a step in which some joints are braked, or driven by velocity or position."""
        motors, dt = self._motors, self.engine.time_step
        targets = motors.target_velocities(self.q, values)
        tau: Vector = [x if mode is Mode.EFFORT else 0.0 for mode, x in zip(motors.modes, values, strict=True)]
        if self.balanced:
            prescribed = [
                None if mode is Mode.EFFORT else (t - v) / dt
                for mode, t, v in zip(motors.modes, targets, self.dq, strict=True)
            ]
            tau = self.dynamics.torque(self.q, self.dq, values, external, prescribed)
        indices, forces = motors.effort_joints, [tau[i] for i in motors.effort]
        if held is not None or self.joints.followers:
            # Also for braked and driven joints, whose motors must resist these efforts.
            indices, forces = self._joints, list(added(held, tau))
        if indices:
            pybullet.setJointMotorControlArray(
                self.body.id, indices, pybullet.TORQUE_CONTROL, forces=forces, physicsClientId=self.engine.client
            )
        motors.drive(targets)


def apply_masks(engine: PhysicsClient, body: LoadedBody, exempt: Set[frozenset[str]]) -> list[tuple[str, str]]:
    """Switch self-collision off for some pairs of links; return these pairs.

    Args:
        engine: engine with the body.
        body: loaded body.
        exempt: pairs of links with a common joint, and pairs that match the masks.
    """
    names = sorted(body.links, key=body.links.__getitem__)
    off = [(a, b) for a, b in combinations(names, 2) if frozenset((a, b)) in exempt]
    for a, b in off:
        pybullet.setCollisionFilterPair(
            body.id, body.id, body.links[a], body.links[b], 0, physicsClientId=engine.client
        )
    return off
