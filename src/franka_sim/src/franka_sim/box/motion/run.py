"""One motion from start to end: conversion of the client's commands to joint torques, and count of lost packets."""

from collections.abc import Sequence
from math import acos, dist, isfinite
from typing import TYPE_CHECKING

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.config import BoxConfig, motion_parameters
from franka_sim.box.internal_impedance import ImpedanceLaw
from franka_sim.box.motion import MotionGenerator, make_generator
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest
from franka_sim.box.state import BoxState
from hric_core.errors import CommandError
from hric_core.native.vectors import near, smaller

if TYPE_CHECKING:
    from franka_sim.box.motion.point_to_point import PointToPointGenerator


def invalid(request: MoveRequest) -> str:
    """Return the error in a request to start a motion, as a text; empty if there is none."""
    if request.controller is ControllerMode.OTHER:
        return "a motion needs a controller"
    if request.generator is GeneratorMode.IDLE:
        return "generator mode IDLE starts no motion; torque control without a generator needs mode NONE"
    if request.generator is GeneratorMode.NONE and request.controller is not ControllerMode.EXTERNAL:
        return "an internal controller needs a motion generator"
    if not all(isfinite(x) and x >= 0.0 for x in (*request.max_path_deviation, *request.max_goal_deviation)):
        return "the maximum deviations from path and goal must be finite and not negative"
    if request.maximum_velocity is None:
        return ""
    if request.generator is not GeneratorMode.JOINT_POSITION or request.controller is ControllerMode.EXTERNAL:
        return "an asynchronous motion must have joint positions as commands, and an internal controller"
    fast = request.maximum_velocity
    return "" if all(isfinite(v) and v > 0.0 for v in fast) else f"maximum velocities {fast} rad/s; valid: above 0"


