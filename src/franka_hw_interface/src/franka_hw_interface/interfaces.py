"""Hardware interfaces of the Franka arm: state, model, Cartesian commands."""

import math
from collections.abc import Sequence
from typing import ClassVar, Self

from franka_hw_interface.limits import FrankaLimits, franka_limits
from franka_hw_interface.model import FrankaModel, FrankaModelHandle
from franka_hw_interface.robot_state import RobotState, identity16
from franka_hw_interface.transforms import check_pose
from hric_control.hardware_interface import HardwareInterface
from hric_core.errors import CommandError, HricError, check_known


class FrankaStateHandle:
    """Handle to the state of the arm, read-only by convention: the robot writes it in place every cycle.

    Attributes:
        name: "<arm_id>_robot".
        robot_state: Franka state, valid until the next cycle; `robot_state.snapshot()` returns a permanent copy.
    """

    __slots__ = ("name", "robot_state")

    def __init__(self, name: str, state: RobotState) -> None:
        self.name, self.robot_state = name, state


class _ArmInterface(HardwareInterface):
    """Hardware interface with one resource, named `<arm_id>_<suffix>`; a joined one has those of several arms."""

    suffix: ClassVar[str] = "robot"

    def __init__(self, arm_id: str, state: RobotState) -> None:
        super().__init__()
        if not isinstance(arm_id, str) or not arm_id:
            raise HricError(f"{type(self).__name__}: arm_id must be a non-empty string; got {arm_id!r}")
        if not isinstance(state, RobotState):
            raise HricError(f"{type(self).__name__}: state must be a RobotState; got {type(state).__name__}")
        self.arm_id, self.state = arm_id, state
        self.resource = f"{arm_id}_{self.suffix}"
        self._joined: dict[str, Self] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the resources."""
        return tuple(self._arms())

    def _arms(self) -> dict[str, Self]:
        """Return the interface of each arm by resource."""
        return self._joined or {self.resource: self}

    def joined(self, others: Sequence[Self]) -> Self:
        """Return one interface with the resources of several arms; it has no attributes of an arm, see `of`."""
        whole = object.__new__(type(self))
        HardwareInterface.__init__(whole)
        whole._joined = {name: arm for part in (self, *others) for name, arm in part._arms().items()}
        return whole

    def of(self, arm_id: str) -> Self:
        """Return the interface of one arm, for its attributes; claims are noted by the handles of this interface."""
        name = f"{arm_id}_{self.suffix}"
        check_known("handle", [name], self.names, type(self).__name__)
        return self._arms()[name]

    def _claimed(self, name: str) -> Self:
        """Return the interface of the arm with a resource, and claim the resource."""
        check_known("handle", [name], self.names, type(self).__name__)
        self._claim([name])
        return self._arms()[name]


class FrankaStateInterface(_ArmInterface):
    """Interface to the state resource "<arm_id>_robot"; claims nothing."""

    cpp_name = "franka_hw::FrankaStateInterface"

    def handle(self, name: str) -> FrankaStateHandle:
        """Return the state handle."""
        return FrankaStateHandle(name, self._claimed(name).state)


class FrankaModelInterface(_ArmInterface):
    """Interface to the model resource "<arm_id>_model"; claims nothing.

    All controllers share one handle, so each result is computed at most once per cycle.
    """

    cpp_name = "franka_hw::FrankaModelInterface"
    suffix = "model"

    def __init__(self, arm_id: str, model: FrankaModel, state: RobotState) -> None:
        super().__init__(arm_id, state)
        if not isinstance(model, FrankaModel):
            raise HricError(f"FrankaModelInterface: {type(model).__name__} is no FrankaModel")
        self.model = model
        self._handle = FrankaModelHandle(self.resource, model, state)

    def handle(self, name: str) -> FrankaModelHandle:
        """Return the model handle."""
        return self._claimed(name)._handle


def _check_elbow(elbow: Sequence[float]) -> list[float]:
    values = [float(value) for value in elbow]
    if len(values) != 2 or not all(map(math.isfinite, values)) or values[1] not in (-1.0, 1.0):
        raise CommandError(f"elbow must be [position of joint 3 in rad, side of joint 4 as -1 or 1]; got {list(elbow)}")
    return values


class CartesianCommand:
    """Storage of a Cartesian command, owned by the robot.

    Attributes:
        value: pose as 16 column-major floats, or twist as 6 floats (linear [m/s], angular [rad/s], base frame).
        elbow: [position of joint 3 [rad], side of joint 4 (-1, 1)]; None: the robot chooses.
    """

    __slots__ = ("elbow", "value")

    def __init__(self, value: Sequence[float]) -> None:
        self.value, self.elbow = list(value), None  # type: list[float], list[float] | None


class _CartesianHandle(FrankaStateHandle):
    """Handle to the state of the arm and to its Cartesian command."""

    __slots__ = ("_command",)

    def __init__(self, name: str, state: RobotState, command: CartesianCommand) -> None:
        super().__init__(name, state)
        self._command = command

    @property
    def command(self) -> tuple[list[float], list[float] | None]:
        """Present command: (O_T_EE_c or O_dP_EE_c, elbow)."""
        return self._command.value[:], self._command.elbow


class FrankaCartesianPoseHandle(_CartesianHandle):
    """Handle to the state of the arm and to its pose command."""

    __slots__ = ()

    def set_command(self, O_T_EE: Sequence[float], elbow: Sequence[float] | None = None) -> None:
        """Command an end-effector pose in the base frame, 16 column-major floats, and optionally the elbow.

        Raises:
            CommandError: the values are not a pose, or not an elbow; the old command remains.
        """
        check_pose(O_T_EE, f"pose command of {self.name}")
        checked = None if elbow is None else _check_elbow(elbow)
        self._command.value[:], self._command.elbow = O_T_EE, checked


class FrankaCartesianVelocityHandle(_CartesianHandle):
    """Handle to the state of the arm and to its twist command."""

    __slots__ = ()

    def set_command(self, O_dP_EE: Sequence[float], elbow: Sequence[float] | None = None) -> None:
        """Command an end-effector twist in the base frame, linear [m/s] then angular [rad/s], and optionally the elbow.

        Raises:
            CommandError: the twist is not six finite numbers, or the elbow is invalid; the old command remains.
        """
        if len(O_dP_EE) != 6 or not all(math.isfinite(value) for value in O_dP_EE):
            raise CommandError(f"twist command of {self.name} must be six finite numbers; got {list(O_dP_EE)}")
        checked = None if elbow is None else _check_elbow(elbow)
        self._command.value[:], self._command.elbow = O_dP_EE, checked


class _CartesianInterface(_ArmInterface):
    """Cartesian command interface that claims "<arm_id>_robot".

    Attributes:
        initial: value before the first command.
        limits: limits of the arm.
        filtered: True if commands pass a filter, as in libfranka's control loops, before the arm gets them.

    Args:
        limits: limits of the arm; None: those of the Panda.
    """

    claims_resources = True
    initial: ClassVar[Sequence[float]]

    def __init__(
        self, arm_id: str, state: RobotState, limits: FrankaLimits | None = None, filtered: bool = False
    ) -> None:
        super().__init__(arm_id, state)
        self.limits, self.filtered = limits or franka_limits(), filtered
        self.command = CartesianCommand(self.initial)


class FrankaPoseCartesianInterface(_CartesianInterface):
    """Interface to pose commands for "<arm_id>_robot"; claims it."""

    cpp_name = "franka_hw::FrankaPoseCartesianInterface"
    initial = identity16()

    def handle(self, name: str) -> FrankaCartesianPoseHandle:
        """Return the command handle and claim the arm."""
        arm = self._claimed(name)
        return FrankaCartesianPoseHandle(name, arm.state, arm.command)


class FrankaVelocityCartesianInterface(_CartesianInterface):
    """Interface to twist commands for "<arm_id>_robot"; claims it."""

    cpp_name = "franka_hw::FrankaVelocityCartesianInterface"
    initial = (0.0,) * 6

    def handle(self, name: str) -> FrankaCartesianVelocityHandle:
        """Return the command handle and claim the arm."""
        arm = self._claimed(name)
        return FrankaCartesianVelocityHandle(name, arm.state, arm.command)
