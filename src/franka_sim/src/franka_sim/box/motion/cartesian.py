"""Generators of Cartesian motion: check a commanded pose or twist, then solve the inverse kinematics."""

from abc import abstractmethod
from collections.abc import Sequence

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import NO_ERRORS, Errors, RobotState
from franka_hw_interface.transforms import is_pose
from franka_sim.box.config import MotionParameters
from franka_sim.box.inverse_kinematics import ElbowInverseKinematics, elbow_side
from franka_sim.box.kinematics import moved, twist_between
from franka_sim.box.motion.elbow import ElbowMotion
from franka_sim.box.motion.generator import UNFINISHED, MotionGenerator
from franka_sim.box.rate_limits import CARTESIAN_ERRORS, CARTESIAN_JOINT_ERRORS, JointRates, SpaceRates
from franka_sim.box.requests import MotionCommand

START_POSE_INVALID = frozenset({"cartesian_position_motion_generator_start_pose_invalid"})
INVALID_FRAME = frozenset({"cartesian_position_motion_generator_invalid_frame"})
START_OUT_OF_RANGE = frozenset({CARTESIAN_JOINT_ERRORS.position})
NOT_AT_REST = frozenset({CARTESIAN_ERRORS.acceleration})
NO_JOINT_MOTION = frozenset({CARTESIAN_JOINT_ERRORS.acceleration})
"""Error for a pose without a joint motion to it: at the border of the workspace, or near a singular pose."""


