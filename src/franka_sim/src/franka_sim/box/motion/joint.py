"""Generators of joint motion: check commanded joint positions or velocities and derive the desired motion."""

from abc import abstractmethod
from collections.abc import Sequence

from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import NO_ERRORS, Errors, RobotState
from franka_sim.box.config import MotionParameters
from franka_sim.box.motion.generator import UNFINISHED, MotionGenerator
from franka_sim.box.rate_limits import JOINT_ERRORS, JointRates
from franka_sim.box.requests import MotionCommand

REST = [0.0] * 7
START_POSE_INVALID = frozenset({"joint_position_motion_generator_start_pose_invalid"})
NOT_AT_REST = frozenset({JOINT_ERRORS.acceleration})


class JointGenerator(MotionGenerator):
    """Base of the generators for commanded joint positions and velocities: checks rates and bridges lost packets.

    Args:
        limits: limits of the arm.
        joint_names: joint names of the arm.
        parameters: tolerances.
        time_step: control period [s].
    """

    def __init__(
        self, limits: FrankaLimits, joint_names: Sequence[str], parameters: MotionParameters, time_step: float
    ) -> None:
        self._rates, self._dt = JointRates(limits, joint_names, JOINT_ERRORS, parameters, time_step), time_step
        self._state = RobotState()
        self._moving = self._lost = False

    def start(self, state: RobotState) -> Errors:
        """Start at rest at q_d."""
        self._state, self._moving, self._lost, self.reason = state, False, False, ""
        state.dq_d[:] = state.ddq_d[:] = REST
        return NO_ERRORS

    @abstractmethod
    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float]]:
        """Return position and velocity of this step, 7 floats each [rad], [rad/s]."""

    def advance(self, command: MotionCommand | None) -> Errors:
        """Check a command, or bridge a lost packet (None), for one millisecond; return the violated limits."""
        if command is None:
            return self._bridge() if self._moving else NO_ERRORS
        dt, state = self._dt, self._state
        q, dq = self._commanded(command)
        if command.finished and not self._rates.can_stop(dq):
            self.reason = UNFINISHED
            return NOT_AT_REST
        ddq = [(v - last) / dt for v, last in zip(dq, state.dq_d, strict=True)]
        errors = self._take(q, dq, ddq)
        self._moving, self._lost = True, False
        return errors

    def _bridge(self) -> Errors:
        """Bridge a lost packet with constant acceleration."""
        dt, state, self._lost = self._dt, self._state, True
        dq = [v + a * dt for v, a in zip(state.dq_d, state.ddq_d, strict=True)]
        return self._take([x + v * dt for x, v in zip(state.q_d, dq, strict=True)], dq, state.ddq_d)

    def _take(self, q: list[float], dq: list[float], ddq: list[float]) -> Errors:
        state = self._state
        errors = self._rates.violations(q, dq, ddq, state.ddq_d, self._lost)
        if errors:
            self.reason = self._rates.reason
        else:
            state.q_d[:], state.dq_d[:], state.ddq_d[:] = q, dq, ddq
        return errors


class JointPositionGenerator(JointGenerator):
    """Generator for commanded positions; velocity and acceleration are differences, as in libfranka's limiter."""

    def start(self, state: RobotState) -> Errors:
        """Start at rest at q_d, which must be within the position limits."""
        return super().start(state) or (NO_ERRORS if self._rates.in_range(state.q_d) else START_POSE_INVALID)

    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float]]:
        dt = self._dt
        return command.q, [(x - last) / dt for x, last in zip(command.q, self._state.q_d, strict=True)]

    def advance(self, command: MotionCommand | None) -> Errors:
        """Advance as in `MotionGenerator`; refuse a first position that q_d cannot reach in one step as start pose."""
        if command is not None and not self._moving and not self._rates.reachable(command.q, self._state.q_d):
            return START_POSE_INVALID
        return super().advance(command)


class JointVelocityGenerator(JointGenerator):
    """Generator for commanded velocities, which it integrates to q_d."""

    def start(self, state: RobotState) -> Errors:
        """Start at rest at q_d; from outside the position limits, only inward motion is allowed."""
        self._rates.start_anywhere(state.q_d)
        return super().start(state)

    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float]]:
        dt, dq = self._dt, command.dq
        return [x + v * dt for x, v in zip(self._state.q_d, dq, strict=True)], dq

    def advance(self, command: MotionCommand | None) -> Errors:
        """Advance as in `MotionGenerator`; zero velocity at rest moves nothing (torque control with protocol 5)."""
        state = self._state
        if command is not None and command.dq == REST and state.dq_d == REST and state.ddq_d == REST:
            self._moving, self._lost = True, False
            return NO_ERRORS
        return super().advance(command)
