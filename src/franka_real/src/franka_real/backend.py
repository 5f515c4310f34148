"""One interface to both of libfranka's control loops: the Panda's callbacks and the FR3's read/write loop."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.command_set import ArmCommand
from franka_hw_interface.modes import Mode
from franka_real.settings import Settings
from hric_control.errors import FailureError
from hric_control.native.sockets import confine


class RobotError(FailureError):
    """The arm ended or refused a motion, or refused a setting; it is still there. The message is libfranka's."""


class ConnectionLostError(FailureError):
    """The arm no longer responds."""


Cycle = Callable[[Any], ArmCommand]
"""libfranka's state -> command; called each millisecond while a motion runs. What it raises ends the motion and reaches
the caller of `control`."""


def keep_local(address: str) -> None:
    """Receive states over loopback alone where the arm is there: libfranka takes them on all interfaces, from
    whoever sends first."""
    if address.startswith("127."):
        confine("libPocoNet")


class Backend(ABC):
    """libfranka's Robot. All calls come from the control loop's thread, and block it, with the interpreter's lock held,
    until the arm has responded.

    Args:
        settings: of the robot node.

    Attributes:
        title: of the arm, for messages.
        library: libfranka's binding.
        network_errors: what the binding raises when the arm is gone, where these errors have types of their own.
        settings: as given.

    Raises:
        ConnectionLostError: the arm cannot be used.
    """

    title: ClassVar[str]
    library: ClassVar[Any]
    network_errors: ClassVar[tuple[type[Exception], ...]] = ()

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        config = self.library.RealtimeConfig
        keep_local(settings.robot_ip)
        realtime = config.kEnforce if settings.realtime_config == "enforce" else config.kIgnore
        try:
            self._robot = self.library.Robot(settings.robot_ip, realtime)
        except RuntimeError as error:
            raise ConnectionLostError(
                f"the {self.title} at {settings.robot_ip} cannot be used: {clean(error)}"
            ) from error

    def _lost(self, error: Exception) -> ConnectionLostError:
        return ConnectionLostError(f"the {self.title} at {self.settings.robot_ip} is lost: {clean(error)}")

    def read_once(self) -> Any:
        """The newest state that was received, waiting for it; after a pause the FR3 needs a second call for one of now
        [ConnectionLostError]."""
        try:
            return self._robot.read_once()
        except RuntimeError as error:
            raise self._lost(error) from error

    @abstractmethod
    def milliseconds(self, raw: Any) -> int:
        """The arm's own time of a state [ms]."""

    @abstractmethod
    def check(self, mode: Mode) -> None:
        """Refuse a mode that this arm does not have. Raises HricError."""

    @abstractmethod
    def control(self, mode: Mode, cycle: Cycle) -> None:
        """Run a motion until a command is `finished`.

        Raises:
            RobotError: the arm refused or ended it.
            ConnectionLostError: the arm is gone.
        """

    def _request(self, call: Callable[[], None]) -> None:
        """Make a request of the arm [RobotError, ConnectionLostError]."""
        try:
            call()
        except self.network_errors as error:
            raise self._lost(error) from error
        except RuntimeError as error:
            raise RobotError(clean(error)) from error

    def set_load(self, mass: float, com: list[float], inertia: list[float]) -> None:
        """Payload. Raises RobotError, as the setters below."""
        self._request(lambda: self._robot.set_load(mass, com, inertia))

    @abstractmethod
    def set_EE_frame(self, NE_T_EE: list[float]) -> None:
        """End effector. Raises RobotError."""

    @abstractmethod
    def set_K_frame(self, EE_T_K: list[float]) -> None:
        """Stiffness frame. Raises RobotError."""

    def set_joint_impedance(self, stiffness: list[float]) -> None:
        """Stiffness of the internal joint impedance. Raises RobotError."""
        self._request(lambda: self._robot.set_joint_impedance(stiffness))

    def set_cartesian_impedance(self, stiffness: list[float]) -> None:
        """Stiffness of the internal Cartesian impedance. Raises RobotError."""
        self._request(lambda: self._robot.set_cartesian_impedance(stiffness))

    @abstractmethod
    def set_collision_behavior(self, thresholds: CollisionThresholds) -> None:
        """Contact and collision thresholds. Raises RobotError."""

    def recover(self) -> None:
        """Automatic error recovery; may take seconds. Raises RobotError."""
        self._request(self._robot.automatic_error_recovery)

    def load_model(self) -> Any:
        """libfranka's model: the Panda's is downloaded, the FR3's made from the URDF that the arm sends
        [RobotError]."""
        try:
            return self._robot.load_model()
        except RuntimeError as error:
            raise RobotError(f"the arm's model cannot be loaded: {clean(error)}") from error

    def close(self) -> None:
        """End the connection: libfranka does it with its object."""
        self.__dict__.pop("_robot", None)


def clean(error: BaseException) -> str:
    """libfranka's text in one line, without its prefix."""
    return re.sub(r"\s*\n\s*", "; ", str(error).strip()).removeprefix("libfranka: ")