class MotionRun:
    """Conversion of a client's commands to joint torques while a motion runs.

    Args:
        state: state of the arm; the generators write its desired values.
        model: the box's model of the arm.
        config: parameters of the box.
    """

    def __init__(self, state: BoxState, model: KdlFrankaModel, config: BoxConfig) -> None:
        self._state, self._model, self._config = state, model, config
        self._checks = TorqueChecks(config)
        self._generators: dict[GeneratorMode, MotionGenerator] = {}
        self._revision = -1
        self._generator: MotionGenerator | None = None
        self._planned: PointToPointGenerator | None = None
        self._law: ImpedanceLaw | None = None
        self._start_errors: Errors = NO_ERRORS
        self._gain, self._still = 1.0, False
        self._limits: DeviationLimits | None = None

    def start(self, request: MoveRequest, law: ImpedanceLaw | None, filter_gain: float) -> bool:
        """Start at rest at the state's q_d; return False if the pose is singular for this motion.

        Args:
            request: generator and deviations.
            law: impedance law that follows the desired motion; None: the client commands torques.
            filter_gain: weight of the newest torque command in the low-pass filter, 0 to 1.
        """
        state = self._state
        self._law, self._gain = law, filter_gain
        self._generator, self._start_errors = self._make(request.generator), NO_ERRORS
        self._planned = None if request.maximum_velocity is None else self._plan(request.maximum_velocity)
        self._generator = self._planned or self._generator
        limits = DeviationLimits(request)
        self._limits = limits if limits.path or limits.goal else None
        # For torque control alone, libfranka 0.9 requests a joint velocity generator and commands zero velocity.
        self._still = law is None and request.generator in (GeneratorMode.NONE, GeneratorMode.JOINT_VELOCITY)
        if self._generator is not None:
            if self._generator.is_singular(state):
                return False
            self._start_errors = self._generator.start(state)
        return True

    def _make(self, kind: GeneratorMode) -> MotionGenerator | None:
        if kind is GeneratorMode.NONE:
            return None
        model, config = self._model, self._config
        if self._revision != model.revision:
            self._generators.clear()
            self._revision = model.revision
        if kind not in self._generators:
            self._generators[kind] = make_generator(kind, model, config.limits, config.time_step)
        return self._generators[kind]

    def _plan(self, maximum_velocity: Sequence[float]) -> "PointToPointGenerator":
        from franka_sim.box.motion.point_to_point import PointToPointGenerator  # loads a library that few motions need

        config, names = self._config, self._model.joint_names
        return PointToPointGenerator(config.limits, maximum_velocity, names, motion_parameters(), config.time_step)

    @property
    def asynchronous(self) -> bool:
        """True if the control box plans the motion itself; then no packet counts as lost."""
        return self._planned is not None

    def finished(self, command: MotionCommand | None) -> bool:
        """Return True if the motion ends in this cycle: with the last command, or when the arm has braked after it."""
        if self._planned is not None:
            return self._planned.at_rest
        return command is not None and command.finished

    @property
    def reason(self) -> str:
        """Explanation of why the motion generator refused a command; empty if the errors' names are enough."""
        return "" if self._generator is None else self._generator.reason

    def torque(self, command: MotionCommand | None) -> tuple[list[float], Errors]:
        """Compute one cycle; return (torques without gravity, 7 floats [N m]; errors by libfranka's names)."""
        wrong = self._generate(command)
        if not wrong and self._limits is not None and self._config.reflexes:
            wrong = self._limits.errors(self._state, self.finished(command))
        if wrong:
            return [], wrong
        if self._law is not None:
            return self._law.torque(self._state), NO_ERRORS
        before = self._state.tau_J_d
        if command is None:
            return before[:], NO_ERRORS
        desired = command.tau
        wrong = self._checks.errors(desired, before)
        if wrong:
            if self._config.reflexes or not all(map(isfinite, desired)):
                return [], wrong
            desired = self._checks.limited(desired, before)
        if self._gain < 1.0:
            gain = self._gain
            desired = [b + gain * (a - b) for a, b in zip(desired, before, strict=True)]
        return desired[:], NO_ERRORS

    def _generate(self, command: MotionCommand | None) -> Errors:
        """Advance the desired motion by one cycle."""
        state, generator = self._state, self._generator
        if self._still and (generator is None or self._stays(generator, command)):
            state.q_d[:] = state.q
            if state.computed_at:
                state.desired_changed()
            return self._start_errors
        if generator is None:
            return NO_ERRORS
        wrong = self._start_errors or generator.advance(command)
        state.desired_changed()
        if wrong and not self._config.reflexes:
            self._start_errors = NO_ERRORS
            generator.start(state)
            return NO_ERRORS
        return wrong

    def _stays(self, generator: MotionGenerator, command: MotionCommand | None) -> bool:
        """Return True while a generator under torque control gets zero commands; the first other one activates it."""
        self._still = command is None or not any(command.dq)
        if not self._still:
            self._start_errors = self._start_errors or generator.start(self._state)
        return self._still


PATH: Errors = frozenset(("max_path_pose_deviation_violation",))
GOAL: Errors = frozenset(("max_goal_pose_deviation_violation",))
_USUAL = MoveRequest(ControllerMode.EXTERNAL, GeneratorMode.NONE)


def deviation(state: BoxState) -> tuple[float, float, float]:
    """Return the deviation of the measured end effector: translation [m], rotation [rad], elbow (joint 3) [rad]."""
    a, b = state.O_T_EE, state.O_T_EE_d
    # Trace of R_a' R_b: the sum of the products of equal elements.
    trace = sum(a[i] * b[i] for i in (0, 1, 2, 4, 5, 6, 8, 9, 10))
    return (
        dist(a[12:15], b[12:15]),
        acos(min(max(0.5 * (trace - 1.0), -1.0), 1.0)),
        abs(state.elbow[0] - state.elbow_d[0]),
    )


