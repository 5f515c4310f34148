"""The FR3 through pylibfranka: read a state, write a command. It has no limiter and no filter of its own; joint commands get both here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pylibfranka as libfranka

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import Kind, Mode
from franka_hw_interface.rate_limits import JointSmoother, TorqueSmoother
from franka_real.backend import Backend, ConnectionLostError, ControlSettings, Cycle, RobotError, clean
from franka_real.settings import fr3_limits
from hric_control.errors import HricError

_START = {
    Kind.POSITION: "start_joint_position_control",
    Kind.VELOCITY: "start_joint_velocity_control",
    Kind.POSE: "start_cartesian_pose_control",
    Kind.TWIST: "start_cartesian_velocity_control",
}
_REFUSALS = (libfranka.ControlException, libfranka.CommandException, libfranka.InvalidOperationException, libfranka.FrankaException)
"""They have no base of their own but RuntimeError."""

Build = Callable[[Any, ArmCommand], Any]
"""(libfranka's state, command) -> command of pylibfranka."""


class Fr3Backend(Backend):
    """pylibfranka 0.21, protocol version 10: one kind of command at a time, no elbow, one pair of collision thresholds for all phases."""

    name = "fr3"

    def __init__(self, address: str, settings: ControlSettings) -> None:
        super().__init__(address, settings)
        config = libfranka.RealtimeConfig.kEnforce if settings.enforce_realtime else libfranka.RealtimeConfig.kIgnore
        try:
            self._robot = libfranka.Robot(address, config)
        except RuntimeError as error:
            raise ConnectionLostError(f"the FR3 at {address} cannot be used: {clean(error)}") from error

    def read_once(self) -> Any:
        """The newest state that was received; after a pause a second call is needed for one of now."""
        try:
            return self._robot.read_once()
        except RuntimeError as error:
            raise ConnectionLostError(f"the FR3 at {self.address} is lost: {clean(error)}") from error

    def milliseconds(self, raw: Any) -> int:
        """The arm's own time of a state [ms]."""
        seconds: float = raw.time.to_sec()
        return round(1e3 * seconds)

    def check(self, mode: Mode) -> None:
        """Torques together with a motion generator are not in pylibfranka."""
        if mode.torque and mode.generator is not None:
            raise HricError(f"the FR3 cannot be commanded by {mode}: pylibfranka takes joint torque or one motion generator")

    def control(self, mode: Mode, cycle: Cycle) -> None:
        """Run a motion until a command is `finished`."""
        self.check(mode)
        try:
            self._loop(mode, cycle)
        except libfranka.NetworkException as error:
            raise ConnectionLostError(f"the FR3 at {self.address} is lost: {clean(error)}") from error
        except _REFUSALS as error:
            raise RobotError(clean(error)) from error

    def _loop(self, mode: Mode, cycle: Cycle) -> None:
        # An object whose motion was aborted must not be used again, it would wait for ever: it goes with this call, which tells the arm to stop.
        if mode.generator is None:
            motion = self._robot.start_torque_control()
        else:
            kinds = libfranka.ControllerMode
            impedance = kinds.CartesianImpedance if self.settings.cartesian_impedance else kinds.JointImpedance
            motion = getattr(self._robot, _START[mode.generator])(impedance)
        build, read, write, finished = self._builder(mode), motion.readOnce, motion.writeOnce, False
        while not finished:
            raw, _ = read()
            command = cycle(raw)
            built = build(raw, command)
            built.motion_finished = finished = command.finished
            write(built)

    def _builder(self, mode: Mode) -> Build:
        """From a command to what pylibfranka writes, smoothed as libfranka's own loops would."""
        limits = fr3_limits() if self.settings.rate_limiting else None
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

    def _tell(self, call: Callable[[], None]) -> None:
        try:
            call()
        except libfranka.NetworkException as error:
            raise ConnectionLostError(f"the FR3 at {self.address} is lost: {clean(error)}") from error
        except RuntimeError as error:
            raise RobotError(clean(error)) from error

    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Tell the payload."""
        self._tell(lambda: self._robot.set_load(mass, com, inertia))

    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Tell the end effector."""
        self._tell(lambda: self._robot.set_EE(NE_T_EE))

    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Tell the stiffness frame."""
        self._tell(lambda: self._robot.set_K(EE_T_K))

    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Tell the stiffness of the internal joint impedance."""
        self._tell(lambda: self._robot.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Tell the stiffness of the internal Cartesian impedance."""
        self._tell(lambda: self._robot.set_cartesian_impedance(stiffness))

    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Tell the thresholds, those for steady motion for all phases: pylibfranka has no others."""
        steady = [list(getattr(thresholds, f"{side}_{kind}_thresholds_nominal")) for kind in ("torque", "force") for side in ("lower", "upper")]
        self._tell(lambda: self._robot.set_collision_behavior(*steady))

    def recover(self) -> None:
        """Automatic error recovery."""
        self._tell(self._robot.automatic_error_recovery)

    def load_model(self) -> Any:
        """libfranka's model, from the URDF that the arm sends."""
        try:
            return self._robot.load_model()
        except RuntimeError as error:
            raise RobotError(f"the arm's model cannot be loaded: {clean(error)}") from error

    def close(self) -> None:
        """End the connection: libfranka does it with its object."""
        self.__dict__.pop("_robot", None)
