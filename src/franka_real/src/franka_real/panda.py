"""Panda through libfranka 0.9.2 (panda_py), whose functions `Robot.control*` run the loop and call back each cycle."""

from collections.abc import Callable
from typing import Any, ClassVar

import panda_py.libfranka as libfranka

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import ArmMode, Kind
from franka_real.backend import Backend, Cycle, RobotError, clean

Build = Callable[[ArmCommand], Any]


def _pose(command: ArmCommand) -> Any:
    pose = libfranka.CartesianPose
    return pose(command.O_T_EE) if command.elbow is None else pose(command.O_T_EE, command.elbow)


def _twist(command: ArmCommand) -> Any:
    velocities = libfranka.CartesianVelocities
    return velocities(command.O_dP_EE) if command.elbow is None else velocities(command.O_dP_EE, command.elbow)


BUILD: dict[Kind, Build] = {
    Kind.EFFORT: lambda command: libfranka.Torques(command.tau),
    Kind.POSITION: lambda command: libfranka.JointPositions(command.q),
    Kind.VELOCITY: lambda command: libfranka.JointVelocities(command.dq),
    Kind.POSE: _pose,
    Kind.TWIST: _twist,
}
_SUFFIX = {
    Kind.POSITION: "joint_position",
    Kind.VELOCITY: "joint_velocity",
    Kind.POSE: "cartesian_pose",
    Kind.TWIST: "cartesian_velocity",
}
_IMPEDANCES = {
    "joint_impedance": libfranka.ControllerMode.kJointImpedance,
    "cartesian_impedance": libfranka.ControllerMode.kCartesianImpedance,
}


class PandaBackend(Backend):
    """Connection to a Panda through libfranka 0.9.2 (protocol 5), with all command modes, rate limiter and filter."""

    title = "Panda"
    library: ClassVar[Any] = libfranka

    def milliseconds(self, raw: Any) -> int:
        """Return the time of a state on the arm's own clock [ms]."""
        return int(raw.time.to_msec())

    def check(self, mode: ArmMode) -> None:
        """Do nothing: libfranka 0.9.2 supports all command modes."""

    def control(self, mode: ArmMode, cycle: Cycle) -> None:
        """Run a motion until a command has `finished` set."""
        arguments: dict[str, Any] = {
            "limit_rate": self.settings.rate_limiting,
            "cutoff_frequency": self.settings.cutoff_frequency,
        }
        calls, robot = _Calls(cycle), self._robot
        if mode.generator is None:
            self._run(lambda: robot.control(calls.leading(Kind.EFFORT), **arguments), calls)
            return
        leading, suffix = calls.leading(mode.generator), _SUFFIX[mode.generator]
        if mode.torque:
            # libfranka calls the generator's callback first.
            loop = getattr(robot, f"control_torque_{suffix}")
            self._run(lambda: loop(calls.following(Kind.EFFORT), leading, **arguments), calls)
        else:
            arguments["controller_mode"] = _IMPEDANCES[self.settings.internal_controller]
            self._run(lambda: getattr(robot, f"control_{suffix}")(leading, **arguments), calls)

    def _run(self, loop: Callable[[], None], calls: "_Calls") -> None:
        try:
            loop()
        except Exception as error:
            if calls.failure is None:
                self.read_once()  # raises ArmLostError if the arm no longer responds
                raise RobotError(clean(error)) from error
        if calls.failure is not None:
            raise calls.failure

    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major."""
        self._request(lambda: self._robot.set_ee(NE_T_EE))

    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major."""
        self._request(lambda: self._robot.set_k(EE_T_K))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set all eight lists of contact and collision thresholds."""
        self._request(lambda: self._robot.set_collision_behavior(*thresholds.lists()))


class _Calls:
    """Callbacks that libfranka calls during one motion.

    If libfranka needs two commands per millisecond (torques and a motion generator), the first callback runs the cycle,
    and the second returns its part of the same command.

    Attributes:
        failure: exception that the cycle raised; libfranka ends the motion because of it.
    """

    def __init__(self, cycle: Cycle) -> None:
        self._cycle = cycle
        self._command = ArmCommand()
        self.failure: BaseException | None = None

    def leading(self, kind: Kind) -> Callable[[Any, Any], Any]:
        """Return the callback that runs the cycle and returns the command of a kind."""
        cycle, build, finish = self._cycle, BUILD[kind], libfranka.motion_finished

        def callback(raw: Any, _: Any) -> Any:
            try:
                command = self._command = cycle(raw)
                built = build(command)
            except BaseException as error:
                self.failure = error
                raise
            return finish(built) if command.finished else built

        return callback

    def following(self, kind: Kind) -> Callable[[Any, Any], Any]:
        """Return the callback that returns the part of the same command for another kind."""
        build = BUILD[kind]
        return lambda raw, _: build(self._command)
