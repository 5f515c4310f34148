"""The Panda through panda_py's libfranka 0.9.2: a callback within `Robot.control*`, which owns the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import panda_py.libfranka as libfranka

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import Kind, Mode
from franka_real.backend import Backend, ConnectionLostError, ControlSettings, Cycle, RobotError, clean

Build = Callable[[ArmCommand], Any]


def _pose(command: ArmCommand) -> Any:
    return libfranka.CartesianPose(command.O_T_EE) if command.elbow is None else libfranka.CartesianPose(command.O_T_EE, command.elbow)


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
_SUFFIX = {Kind.POSITION: "joint_position", Kind.VELOCITY: "joint_velocity", Kind.POSE: "cartesian_pose", Kind.TWIST: "cartesian_velocity"}


class PandaBackend(Backend):
    """libfranka 0.9.2, protocol version 5. All nine of its loops; it limits rates and filters by itself."""

    name = "panda"

    def __init__(self, address: str, settings: ControlSettings) -> None:
        super().__init__(address, settings)
        config = libfranka.RealtimeConfig.kEnforce if settings.enforce_realtime else libfranka.RealtimeConfig.kIgnore
        try:
            self._robot = libfranka.Robot(address, config)
        except RuntimeError as error:
            raise ConnectionLostError(f"the Panda at {address} cannot be used: {clean(error)}") from error

    def read_once(self) -> Any:
        """The newest state."""
        try:
            return self._robot.read_once()
        except RuntimeError as error:
            raise ConnectionLostError(f"the Panda at {self.address} is lost: {clean(error)}") from error

    def milliseconds(self, raw: Any) -> int:
        """The arm's own time of a state [ms]."""
        return int(raw.time.to_msec())

    def check(self, mode: Mode) -> None:
        """libfranka 0.9.2 has all modes."""

    def control(self, mode: Mode, cycle: Cycle) -> None:
        """Run a motion until a command is `finished`."""
        arguments: dict[str, Any] = {"limit_rate": self.settings.rate_limiting, "cutoff_frequency": self.settings.cutoff_frequency}
        calls = _Calls(cycle)
        if mode.generator is None:
            self._run(lambda: self._robot.control(calls.leading(Kind.EFFORT), **arguments), calls)
        elif mode.torque:
            # libfranka asks for the generator's command first.
            loop, leading = getattr(self._robot, f"control_torque_{_SUFFIX[mode.generator]}"), calls.leading(mode.generator)
            self._run(lambda: loop(calls.following(Kind.EFFORT), leading, **arguments), calls)
        else:
            kinds = libfranka.ControllerMode
            arguments["controller_mode"] = kinds.kCartesianImpedance if self.settings.cartesian_impedance else kinds.kJointImpedance
            loop, leading = getattr(self._robot, f"control_{_SUFFIX[mode.generator]}"), calls.leading(mode.generator)
            self._run(lambda: loop(leading, **arguments), calls)

    def _run(self, loop: Callable[[], None], calls: _Calls) -> None:
        try:
            loop()
        except Exception as error:
            if calls.failure is None:
                self.read_once()  # raises if the arm is gone
                raise RobotError(clean(error)) from error
        if calls.failure is not None:
            raise calls.failure

    def _tell(self, call: Callable[[], None]) -> None:
        try:
            call()
        except RuntimeError as error:
            raise RobotError(clean(error)) from error

    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Tell the payload."""
        self._tell(lambda: self._robot.set_load(mass, com, inertia))

    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Tell the end effector."""
        self._tell(lambda: self._robot.set_ee(NE_T_EE))

    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Tell the stiffness frame."""
        self._tell(lambda: self._robot.set_k(EE_T_K))

    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Tell the stiffness of the internal joint impedance."""
        self._tell(lambda: self._robot.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Tell the stiffness of the internal Cartesian impedance."""
        self._tell(lambda: self._robot.set_cartesian_impedance(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Tell all eight thresholds."""
        self._tell(lambda: self._robot.set_collision_behavior(*thresholds.lists()))

    def recover(self) -> None:
        """Automatic error recovery."""
        self._tell(self._robot.automatic_error_recovery)

    def load_model(self) -> Any:
        """libfranka's model, downloaded from the arm."""
        try:
            return self._robot.load_model()
        except RuntimeError as error:
            raise RobotError(f"the arm's model cannot be loaded: {clean(error)}") from error

    def close(self) -> None:
        """End the connection: libfranka does it with its object."""
        self.__dict__.pop("_robot", None)


class _Calls:
    """The callbacks of one motion. Where libfranka asks for two commands in a millisecond, the cycle runs in the first callback, and the second
    takes its part of the same command.

    Attributes:
        failure: what the cycle raised; libfranka then ends the motion in its own way.
    """

    def __init__(self, cycle: Cycle) -> None:
        self._cycle = cycle
        self._command = ArmCommand()
        self.failure: BaseException | None = None

    def leading(self, kind: Kind) -> Callable[[Any, Any], Any]:
        """The callback in which the cycle runs."""
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
        """The callback that takes its part of the command."""
        build = BUILD[kind]
        return lambda raw, _: build(self._command)
