"""Generator of asynchronous joint motion (protocol 10): the box itself plans the motion to sparse joint targets."""

from collections.abc import Sequence

from ruckig import ControlInterface, InputParameter, OutputParameter, Result, Ruckig, Synchronization

from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.robot_state import NO_ERRORS, Errors, RobotState
from franka_sim.box.config import MotionParameters
from franka_sim.box.motion.generator import MotionGenerator
from franka_sim.box.motion.joint import REST, START_POSE_INVALID
from franka_sim.box.rate_limits import JOINT_ERRORS, JointRates
from franka_sim.box.requests import MotionCommand

OUT_OF_RANGE = frozenset({JOINT_ERRORS.position})
NO_PLAN = frozenset({"joint_via_motion_generator_planning_joint_limit_violation"})


class PointToPointGenerator(MotionGenerator):
    """Generator of a motion that comes to rest at the newest joint target, all joints at the same time.

    libfranka (async_position_control.cpp) says that the arm is at rest at each target. The real planner is not public;
    here it is the time-optimal one of the library ruckig, within the client's maximum velocities and the arm's own
    limits of velocity, acceleration and jerk (project default, unconfirmed). A new target replaces the one before at
    once. The last command has no target: the arm brakes, and the motion has ended when it is `at_rest`. A target
    outside the position limits ends the motion (the error's name is a project default, unconfirmed).

    Args:
        limits: limits of the arm.
        maximum_velocity: the client's maximum joint velocities, 7 floats [rad/s].
        joint_names: joint names of the arm.
        parameters: tolerances.
        time_step: control period [s].

    Attributes:
        at_rest: True if the last command has come and the arm is at rest.
    """

    def __init__(
        self,
        limits: FrankaLimits,
        maximum_velocity: Sequence[float],
        joint_names: Sequence[str],
        parameters: MotionParameters,
        time_step: float,
    ) -> None:
        self._rates = JointRates(limits, joint_names, JOINT_ERRORS, parameters, time_step)
        self._planner, self._plan, self._step = Ruckig(7, time_step), InputParameter(7), OutputParameter(7)
        self._plan.max_velocity = [min(a, b) for a, b in zip(maximum_velocity, limits.velocity, strict=True)]
        self._plan.max_acceleration, self._plan.max_jerk = list(limits.acceleration), list(limits.jerk)
        self.at_rest = self._moving = False

    def start(self, state: RobotState) -> Errors:
        """Start at rest at q_d, which must be within the position limits."""
        self._state, self.reason, self.at_rest, self._moving = state, "", False, False
        state.dq_d[:], state.ddq_d[:] = REST, REST
        plan = self._plan
        plan.current_position, plan.current_velocity, plan.current_acceleration = [*state.q_d], REST, REST
        return NO_ERRORS if self._rates.in_range(state.q_d) else START_POSE_INVALID

    def advance(self, command: MotionCommand | None) -> Errors:
        """Advance by one millisecond and return the errors.

        Args:
            command: new target; None: the target stays the same.
        """
        if command is not None:
            if not command.finished and not self._rates.in_range(command.q):  # NaN is not in range
                self.reason = self._rates.out_of_range(command.q)
                return OUT_OF_RANGE
            self._take(command)
        return self._advance() if self._moving else NO_ERRORS

    def _take(self, command: MotionCommand) -> None:
        plan = self._plan
        if command.finished:
            plan.control_interface, plan.target_velocity = ControlInterface.Velocity, REST
            self.at_rest = not self._moving
        else:
            plan.control_interface, plan.target_position, self._moving = ControlInterface.Position, command.q, True

    def _advance(self) -> Errors:
        state, plan, step = self._state, self._plan, self._step
        result = self._planner.update(plan, step)
        if result not in (Result.Working, Result.Finished):  # no common duration: each joint takes its own
            plan.synchronization = Synchronization.No
            result = self._planner.update(plan, step)
            plan.synchronization = Synchronization.Time
        if result not in (Result.Working, Result.Finished):
            self.reason = f"the planner finds no motion to {plan.target_position} rad within the limits"
            return NO_PLAN
        step.pass_to_input(plan)
        state.q_d[:], state.dq_d[:], state.ddq_d[:] = step.new_position, step.new_velocity, step.new_acceleration
        if result is Result.Finished:
            self._moving = False
            state.dq_d[:], state.ddq_d[:] = REST, REST
            self.at_rest = plan.control_interface is ControlInterface.Velocity
        return NO_ERRORS
