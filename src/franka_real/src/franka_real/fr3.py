"""FR3 through pylibfranka. It has no rate limiter and no filter, so joint commands are limited and filtered here."""

from collections.abc import Callable
from typing import Any, ClassVar

import pylibfranka as libfranka

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import ArmMode, Kind
from franka_hw_interface.rate_limits import JointSmoother, TorqueSmoother
from franka_real.backend import Backend, Cycle, RobotError, clean
from hric_core.errors import HricError

_START = {
    Kind.POSITION: "start_joint_position_control",
    Kind.VELOCITY: "start_joint_velocity_control",
    Kind.POSE: "start_cartesian_pose_control",
    Kind.TWIST: "start_cartesian_velocity_control",
}
_IMPEDANCES = {
    "joint_impedance": libfranka.ControllerMode.JointImpedance,
    "cartesian_impedance": libfranka.ControllerMode.CartesianImpedance,
}
_REFUSALS = (
    libfranka.ControlException,
    libfranka.CommandException,
    libfranka.InvalidOperationException,
    libfranka.FrankaException,
)
"""Exceptions of pylibfranka for refused commands; their only common base is RuntimeError."""

Build = Callable[[Any, ArmCommand], Any]
"""Function that converts (state of libfranka, command) to a command object of pylibfranka."""


class Fr3Backend(Backend):
    """Connection to an FR3 through pylibfranka 0.21 (protocol 10).

    Limitations of the binding: one kind of command at a time, no elbow, and collision thresholds that are the same
    for accelerated and steady motion.
    """

    title = "FR3"
    library: ClassVar[Any] = libfranka
    network_errors = (libfranka.NetworkException,)

    def milliseconds(self, raw: Any) -> int:
        """Return the time of a state on the arm's own clock [ms]."""
        seconds: float = raw.time.to_sec()
        return round(1e3 * seconds)

    def check(self, mode: ArmMode) -> None:
        """Raise a HricError for torques together with a motion generator, which pylibfranka does not support."""
        if mode.torque and mode.generator is not None:
            raise HricError(
                f"the FR3 cannot be commanded by {mode}: pylibfranka accepts joint torque or one motion generator"
            )

    def control(self, mode: ArmMode, cycle: Cycle) -> None:
        """Run a motion until a command has `finished` set."""
        self.check(mode)
        try:
            self._loop(mode, cycle)
        except libfranka.NetworkException as error:
            raise self._lost(error) from error
        except _REFUSALS as error:
            raise RobotError(clean(error)) from error

    def _loop(self, mode: ArmMode, cycle: Cycle) -> None:
        # A motion object must not be used again after an abort, or it would wait forever: it is deleted at the end of
        # this call, which stops the arm.
        if mode.generator is None:
            motion = self._robot.start_torque_control()
        else:
            motion = getattr(self._robot, _START[mode.generator])(_IMPEDANCES[self.settings.internal_controller])
        build, read, write, finished = self._builder(mode), motion.readOnce, motion.writeOnce, False
        while not finished:
            raw, _ = read()
            command = cycle(raw)
            if command.elbow is not None:
                raise RobotError("pylibfranka cannot command the elbow of the FR3; command the pose without an elbow")
            built = build(raw, command)
            built.motion_finished = finished = command.finished
            write(built)

    def _builder(self, mode: ArmMode) -> Build:
        """Return a function that filters, limits and converts commands, as libfranka's C++ loops do."""
        limits = self.settings.limits if self.settings.rate_limiting else None
        cutoff = self.settings.cutoff_frequency
        if mode.generator is Kind.POSE:
            return lambda raw, command: libfranka.CartesianPose(command.O_T_EE)
        if mode.generator is Kind.TWIST:
            return lambda raw, command: libfranka.CartesianVelocities(command.O_dP_EE)
        if mode.generator is None:
            torque = TorqueSmoother(limits, cutoff).smooth
            return lambda raw, command: libfranka.Torques(torque(command.tau, raw.tau_J_d))
        joints = JointSmoother(limits, cutoff, mode.generator is Kind.POSITION).smooth
        if mode.generator is Kind.POSITION:
            return lambda raw, command: libfranka.JointPositions(joints(command.q, raw.q_d, raw.dq_d, raw.ddq_d))
        return lambda raw, command: libfranka.JointVelocities(joints(command.dq, raw.q_d, raw.dq_d, raw.ddq_d))

    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major."""
        self._request(lambda: self._robot.set_EE(NE_T_EE))

    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major."""
        self._request(lambda: self._robot.set_K(EE_T_K))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the nominal collision thresholds; pylibfranka has no separate ones for accelerated motion."""
        steady = [
            list(getattr(thresholds, f"{side}_{kind}_thresholds_nominal"))
            for kind in ("torque", "force")
            for side in ("lower", "upper")
        ]
        self._request(lambda: self._robot.set_collision_behavior(*steady))
