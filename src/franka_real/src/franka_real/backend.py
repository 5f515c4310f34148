"""Common interface to libfranka's two bindings: panda_py with callbacks (Panda), pylibfranka with a loop (FR3)."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import ArmMode
from franka_real.settings import FrankaRealSettings
from hric_core.errors import FailureError
from hric_core.native.sockets import confine


class RobotError(FailureError):
    """Error of an arm that ended a motion, or refused one or a setting, but still responds; text by libfranka."""


class ArmLostError(FailureError):
    """Error of an arm that no longer responds."""


Cycle = Callable[[Any], ArmCommand]
"""Function that returns the command for a state, called each millisecond; its exceptions end `Backend.control`."""


def keep_local(address: str) -> None:
    """Let libfranka receive states on the loopback interface only, if the arm's address is a loopback address.

    Otherwise libfranka accepts them on all network interfaces, from the first sender.
    """
    if address.startswith("127."):
        confine("libPocoNet")


class Backend(ABC):
    """Base of the connections to an arm through one of libfranka's Python bindings.

    All calls come from the control loop's thread. Each call blocks until the arm has responded, and holds the
    interpreter's lock meanwhile.

    Args:
        settings: parameters of the robot node.

    Attributes:
        title: name of the arm, for messages.
        library: module of libfranka's binding.
        network_errors: exceptions by which the binding reports a lost arm, if it has special types for that.
        settings: as in Args.

    Raises:
        ArmLostError: no connection to the arm is possible.
    """

    title: ClassVar[str]
    library: ClassVar[Any]
    network_errors: ClassVar[tuple[type[Exception], ...]] = ()

    def __init__(self, settings: FrankaRealSettings) -> None:
        self.settings = settings
        config = self.library.RealtimeConfig
        keep_local(settings.robot_ip)
        realtime = config.kEnforce if settings.realtime_config == "enforce" else config.kIgnore
        try:
            self._robot = self.library.Robot(settings.robot_ip, realtime)
        except RuntimeError as error:
            raise ArmLostError(f"no connection to the {self.title} at {settings.robot_ip}: {clean(error)}") from error

    def _lost(self, error: Exception) -> ArmLostError:
        return ArmLostError(f"the connection to the {self.title} at {self.settings.robot_ip} is lost: {clean(error)}")

    def read_once(self) -> Any:
        """Wait for a state of the arm and return it. Raises ArmLostError.

        After a pause, the first state of the FR3 is an old one; a second call returns the present one.
        """
        try:
            return self._robot.read_once()
        except RuntimeError as error:
            raise self._lost(error) from error

    @abstractmethod
    def milliseconds(self, raw: Any) -> int:
        """Return the time of a state on the arm's own clock [ms]; raw: state as the binding returns it."""

    @abstractmethod
    def check(self, mode: ArmMode) -> None:
        """Raise a HricError if the binding of this arm does not support the command mode."""

    @abstractmethod
    def control(self, mode: ArmMode, cycle: Cycle) -> None:
        """Run a motion until a command has `finished` set.

        Args:
            mode: command mode: torques, a motion generator, or both.
            cycle: function that returns the command for each state.

        Raises:
            RobotError: the arm refused or ended the motion.
            ArmLostError: the arm no longer responds.
        """

    def _request(self, call: Callable[[], None]) -> None:
        """Send a request to the arm. Raises RobotError or ArmLostError."""
        try:
            call()
        except self.network_errors as error:
            raise self._lost(error) from error
        except RuntimeError as error:
            raise RobotError(clean(error)) from error

    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Set the payload: mass [kg], centre of mass in the flange [m], inertia [kg m^2]. Raises RobotError."""
        self._request(lambda: self._robot.set_load(mass, com, inertia))

    @abstractmethod
    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Set the end effector in the nominal end-effector frame, 16 floats, column-major. Raises RobotError."""

    @abstractmethod
    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Set the stiffness frame in the end-effector frame, 16 floats, column-major. Raises RobotError."""

    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Set the stiffness of the internal joint impedance, 7 floats [N m/rad]. Raises RobotError."""
        self._request(lambda: self._robot.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Set the internal Cartesian stiffness, 3 floats [N/m] and 3 [N m/rad]. Raises RobotError."""
        self._request(lambda: self._robot.set_cartesian_impedance(stiffness))

    @abstractmethod
    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds. Raises RobotError."""

    def recover(self) -> None:
        """Run automatic error recovery; may take seconds. Raises RobotError."""
        self._request(self._robot.automatic_error_recovery)

    def load_model(self) -> Any:
        """Return libfranka's model: downloaded from the Panda, or built from the FR3's URDF. Raises RobotError."""
        try:
            return self._robot.load_model()
        except RuntimeError as error:
            raise RobotError(f"the arm's model cannot be loaded: {clean(error)}") from error

    def close(self) -> None:
        """End the connection by deleting libfranka's Robot object."""
        self.__dict__.pop("_robot", None)


def clean(error: BaseException) -> str:
    """Return the text of a libfranka error in one line, without the prefix "libfranka: "."""
    return re.sub(r"\s*\n\s*", "; ", str(error).strip()).removeprefix("libfranka: ")
