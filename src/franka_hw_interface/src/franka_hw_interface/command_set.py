"""Commands of the arm in all command modes: storage, joint limits, smoothing, and the row for the control log."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface, FrankaVelocityCartesianInterface
from franka_hw_interface.limits import FrankaLimits
from franka_hw_interface.modes import HOLD, ArmMode, Kind
from franka_hw_interface.rate_limits import MAX_CUTOFF, JointSmoother
from franka_hw_interface.robot_state import RobotState, identity16
from hric_control.hardware_interface import (
    EffortJointInterface,
    HardwareInterface,
    JointCommands,
    JointStates,
    PositionJointInterface,
    VelocityJointInterface,
)
from hric_control.limits import EffortLimiter, JointLimits, LimitCounts, Limiter, PositionLimiter, VelocityLimiter
from hric_control.robot_hw import LogRow

PERIOD = 1e-3
"""Duration for which a real arm applies a command, however many states were lost before it [s]."""


@dataclass(slots=True)
class ArmCommand:
    """Command of an arm for one millisecond; only the fields of the present command mode are used.

    Attributes:
        q, dq: joint position [rad] and velocity [rad/s], 7 floats each.
        O_T_EE: pose of the end effector in the base, 16 floats, column-major.
        O_dP_EE: twist of the end effector in the base, linear [m/s] then angular [rad/s], 6 floats.
        elbow: (position of joint 3 [rad], side of joint 4, -1 or 1); None: the arm chooses.
        tau: joint torque without gravity, 7 floats [N m].
        finished: True if the motion ends with this command.
    """

    q: list[float] = field(default_factory=lambda: [0.0] * 7)
    dq: list[float] = field(default_factory=lambda: [0.0] * 7)
    O_T_EE: list[float] = field(default_factory=identity16)
    O_dP_EE: list[float] = field(default_factory=lambda: [0.0] * 6)
    elbow: tuple[float, float] | None = None
    tau: list[float] = field(default_factory=lambda: [0.0] * 7)
    finished: bool = False


class _Joints(NamedTuple):
    """Commands of one joint interface with their limiter and smoother."""

    commands: JointCommands
    limiter: Limiter
    smoother: JointSmoother | None


class CommandSet:
    """Command interfaces of the arm for all command modes, with joint limits and smoothing.

    Args:
        arm_id: prefix of joint and link names.
        states: measured joint states.
        state: Franka state of the arm.
        limits: joint limits, one per joint.
        period: period of the commands [s].
        smoothing: limits for the rates of joint positions and velocities, for an arm that is commanded without
            libfranka; None: commands are not smoothed.
        arm_limits: limits of the arm, for controllers; None: those of the Panda.
        filtered: True if Cartesian commands are filtered on their way to the arm.

    Attributes:
        counts: counts of the limiters' interventions.
        row: command interface per joint, commands before the limits, and commands sent, all of the last cycle.
    """

    def __init__(
        self,
        arm_id: str,
        states: JointStates,
        state: RobotState,
        limits: Sequence[JointLimits],
        period: float = PERIOD,
        smoothing: FrankaLimits | None = None,
        arm_limits: FrankaLimits | None = None,
        filtered: bool = False,
    ) -> None:
        self._state, self._period = state, period
        self._pose, self._twist = (
            FrankaPoseCartesianInterface(arm_id, state, arm_limits, filtered),
            FrankaVelocityCartesianInterface(arm_id, state, arm_limits, filtered),
        )
        self.counts = LimitCounts(states.names, [limit.velocity for limit in limits])

        def joints(limiter: type[Limiter]) -> _Joints:
            commands, smoother = JointCommands(states), None
            if smoothing is not None and limiter is not EffortLimiter:
                smoother = JointSmoother(smoothing, MAX_CUTOFF, limiter is PositionLimiter, period)
            return _Joints(commands, limiter(states, commands, limits, self.counts), smoother)

        self._effort, self._position, self._velocity = map(joints, (EffortLimiter, PositionLimiter, VelocityLimiter))
        self._n = len(states.names)
        self._zeros = [0.0] * self._n
        self._kinds = [HOLD.log_name] * self._n
        self.row: LogRow = self._kinds, self._zeros, self._zeros
        self._command = ArmCommand()

    def interfaces(self) -> list[HardwareInterface]:
        """Return the command interfaces of all modes."""
        return [
            EffortJointInterface(self._effort.commands),
            VelocityJointInterface(self._velocity.commands),
            PositionJointInterface(self._position.commands),
            self._pose,
            self._twist,
        ]

    def enter(self, mode: ArmMode) -> None:
        """Start a command mode with commands that do not move the arm.

        Positions and poses start at the present desired values, torques and velocities at zero.
        """
        for joints in (self._effort, self._position, self._velocity):
            start = self._state.q_d if joints is self._position else self._zeros
            joints.commands.value[:] = start
            joints.limiter.reset(start)
        self._pose.command.value[:], self._pose.command.elbow = self._state.O_T_EE_c, None
        self._twist.command.value[:], self._twist.command.elbow = [0.0] * 6, None
        self._kinds = [mode.log_name] * self._n
        self.row = self._kinds, self._zeros, self._zeros

    def check_start(self) -> None:
        """Log a warning once if joints start outside their position limits."""
        self._effort.limiter.check_start()

    def limited_command(self, mode: ArmMode) -> ArmCommand:
        """Return the command of this cycle, within the joint limits; the next call overwrites the object."""
        command, generator = self._command, mode.generator
        command.elbow = None
        if generator is Kind.POSITION:
            command.q = self._limited(self._position)
        elif generator is Kind.VELOCITY:
            command.dq = self._limited(self._velocity)
        elif generator is Kind.POSE:
            command.O_T_EE, command.elbow = self._pose.command.value, _pair(self._pose.command.elbow)
        elif generator is Kind.TWIST:
            command.O_dP_EE, command.elbow = self._twist.command.value, _pair(self._twist.command.elbow)
        if mode.torque:
            command.tau = self._limited(self._effort)
        return command

    def _limited(self, joints: _Joints) -> list[float]:
        commands, limiter, smoother = joints
        value = commands.value
        raw = value[:]
        limiter.enforce(self._period)
        sent = value[:]
        if smoother is not None:
            state = self._state
            sent = list(smoother.smooth(sent, state.q_d, state.dq_d, state.ddq_d))
        self.row = self._kinds, raw, sent
        return sent


def _pair(elbow: list[float] | None) -> tuple[float, float] | None:
    return None if elbow is None else (elbow[0], elbow[1])
