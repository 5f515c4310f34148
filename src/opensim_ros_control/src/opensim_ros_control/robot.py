"""Robot in OpenSim: its joints, their efforts, and one step."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hric_control.plant import FloatArray, Mode
from hric_control.plants import (
    Divergence,
    Losses,
    StopMemory,
    WindowlessConfig,
    breakaways,
    law_jacobian,
    refuse_other_joints,
    sigmoid_parameters,
)
from hric_core.errors import CommandError
from hric_core.parameters import flag, number
from hric_core.urdf import ONE_COORDINATE, mimic_laws
from opensim_ros_control.dynamics import Dynamics
from opensim_ros_control.engine import Engine
from opensim_ros_control.integrators import IntegrationError, ManagerSteps, OwnSteps, Step, Touch
from opensim_ros_control.joint_efforts import JointEfforts, Row
from opensim_ros_control.robot_model import RobotModel
from opensim_ros_control.stages import cut, gripped


@dataclass(frozen=True)
class OpenSimConfig(WindowlessConfig):
    """Plant parameters: those of all plants, and OpenSim's own."""

    accuracy: float = number(
        1e-3,
        above=0.0,
        maximum=0.1,
        text="of OpenSim's error control, as OpenSim defines it; without meaning for the other integrators",
    )
    effort_limits: bool = flag(True, text="cut efforts to the description's limits")


