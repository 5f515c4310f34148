"""Robot in OpenSim: its joints, their efforts, and one step of the simulation."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hric_control.plant import FloatArray, Mode
from hric_control.plants import EngineRobot, Losses, MovingJoints, WindowlessConfig
from hric_core.parameters import flag, number
from hric_core.urdf import ONE_COORDINATE
from opensim_ros_control.dynamics import EquationsOfMotion
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.integrators import IntegrationError, IntegrationStep, ManagerSteps, OwnSteps, Touch
from opensim_ros_control.joint_efforts import EffortRow, JointEfforts
from opensim_ros_control.robot_model import RobotModel
from opensim_ros_control.stages import cut, gripped


@dataclass(frozen=True)
class OpenSimConfig(WindowlessConfig):
    """Parameters of the OpenSim plant: those of all plants, and those that only OpenSim needs."""

    accuracy: float = number(
        1e-3,
        above=0.0,
        maximum=0.1,
        text="accuracy of OpenSim's error control, as OpenSim defines it; the other integrators ignore it",
    )
    effort_limits: bool = flag(True, text="cut efforts to the description's limits")


class OpenSimRobot(EngineRobot):
    """Robot in an OpenSim model, which may contain other models too.

    Vectors of the robot's joints are in the order of the description; vectors of all coordinates, shape (nu,), are in
    OpenSim's order.

    Args:
        model: builder of the OpenSim model.
        joint_names: names of the actuated joints.
        config: parameters of the plant.

    Attributes:
        model: builder of the OpenSim model.
        config: parameters of the plant.
        engine: engine with the present OpenSim model.
        time: simulation time [s].
        y: state at the end of the last step: positions, speeds, and other integrated states.
        positions, speeds: positions and speeds of all coordinates in y, as floats [rad or m, rad/s or m/s].
        external: joint efforts of external forces in the coming steps, shape (nu,) [N m or N]; None: no forces.
        touch: rigid contact in the coming step; None: no contact.
    """

    def __init__(self, model: RobotModel, joint_names: Sequence[str], config: OpenSimConfig) -> None:
        moving = [joint for joint in model.robot.joints.values() if joint.type != "fixed"]
        super().__init__(MovingJoints(moving, joint_names, model.robot.name), config)
        self.model, self.config = model, config
        bound = [joint.effort if config.effort_limits else math.inf for joint in moving]
        self._bounds = ([-effort for effort in bound], bound)
        self._half = (
            0.5 * config.time_step if config.half_step_readout and config.integrator == "semi_implicit" else 0.0
        )
        self._rotors = [loss.rotor for loss in self.losses] if any(config.rotor_inertia) else None
        self.external: FloatArray | None = None
        self.touch: Touch | None = None
        self._bind(OpenSimEngine(model.build()))
        self.time = 0.0
        self._set_y(self.engine.y_of(self.engine.system_state))

    # -- the model -----------------------------------------------------------------------------------------------------

    def _bind(self, engine: OpenSimEngine) -> None:
        """Use a new build of the OpenSim model."""
        config = self.config
        self.engine = engine
        self._indices = [engine.index[engine.built.joints[name][0]] for name in self.joints.names]
        self._straight = self._indices == list(range(engine.nu))
        inertia = np.zeros(engine.nu)
        inertia[self._indices] = [loss.rotor for loss in self.losses]
        friction = self._friction()
        self._gripping = self._bristles = self._bristle_rows()
        self._bend, self._bent = np.zeros(engine.nu), 0.0
        self._dynamics = EquationsOfMotion(engine, inertia, friction)
        sticking = self._sticking() if config.friction == "coulomb" else {}
        self._rows = JointEfforts(sticking, self.stops, self._indices, config.time_step)
        self._steps = OwnSteps(self._dynamics, self._rows, config.time_step)
        self._manager = ManagerSteps(engine, config.time_step, config.accuracy)
        self._plain = config.integrator == "accurate" and friction is None and not inertia.any() and not sticking
        self._own_step = self._steps.semi_implicit if config.integrator == "semi_implicit" else self._steps.third_order

    def _sticking(self) -> dict[int, float]:
        """Return the Coulomb friction by coordinate, of the robot and of the models around it, if any [N m or N]."""
        of_robot = zip(self._indices, self.joints.joints, strict=True)
        of_models = (
            (self.engine.index[self.engine.built.joints[f"{model.name}::{joint.name}"][0]], joint)
            for model in self.model.neighbours
            for joint in model.tree.joints.values()
            if joint.type in ONE_COORDINATE
        )
        return {index: joint.friction for index, joint in (*of_robot, *of_models) if joint.friction > 0.0}

    def _friction(self) -> FloatArray | None:
        """Return the parameters of the identified friction, a row per coordinate; None without such friction."""
        if self.config.friction != "identified":
            return None
        rows = np.zeros((self.engine.nu, len(Losses().sigmoid_row())))
        rows[self._indices] = [loss.sigmoid_row() for loss in self.losses]
        return rows

    def _bristle_rows(self) -> FloatArray | None:
        """Return the parameters of friction at rest (bristle model), a row per coordinate; None without breakaway."""
        if not any(loss.breakaway for loss in self.losses):
            return None
        rows = np.array([Losses().bristle_row()] * self.engine.nu)
        rows[self._indices] = [loss.bristle_row() for loss in self.losses]
        return rows

    def build_again(self, prepare: Callable[[OpenSimEngine], None] | None = None) -> None:
        """Build the OpenSim model again and continue in the present state.

        prepare: function that may set the states of new components in the new engine.
        """
        self._write_state()
        engine = OpenSimEngine(self.model.build())
        engine.continue_from(self.engine)
        if prepare is not None:
            prepare(engine)
        self.external = self.touch = None
        self._bind(engine)
        self._set_y(engine.y_of(engine.system_state))
        self._send_modes()

    def _write_state(self) -> None:
        self.engine.put_y(self.y)
        self.engine.system_state.setTime(self.time)

    def _set_y(self, y: FloatArray) -> None:
        n, half = self.engine.nu, self._half
        self.y, values = y, y.tolist()
        self.positions, self.speeds = values[:n], values[n : 2 * n]
        self.q, self.dq = self._of_joints(self.positions), self._of_joints(self.speeds)
        self.at = [x - half * v for x, v in zip(self.q, self.dq, strict=True)] if half else self.q

    def synchronised(self) -> OpenSimEngine:
        """Return the engine, set to the present state with velocities realized, for reading poses and twists."""
        self._write_state()
        self.engine.model.realizeVelocity(self.engine.system_state)
        return self.engine

    # -- setting the state ---------------------------------------------------------------------------------------------

    def put(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Set positions and velocities of the actuated joints; other joints keep their positions, at rest."""
        self.put_coordinates(self._indices, *self.joints.start(q, dq, self.q))
        self.effort = self.motor_effort = self.joints.zeros
        self.stops.restart(self.q)
        self._bend[:], self._bent = 0.0, 0.0
        self._send_modes()

    def mass_matrix(self) -> FloatArray:
        """Return the engine's mass matrix of all moving joints without rotors, shape (m, m) [kg m^2]."""
        M = self.synchronised().mass_matrix().reshape(self.engine.nu, -1)  # OpenSim's view of 1 x 1 has one dimension
        return np.asarray(M[np.ix_(self._indices, self._indices)])

    def put_coordinates(self, indices: Sequence[int], q: Sequence[float], dq: Sequence[float]) -> None:
        """Set positions q and velocities dq of some coordinates, by index."""
        y, n = self.y.copy(), self.engine.nu
        self.write(indices, q, dq, y[:n], y[n : 2 * n])
        self._set_y(y)
        self._rows.forget()

    def write(
        self, indices: Sequence[int], q: Sequence[float], dq: Sequence[float], all_q: FloatArray, all_u: FloatArray
    ) -> None:
        """Write positions and velocities of some coordinates into the arrays of all coordinates, without setting them.

        Args:
            indices: indices of the coordinates.
            q: positions at the measuring instant [rad or m].
            dq: velocities [rad/s or m/s].
            all_q: positions of all coordinates, shape (nu,), changed in place.
            all_u: speeds of all coordinates, shape (nu,), changed in place.
        """
        # The read-out subtracts half a step, so the engine starts half a step ahead.
        for index, x, v in zip(indices, q, dq, strict=True):
            all_q[index], all_u[index] = x + self._half * v, v

    def read(self, indices: Sequence[int], q: list[float], dq: list[float]) -> None:
        """Write positions and velocities of some coordinates at the measuring instant into the lists q and dq."""
        dq[:] = [self.speeds[index] for index in indices]
        q[:] = [self.positions[index] - self._half * v for index, v in zip(indices, dq, strict=True)]

    def _of_joints(self, values: list[float]) -> list[float]:
        """Return the values of the robot's joints from those of all coordinates."""
        return values if self._straight else [values[index] for index in self._indices]

    def response(self) -> FloatArray:
        """Return the change of du/dt per effort, shape (nu, nu), in the engine's state; positions must be realized."""
        if self.engine.constraints:
            self.engine.model.realizeVelocity(self.engine.system_state)
        return self._dynamics.response()

    # -- modes and brakes ----------------------------------------------------------------------------------------------

    def _send_modes(self) -> None:
        """Apply the mode of each moving joint; a brake that closes stops its joint at once, however fast it moves."""
        modes = self._all_modes = self._modes()
        self._braked = [mode is Mode.BRAKE for mode in modes]
        self._driven = [mode in (Mode.VELOCITY, Mode.POSITION) for mode in modes]
        braked = [index for index, on in zip(self._indices, self._braked, strict=True) if on]
        self._any_braked, self._any_driven = bool(braked), any(self._driven)
        if self._bristles is not None:  # a braked joint needs no bristle
            self._gripping = self._bristles.copy()
            self._gripping[braked] = Losses().bristle_row()
        self._rows.drives = []
        self._dynamics.brake(braked)
        y = self._dynamics.stopped(self.y)
        if y is not self.y:
            self._set_y(y)

    def _drive_rows(self, values: Sequence[float]) -> list[EffortRow]:
        rows, step = [], self.config.time_step
        joints = zip(self._indices, self.joints.joints, self._all_modes, self.q, values, strict=True)
        for index, joint, mode, q, speed in joints:
            if mode is Mode.POSITION:
                speed = min(max((speed - q) / step, -joint.velocity), joint.velocity)
            if mode in (Mode.VELOCITY, Mode.POSITION):
                rows.append(EffortRow(index, -joint.effort, joint.effort, speed, drive=True))
        return rows

    # -- one step ------------------------------------------------------------------------------------------------------

    def step(self, values: list[float]) -> None:
        """Apply the commands and advance by a step.

        Args:
            values: commands of all moving joints; the mode of each joint decides on the quantity.
        """
        efforts, tau = cut(values, *self._bounds)
        self._divergence.check_efforts(efforts)
        rows = self._rows
        if self._any_braked or self._any_driven:
            efforts = [0.0 if b or d else e for e, b, d in zip(efforts, self._braked, self._driven, strict=True)]
            tau = np.array(efforts)
            rows.drives = self._drive_rows(values)
        rows.active = rows.always or rows.near_stop(self.positions, self.speeds)
        if not self._straight:
            tau = np.zeros(self.engine.nu)
            tau[self._indices] = efforts
        untouched = self.external is None and self.touch is None
        if self._plain and not (rows.active or self._any_braked or self._any_driven) and untouched:
            self._finish(self._by_manager(tau), efforts)
        else:
            tau = tau if self.external is None else tau + self.external
            if self._gripping is not None:
                tau = self._grip(tau, self._gripping)
            self._finish(self._own_step(self.time, self.y, tau, self.touch), efforts)

    def _grip(self, tau: FloatArray, rows: FloatArray) -> FloatArray:
        """Return the efforts tau less friction at rest (bristle model) in the coming step, shape (nu,) [N m or N].

        rows: parameters of the bristles, a row per coordinate.
        """
        n, dynamics, step = self.engine.nu, self._dynamics, self.config.time_step
        tau, dynamics.inertia = gripped(tau, dynamics.rotors, self.y[n : 2 * n], self._bend, rows, self._bent, step)
        self._bent = step
        return tau

    def _by_manager(self, tau: FloatArray) -> IntegrationStep:
        try:
            return self._manager.step(self.time, self.y, tau)
        except IntegrationError as error:
            raise self._divergence.fail(self.dq, str(error)) from error

    def _finish(self, step: IntegrationStep, efforts: list[float]) -> None:
        self.time += self.config.time_step
        before = self.dq
        self._set_y(step.y)
        self._check_state()
        self.effort = self.motor_effort = self._motor_efforts(step, efforts)
        if self._rotors is not None:
            rate = 1.0 / self.config.time_step
            rows = zip(self.motor_effort, self._rotors, before, self.dq, strict=True)
            self.effort = [effort - b * rate * (v - u) for effort, b, u, v in rows]

    def _motor_efforts(self, step: IntegrationStep, efforts: list[float]) -> list[float]:
        """Return the motor efforts of the last step; for braked and driven joints, those of brakes and drives."""
        if self._any_braked and step.acceleration is not None:
            brakes = self._of_joints(self._dynamics.brake_efforts(step.acceleration).tolist())
            efforts = [b if on else e for e, b, on in zip(efforts, brakes, self._braked, strict=True)]
        if self._any_driven:
            efforts = [self._rows.driven.get(index, e) for index, e in zip(self._indices, efforts, strict=True)]
        return efforts