class DeviationLimits:
    """Limits of the end effector's deviation from its path and goal; libfranka's defaults mean that there is no limit.

    Attributes:
        path, goal: translation [m], rotation [rad], elbow [rad]; None: no limit.
    """

    def __init__(self, request: MoveRequest) -> None:
        path, goal = request.max_path_deviation, request.max_goal_deviation
        self.path = path if any(a < b for a, b in zip(path, _USUAL.max_path_deviation, strict=True)) else None
        self.goal = goal if any(a < b for a, b in zip(goal, _USUAL.max_goal_deviation, strict=True)) else None

    def errors(self, state: BoxState, finished: bool) -> Errors:
        """Return the violated limits; finished: True for the last cycle of a motion, in which goal limits apply too."""
        limits = [(self.path, PATH)] + ([(self.goal, GOAL)] if finished else [])
        for limit, names in limits:
            if limit is not None and any(x > maximum for x, maximum in zip(deviation(state), limit, strict=True)):
                return names
        return NO_ERRORS


DISCONTINUITY: Errors = frozenset(("controller_torque_discontinuity",))
OUT_OF_RANGE: Errors = frozenset(("tau_j_range_violation",))


class TorqueChecks:
    """Check of torque and torque-rate limits of a command, with libfranka's values.

    A value that is not finite, or changes faster than the torque-rate limit, is a controller_torque_discontinuity; a
    value above the torque limit is a tau_j_range_violation. (libfranka names the errors; the name for NaN is a project
    default, unconfirmed.)
    """

    def __init__(self, config: BoxConfig) -> None:
        limits = config.limits
        per_cycle = (1.0 + config.torque_rate_tolerance) * config.time_step
        self._jump = tuple(rate * per_cycle for rate in limits.effort_rate)
        self._range = tuple(effort * (1.0 + 1e-9) for effort in limits.effort)

    def errors(self, tau: Sequence[float], before: Sequence[float]) -> Errors:
        """Return the errors of a command; tau: 7 floats [N m], before: last accepted command.

        Raises:
            CommandError: not seven numbers; an error of the caller, not of the client.
        """
        if len(tau) != 7:
            raise CommandError(f"a torque command is 7 numbers [N m]; got {len(tau)}")
        if not near(tau, before, self._jump):  # comparisons with NaN are False
            return DISCONTINUITY
        return NO_ERRORS if smaller(tau, self._range) else OUT_OF_RANGE

    def limited(self, tau: Sequence[float], before: Sequence[float]) -> list[float]:
        """Return the nearest torques within the limits, 7 floats [N m]: for a box without reflexes."""
        rows = zip(tau, before, self._jump, self._range, strict=True)
        return [min(max(a, b - j, -limit), b + j, limit) for a, b, j, limit in rows]


class PacketCount:
    """Counter of consecutive lost packets and of the success rate, from the first command of a motion.

    Args:
        window: number of cycles of the success rate.

    Attributes:
        started: True after the motion's first command.
        lost_in_a_row: packets lost since the last command.
        complete: True if each of the last `window` cycles had a command; another one then changes nothing.
        success_rate: fraction of the last `window` cycles (of all so far, if fewer) that had a command, 0 to 1; 0
            before the first command.
    """

    def __init__(self, window: int) -> None:
        self._window, self._mask = window, (1 << window) - 1
        self.reset()

    def reset(self) -> None:
        """Reset the counts at the start or end of a motion."""
        self.started, self.lost_in_a_row, self.success_rate = False, 0, 0.0
        self._history, self._cycles, self.complete = 0, 0, False

    def accept(self) -> None:
        """Count a command that came in time."""
        self.started, self.lost_in_a_row = True, 0
        self._count(1)

    def lose(self) -> None:
        """Count a cycle without a command."""
        if self.started:
            self.lost_in_a_row += 1
            self._count(0)

    def _count(self, bit: int) -> None:
        self._history = (self._history << 1 | bit) & self._mask
        self._cycles = min(self._cycles + 1, self._window)
        good = self._history.bit_count()
        self.success_rate = good / self._cycles
        self.complete = good == self._window