class CartesianGenerator(MotionGenerator):
    """Base of the generators for commanded poses and twists: checks their rates and computes the joint motion.

    Args:
        model: model of the arm.
        limits: limits of the arm.
        parameters: tolerances of the checks, and parameters of the inverse kinematics.
        time_step: control period [s].
    """

    def __init__(
        self, model: KdlFrankaModel, limits: FrankaLimits, parameters: MotionParameters, time_step: float
    ) -> None:
        self._ik = ElbowInverseKinematics(model, parameters, time_step)
        self._joints = JointRates(
            limits, model.joint_names, CARTESIAN_JOINT_ERRORS, parameters, time_step, with_jerk=False
        )
        self._translation = SpaceRates("translation", "m", limits.translation, parameters, time_step)
        self._rotation = SpaceRates("rotation", "rad", limits.rotation, parameters, time_step)
        self._elbow = ElbowMotion(SpaceRates("elbow", "rad", limits.elbow, parameters, time_step), time_step)
        self._parameters, self._dt, self._state = parameters, time_step, RobotState()
        self._T: list[float] = self._state.O_T_EE_c
        self._twist, self._acceleration = [0.0] * 6, [0.0] * 6
        self._moving = self._lost = False

    def start(self, state: RobotState) -> Errors:
        """Start at rest at the pose of q_d, which must be within the position limits."""
        self._state, self._moving, self._lost, self.reason = state, False, False, ""
        state.dq_d[:] = state.ddq_d[:] = [0.0] * 7
        self._ik.begin(state.q_d)
        self._T = self._ik.kinematics.pose(state.q_d)
        self._twist, self._acceleration = [0.0] * 6, [0.0] * 6
        self._elbow.start(state.q_d)
        self._publish()
        return NO_ERRORS if self._joints.in_range(state.q_d) else self._refused_start()

    def is_singular(self, state: RobotState) -> bool:
        """Return True if the end effector's Jacobian at q_d is nearly rank deficient."""
        return self._ik.begin(state.q_d) < self._parameters.singular_value

    @abstractmethod
    def _refused_start(self) -> Errors:
        """Return the error for a start outside of the position limits."""

    @abstractmethod
    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float], Errors]:
        """Return the commanded pose (16 floats) and twist (6 floats) of this step, and the errors in their values."""

    def advance(self, command: MotionCommand | None) -> Errors:
        """Check a command, or bridge a lost packet (None), for one millisecond; return the violated limits."""
        if command is None:
            return self._bridge() if self._moving else NO_ERRORS
        T, twist, errors = self._commanded(command)
        errors = errors or self._elbow.refused(command.elbow, self._moving)
        if (
            not errors
            and command.finished
            and not (self._translation.can_stop(twist[:3]) and self._rotation.can_stop(twist[3:]))
        ):
            errors, self.reason = NOT_AT_REST, UNFINISHED
        if errors:
            return errors
        acceleration = [(v - last) / self._dt for v, last in zip(twist, self._twist, strict=True)]
        self._elbow.command(command.elbow)
        errors = self._take(T, twist, acceleration)
        self._moving, self._lost = True, False
        return errors

    def _bridge(self) -> Errors:
        """Bridge a lost packet with constant accelerations of pose and elbow."""
        dt, self._lost = self._dt, True
        twist = [v + a * dt for v, a in zip(self._twist, self._acceleration, strict=True)]
        self._elbow.bridge()
        return self._take(moved(self._T, twist, dt), twist, self._acceleration)

    def _take(self, T: list[float], twist: list[float], acceleration: list[float]) -> Errors:
        errors, elbow = self._violations(twist, acceleration), self._elbow.violations(self._lost)
        if elbow:
            self.reason = "; ".join(filter(None, (self.reason, self._elbow.reason)))
        return errors | elbow or self._take_joints(T, twist, acceleration)

    def _take_joints(self, T: list[float], twist: list[float], acceleration: list[float]) -> Errors:
        state, dt = self._state, self._dt
        guess = [x + v * dt + a * dt * dt for x, v, a in zip(state.q_d, state.dq_d, state.ddq_d, strict=True)]
        q = (
            self._ik.solve(T, self._elbow.desired, guess)
            if self._elbow.commanded
            else self._ik.follow(T, self._elbow.desired, state.q_d, guess, state.dq_d)
        )
        if q is None:
            self.reason = (
                "no joint motion leads to the commanded pose: it is at the border of the workspace, or singular"
            )
            return NO_JOINT_MOTION
        dq = [(x - last) / dt for x, last in zip(q, state.q_d, strict=True)]
        ddq = [(v - last) / dt for v, last in zip(dq, state.dq_d, strict=True)]
        errors = self._joints.violations(q, dq, ddq, ddq, False)
        if errors:
            self.reason = self._joints.reason
        errors |= self._elbow.side_violated(q)
        if errors:
            return errors
        state.q_d[:], state.dq_d[:], state.ddq_d[:] = q, dq, ddq
        self._T, self._twist, self._acceleration = T, twist, acceleration
        self._elbow.took(q, dq, ddq)
        self._publish()
        return NO_ERRORS

    def _violations(self, twist: Sequence[float], acceleration: Sequence[float]) -> Errors:
        last, lost = self._acceleration, self._lost
        motions = (twist[:3], acceleration[:3], last[:3]), (twist[3:], acceleration[3:], last[3:])
        linear, angular = self._translation.violated(*motions[0], lost), self._rotation.violated(*motions[1], lost)
        velocity, sudden, jerk = (a or b for a, b in zip(linear, angular, strict=True))
        if not (velocity or sudden or jerk):
            return NO_ERRORS
        self.reason = "; ".join(
            self._translation.reasons(linear, *motions[0]) + self._rotation.reasons(angular, *motions[1])
        )
        return CARTESIAN_ERRORS.named(False, velocity, sudden, jerk)

    def _publish(self) -> None:
        """Write the Cartesian fields of the state as new lists: a state may compute these fields on demand."""
        state, elbow = self._state, self._elbow
        state.O_T_EE_d, state.O_T_EE_c = self._T[:], self._T[:]
        state.O_dP_EE_d, state.O_dP_EE_c, state.O_ddP_EE_c = self._twist[:], self._twist[:], self._acceleration[:]
        side = elbow_side(state.q_d)
        state.elbow_d, state.elbow_c = [state.q_d[2], side], [elbow.position, side]
        state.delbow_c, state.ddelbow_c = [elbow.velocity, 0.0], [elbow.acceleration, 0.0]


class CartesianPositionGenerator(CartesianGenerator):
    """Generator for commanded poses; the twist is the step from the last pose, as in libfranka's limiter."""

    def _refused_start(self) -> Errors:
        return START_POSE_INVALID

    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float], Errors]:
        T = command.O_T_EE[:]
        if not is_pose(T, self._parameters.orthonormal_tolerance):
            return T, [], INVALID_FRAME
        twist = twist_between(self._T, T, self._dt)
        if not self._moving and not (self._translation.reachable(twist[:3]) and self._rotation.reachable(twist[3:])):
            return T, twist, START_POSE_INVALID
        return T, twist, NO_ERRORS


class CartesianVelocityGenerator(CartesianGenerator):
    """Generator for commanded twists, which it integrates to a pose."""

    def _refused_start(self) -> Errors:
        return START_OUT_OF_RANGE

    def _commanded(self, command: MotionCommand) -> tuple[list[float], list[float], Errors]:
        twist = command.O_dP_EE[:]
        parts = (self._translation, twist[:3]), (self._rotation, twist[3:])
        too_fast = [rates.reasons((True, False, False), v, v, v)[0] for rates, v in parts if not rates.reachable(v)]
        if too_fast:
            self.reason = "; ".join(too_fast)
            return [], twist, frozenset({CARTESIAN_ERRORS.velocity})
        return moved(self._T, twist, self._dt), twist, NO_ERRORS
