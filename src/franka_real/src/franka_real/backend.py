"""Common interface to both of libfranka's control loops: the Panda's callbacks and the FR3's read/write loop."""

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
    """Error of an arm that ended or refused a motion or a setting, and still responds; the text is libfranka's."""


class ArmLostError(FailureError):
    """Error of an arm that no longer responds."""


Cycle = Callable[[Any], ArmCommand]
"""Function from state to command, called each millisecond; `control` ends with the exceptions that it raises."""


def keep_local(address: str) -> None:
    """Restrict the reception of states to loopback if the arm has a loopback address.

    libfranka would receive them on all interfaces, from the first sender.
    """
    if address.startswith("127."):
        confine("libPocoNet")


class Backend(ABC):
    """Robot of libfranka. All calls come from the control loop's thread.

    Each call blocks the thread until the arm has responded, with the interpreter's lock held.

    Args:
        settings: parameters of the robot node.

    Attributes:
        title: name of the arm, for messages.
        library: libfranka's binding.
        network_errors: exceptions of the binding for a lost arm, if it has special types for them.
        settings: as in Args.

    Raises:
        ConnectionLostError: the arm cannot be used.
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
            raise ArmLostError(f"the {self.title} at {settings.robot_ip} cannot be used: {clean(error)}") from error

    def _lost(self, error: Exception) -> ArmLostError:
        return ArmLostError(f"the {self.title} at {self.settings.robot_ip} is lost: {clean(error)}")

    def read_once(self) -> Any:
        """Wait for the newest received state and return it [ConnectionLostError].

        After a pause, the FR3 needs a second call for a current state.
        """
        try:
            return self._robot.read_once()
        except RuntimeError as error:
            raise self._lost(error) from error

    @abstractmethod
    def milliseconds(self, raw: Any) -> int:
        """Return the arm's own time of a state [ms]."""

    @abstractmethod
    def check(self, mode: ArmMode) -> None:
        """Refuse a mode that this arm does not have. Raises HricError."""

    @abstractmethod
    def control(self, mode: ArmMode, cycle: Cycle) -> None:
        """Run a motion until a command is `finished`.

        Raises:
            RobotError: the arm refused or ended it.
            ConnectionLostError: the arm is gone.
        """

    def _request(self, call: Callable[[], None]) -> None:
        """Send a request to the arm [RobotError, ConnectionLostError]."""
        try:
            call()
        except self.network_errors as error:
            raise self._lost(error) from error
        except RuntimeError as error:
            raise RobotError(clean(error)) from error

    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Set the payload. Raises RobotError, as do the setters below."""
        self._request(lambda: self._robot.set_load(mass, com, inertia))

    @abstractmethod
    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """Set the end effector. Raises RobotError."""

    @abstractmethod
    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Set the stiffness frame. Raises RobotError."""

    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Set the stiffness of the internal joint impedance. Raises RobotError."""
        self._request(lambda: self._robot.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Set the stiffness of the internal Cartesian impedance. Raises RobotError."""
        self._request(lambda: self._robot.set_cartesian_impedance(stiffness))

    @abstractmethod
    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Set the contact and collision thresholds. Raises RobotError."""

    def recover(self) -> None:
        """Run automatic error recovery; may take seconds. Raises RobotError."""
        self._request(self._robot.automatic_error_recovery)

    def load_model(self) -> Any:
        """Return libfranka's model: downloaded from the Panda, or built from the FR3's URDF [RobotError]."""
        try:
            return self._robot.load_model()
        except RuntimeError as error:
            raise RobotError(f"the arm's model cannot be loaded: {clean(error)}") from error

    def close(self) -> None:
        """End the connection: libfranka does so when its object is deleted."""
        self.__dict__.pop("_robot", None)


def clean(error: BaseException) -> str:
    """Return libfranka's text in one line, without its prefix."""
    return re.sub(r"\s*\n\s*", "; ", str(error).strip()).removeprefix("libfranka: ")