class Robot:
    """One robot with a fixed base in an OpenSim model, which may contain other models too.

    Vectors are in the tree's order of the model's coordinates; `user` has the indices of the actuated joints in it, in
    the user's order.

    Args:
        model: builder of the model.
        joint_names: names of the actuated joints.
        config: the plant's parameters.

    Attributes:
        config: the plant's parameters.
        engine: the present model.
        time: simulation time [s].
        y: state at the end of the last step: positions, speeds, and other integrated states.
        q, u: positions and speeds in y as floats [rad or m, rad/s or m/s].
        motor_effort: motor efforts of the actuated joints in the last step, in the user's order [N m].
        effort: efforts behind the rotors, where an arm's torque sensors are [N m].
        external: external efforts on the coordinates in the coming steps, shape (nu,); None for none.
        touch: rigid contact in the coming step; None for none.
    """

    def __init__(self, model: RobotModel, joint_names: Sequence[str], config: OpenSimConfig) -> None:
        self.model, self.joint_names, self.config = model, tuple(joint_names), config
        self._joints = list(model.joints.values())
        self._names = [joint.name for joint in self._joints]
        numbers = [self._names.index(name) for name in self.joint_names]
        self._modes = [Mode.EFFORT] * len(numbers)
        self._on = [False] * len(numbers)
        self._numbers = numbers
        self._velocity = [model.joints[name].velocity for name in self.joint_names]
        limits, slides = (
            [joint.velocity for joint in self._joints],
            [joint.type == "prismatic" for joint in self._joints],
        )
        self._divergence = Divergence(self._names, limits, slides, config.time_step)
        self.stops = StopMemory([(joint.lower, joint.upper) for joint in self._joints])
        bound = [self._joints[i].effort if config.effort_limits else math.inf for i in numbers]
        self._bounds = ([-effort for effort in bound], bound)
        self._half = (
            0.5 * config.time_step if config.half_step_readout and config.integrator == "semi_implicit" else 0.0
        )
        self.effort = self.motor_effort = [0.0] * len(numbers)
        self._rotors = list(config.rotor_inertia) if any(config.rotor_inertia) else None
        self.external: FloatArray | None = None
        self.touch: Touch | None = None
        self._bind(Engine(model.build()))
        self.time = 0.0
        self._set_y(self.engine.y_of(self.engine.system_state))

    # -- the model -----------------------------------------------------------------------------------------------------

    def _bind(self, engine: Engine) -> None:
        """Bind to a new build of the model."""
        config = self.config
        self.engine = engine
        path = engine.built.coordinates
        self._indices = [engine.index[path[name]] for name in self._names]
        self.user = [self._indices[i] for i in self._numbers]
        self.straight = self.user == list(range(engine.nu))
        self._all_straight = self._indices == list(range(engine.nu))
        inertia = np.zeros(engine.nu)
        inertia[self.user] = config.rotor_inertia
        friction = self._friction()
        self._bristles = self._bristle_rows()
        self._gripping = self._bristles
        self._bend, self._bent = np.zeros(engine.nu), 0.0
        self._dynamics = Dynamics(engine, inertia, friction)
        sticking = self._sticking() if config.friction == "coulomb" else {}
        self._rows = JointEfforts(sticking, self.stops, self._indices, config.time_step)
        self._own = OwnSteps(self._dynamics, self._rows, config.time_step)
        self._manager = ManagerSteps(engine, config.time_step, config.accuracy)
        self._plain = config.integrator == "accurate" and friction is None and not inertia.any() and not sticking
        self._own_step = self._own.semi_implicit if config.integrator == "semi_implicit" else self._own.third_order
        self._laws = [
            (engine.index[path[name]], engine.index[path[law.joint]], law.multiplier, law.offset)
            for name, law in mimic_laws(self.model.joints).items()
        ]

    def law_jacobian(self) -> FloatArray:
        """Return the change of all coordinates' speeds per speed of each, mimic joints included, shape (nu, nu)."""
        return law_jacobian(self.engine.nu, self._laws)

    def _sticking(self) -> dict[int, float]:
        """Return the Coulomb friction by coordinate, of the robot and of the models around it, if any [N m or N]."""
        own = zip(self._indices, self._joints, strict=True)
        beside = (
            (self.engine.index[self.engine.built.joints[f"{model.name}::{joint.name}"][0]], joint)
            for model in self.model.beside
            for joint in model.tree.joints.values()
            if joint.type in ONE_COORDINATE
        )
        return {index: joint.friction for index, joint in (*own, *beside) if joint.friction > 0.0}

    def _friction(self) -> FloatArray | None:
        """Return a row of the identified friction per coordinate; None without friction."""
        if self.config.friction != "identified":
            return None
        refuse_other_joints(self.config.friction_parameters, self.joint_names)
        phi = sigmoid_parameters(self.config.friction_parameters, self.joint_names)
        rows = np.zeros((self.engine.nu, len(Losses().sigmoid_row())))
        rows[self.user] = [Losses(sigmoid=of_joint).sigmoid_row() for of_joint in phi]
        return rows

    def _bristle_rows(self) -> FloatArray | None:
        """Return a row of the bristle per coordinate; None without bristles."""
        held = [0.0] * len(self.user)
        if self.config.friction == "identified":
            held = breakaways(self.config.friction_parameters, self.joint_names)
        if not any(held):
            return None
        rows = np.array([Losses().bristle_row()] * self.engine.nu)
        rows[self.user] = [Losses(breakaway=of_joint).bristle_row() for of_joint in held]
        return rows

    def build_again(self, prepare: Callable[[Engine], None] | None = None) -> None:
        """Build the model again and continue in the present state; `prepare` may set the states of new components."""
        self._write_state()
        engine = Engine(self.model.build())
        engine.continue_from(self.engine)
        if prepare is not None:
            prepare(engine)
        self.external = self.touch = None
        self._bind(engine)
        self._set_y(engine.y_of(engine.system_state))
        self._close_brakes()

    def _write_state(self) -> None:
        self.engine.put_y(self.y)
        self.engine.system_state.setTime(self.time)

    def _set_y(self, y: FloatArray) -> None:
        n = self.engine.nu
        self.y, values = y, y.tolist()
        self.q: list[float] = values[:n]
        self.u: list[float] = values[n : 2 * n]

    def synchronised(self) -> Engine:
        """Return the engine with the present state, velocities realized: for poses and twists."""
        self._write_state()
        self.engine.model.realizeVelocity(self.engine.system_state)
        return self.engine

    # -- putting the robot somewhere -----------------------------------------------------------------------------------

    def put(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Put the actuated joints at q, dq; the robot's other joints keep their positions, at rest."""
        for values in (q, dq):
            self._check_length(values)
        if not all(map(math.isfinite, [*q, *dq])):
            raise CommandError(f"q and dq must be finite; got {list(q)} and {list(dq)}")
        y, n = self.y.copy(), self.engine.nu
        y[[n + index for index in self._indices]] = 0.0
        self.write(self.user, q, dq, y[:n], y[n : 2 * n])
        for index, leader, multiplier, offset in self._laws:
            y[index], y[n + index] = multiplier * y[leader] + offset, multiplier * y[n + leader]
        self._set_y(y)
        self.effort = self.motor_effort = [0.0] * len(q)
        self.stops.restart([self.q[index] for index in self._indices])
        self._rows.forget()
        self._bend[:], self._bent = 0.0, 0.0
        self._close_brakes()

    def put_coordinates(self, indices: Sequence[int], q: Sequence[float], dq: Sequence[float]) -> None:
        """Put these coordinates of a model around the robot at q, dq."""
        y, n = self.y.copy(), self.engine.nu
        self.write(indices, q, dq, y[:n], y[n : 2 * n])
        self._set_y(y)
        self._rows.forget()

    def write(
        self, indices: Sequence[int], q: Sequence[float], dq: Sequence[float], all_q: FloatArray, all_u: FloatArray
    ) -> None:
        """Write q, dq of these coordinates at the measuring instant into positions and speeds of all, shape (nu,)."""
        # The read-out subtracts half a step, so the engine starts half a step ahead.
        for index, x, v in zip(indices, q, dq, strict=True):
            all_q[index], all_u[index] = x + self._half * v, v

    def read(self, indices: Sequence[int], q: list[float], dq: list[float]) -> None:
        """Write the values of these coordinates at the measuring instant into the lists in place."""
        dq[:] = [self.u[index] for index in indices]
        q[:] = [self.q[index] - self._half * v for index, v in zip(indices, dq, strict=True)]

    def _check_length(self, values: Sequence[object]) -> None:
        if len(values) != len(self.joint_names):
            raise CommandError(
                f"got {len(values)} values for {len(self.joint_names)} joints ({', '.join(self.joint_names)})"
            )

    def pick(self, values: list[float]) -> list[float]:
        """Return the values of the actuated joints, in the user's order, from those of all coordinates."""
        return values if self.straight else [values[index] for index in self.user]

    def _of_joints(self, values: list[float]) -> list[float]:
        """Return the values of all robot joints, in their own order, from those of all coordinates."""
        return values if self._all_straight else [values[index] for index in self._indices]

    def response(self) -> FloatArray:
        """Return the change of du/dt per effort, shape (nu, nu), in the engine's state; positions must be realized."""
        if self.engine.constraints:
            self.engine.model.realizeVelocity(self.engine.system_state)
        return self._dynamics.response()

    # -- modes and brakes ----------------------------------------------------------------------------------------------

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the meaning of the commands of the actuated joints."""
        self._modes = list(modes)
        self._close_brakes()

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free the actuated joints."""
        self._on = [bool(b) for b in on]
        self._close_brakes()

    def _close_brakes(self) -> None:
        """Apply modes and brakes; a closing brake stops its joint at once, as a brake that is much stronger would."""
        modes = list(zip(self.user, self._modes, self._on, strict=True))
        braked = [index for index, mode, on in modes if on or mode is Mode.BRAKE]
        if self.config.passive_joints == "locked":
            followers = [index for index, *_ in self._laws]
            braked += [index for index in self._indices if index not in (*self.user, *followers)]
        self._braked = [on or mode is Mode.BRAKE for _, mode, on in modes]
        self._driven = [mode in (Mode.VELOCITY, Mode.POSITION) and not on for _, mode, on in modes]
        self._any_braked, self._any_driven = bool(braked), any(self._driven)
        if self._bristles is not None:  # a braked joint needs no bristle
            self._gripping = self._bristles.copy()
            self._gripping[braked] = Losses().bristle_row()
        self._rows.drives = []
        self._dynamics.brake(braked)
        y = self._dynamics.stopped(self.y)
        if y is not self.y:
            self._set_y(y)

    def _drive_rows(self, values: Sequence[float]) -> list[Row]:
        rows = []
        for i, (index, k, mode) in enumerate(zip(self.user, self._numbers, self._modes, strict=True)):
            if self._driven[i]:
                joint = self._joints[k]
                speed = values[i]
                if mode is Mode.POSITION:
                    speed = (values[i] - self.q[index]) / self.config.time_step
                    speed = min(max(speed, -self._velocity[i]), self._velocity[i])
                rows.append(Row(index, -joint.effort, joint.effort, speed, drive=True))
        return rows

    # -- one step ------------------------------------------------------------------------------------------------------

    def step(self, values: Sequence[float]) -> None:
        """Apply the commands and advance.

        Args:
            values: commands of the actuated joints, with the meaning of their modes.
        """
        efforts, tau = cut(values, *self._bounds)
        self._divergence.check_efforts(self.joint_names, efforts)
        rows = self._rows
        if self._any_braked or self._any_driven:
            efforts = [0.0 if b or d else e for e, b, d in zip(efforts, self._braked, self._driven, strict=True)]
            tau = np.array(efforts)
            rows.drives = self._drive_rows(values)
        rows.active = rows.always or rows.near_stop(self.q, self.u)
        if not self.straight:
            tau = np.zeros(self.engine.nu)
            tau[self.user] = efforts
        untouched = self.external is None and self.touch is None
        if self._plain and not (rows.active or self._any_braked or self._any_driven) and untouched:
            self._finish(self._by_manager(tau), efforts)
        else:
            tau = tau if self.external is None else tau + self.external
            if self._gripping is not None:
                tau = self._grip(tau, self._gripping)
            self._finish(self._own_step(self.time, self.y, tau, self.touch), efforts)

    def _grip(self, tau: FloatArray, rows: FloatArray) -> FloatArray:
        """Return the efforts after the bristles' forces in the coming step, shape (nu,) [N m or N]."""
        n, dynamics, step = self.engine.nu, self._dynamics, self.config.time_step
        tau, dynamics.inertia = gripped(tau, dynamics.rotors, self.y[n : 2 * n], self._bend, rows, self._bent, step)
        self._bent = step
        return tau

    def _by_manager(self, tau: FloatArray) -> Step:
        try:
            return self._manager.step(self.time, self.y, tau)
        except IntegrationError as error:
            raise self._divergence.fail(self._of_joints(self.u), str(error)) from error

    def _finish(self, step: Step, efforts: list[float]) -> None:
        self.time += self.config.time_step
        before = self.u
        self._set_y(step.y)
        self._divergence.check(self._of_joints(self.q), self._of_joints(self.u))
        self.effort = self.motor_effort = self._motor_efforts(step, efforts)
        if self._rotors is not None:
            rate = 1.0 / self.config.time_step
            rows = zip(self.motor_effort, self._rotors, self.pick(before), self.pick(self.u), strict=True)
            self.effort = [effort - b * rate * (v - u) for effort, b, u, v in rows]
        if self.stops.waiting:
            self.stops.check([self.q[index] for index in self._indices])

    def _motor_efforts(self, step: Step, efforts: list[float]) -> list[float]:
        """Return the efforts of the step, with those that brakes and drives needed."""
        if self._any_braked and step.acceleration is not None:
            brakes = self.pick(self._dynamics.brake_efforts(step.acceleration).tolist())
            efforts = [b if on else e for e, b, on in zip(efforts, brakes, self._braked, strict=True)]
        if self._any_driven:
            efforts = [self._rows.driven.get(index, e) for index, e in zip(self.user, efforts, strict=True)]
        return efforts
