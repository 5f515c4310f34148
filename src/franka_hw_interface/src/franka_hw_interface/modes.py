"""Command modes of the arm: torques, one motion generator, or both together, as in libfranka's control loops."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface, FrankaVelocityCartesianInterface
from hric_control.hardware_interface import EffortJointInterface, PositionJointInterface, VelocityJointInterface
from hric_control.robot_hw import ControllerInfo
from hric_core.errors import HricError, ResourceConflictError


class Kind(Enum):
    """Kind of command: joint torque (effort), or the quantity of a motion generator."""

    EFFORT = "effort"
    POSITION = "position"
    VELOCITY = "velocity"
    POSE = "Cartesian pose"
    TWIST = "Cartesian velocity"


GENERATORS = (Kind.POSITION, Kind.VELOCITY, Kind.POSE, Kind.TWIST)

_BY_INTERFACE = {
    EffortJointInterface.cpp_name: Kind.EFFORT,
    PositionJointInterface.cpp_name: Kind.POSITION,
    VelocityJointInterface.cpp_name: Kind.VELOCITY,
    FrankaPoseCartesianInterface.cpp_name: Kind.POSE,
    FrankaVelocityCartesianInterface.cpp_name: Kind.TWIST,
}


@dataclass(frozen=True)
class ArmMode:
    """Command mode of the arm.

    Attributes:
        torque: True if joint torques are commanded.
        generator: quantity that is commanded to the motion generator; None: no motion generator.
    """

    torque: bool = False
    generator: Kind | None = None

    @property
    def commanded(self) -> bool:
        """True if anything is commanded; otherwise the arm holds its position."""
        return self.torque or self.generator is not None

    @property
    def log_name(self) -> str:
        """Name of the commanded joint quantity in the control log; Cartesian commands alone are logged as "none"."""
        kind = Kind.EFFORT if self.torque else self.generator
        return kind.value if kind in (Kind.EFFORT, Kind.POSITION, Kind.VELOCITY) else "none"

    def __str__(self) -> str:
        parts = (["joint torque"] if self.torque else []) + ([self.generator.value] if self.generator else [])
        return " + ".join(parts) or "hold"


HOLD = ArmMode()


def claimed_mode(controller: ControllerInfo, arm_id: str, joint_names: Sequence[str]) -> ArmMode:
    """Return the command mode that a controller's claims need; HOLD if it does not claim the arm.

    Raises:
        HricError: the controller claims only some joints, or a combination that libfranka does not have; the text gives
            valid claims.
    """
    arm_resources = {*joint_names, f"{arm_id}_robot"}
    kinds = []
    for interface, resources in sorted(controller.claims.items()):
        if not resources & arm_resources:
            continue
        if interface not in _BY_INTERFACE:
            raise HricError(
                f"{controller.name} claims the arm through {interface}; valid: {', '.join(sorted(_BY_INTERFACE))}"
            )
        kinds.append(_BY_INTERFACE[interface])
        missing = (
            [name for name in joint_names if name not in resources] if kinds[-1] not in (Kind.POSE, Kind.TWIST) else []
        )
        if missing:
            some = f"{len(joint_names) - len(missing)} of the arm's {len(joint_names)} joints"
            raise HricError(f"{controller.name} claims {some}; it must claim all of them: missing {', '.join(missing)}")
    generators = [kind for kind in kinds if kind in GENERATORS]
    if len(generators) > 1:
        both = " and ".join(kind.value for kind in generators)
        raise HricError(
            f"{controller.name} claims {both}; the arm takes one motion generator at a time, alone or with "
            "joint torques"
        )
    return ArmMode(Kind.EFFORT in kinds, generators[0] if generators else None)


def claimed_modes(controllers: Sequence[ControllerInfo], arm_id: str, joint_names: Sequence[str]) -> list[ArmMode]:
    """Return the command modes of those controllers that command the arm. Raises HricError for invalid claims."""
    modes = [claimed_mode(controller, arm_id, joint_names) for controller in controllers]
    return [mode for mode in modes if mode.commanded]


def check_one_commander(controllers: Sequence[ControllerInfo], arm_id: str, joint_names: Sequence[str]) -> None:
    """Raise an error if more than one of the controllers would command the arm.

    Raises:
        ResourceConflictError: the message names two such controllers.
        HricError: a controller's claims match no command mode.
    """
    commanding = [
        (controller.name, mode)
        for controller in controllers
        if (mode := claimed_mode(controller, arm_id, joint_names)).commanded
    ]
    if len(commanding) > 1:
        (first, first_mode), (second, second_mode) = commanding[:2]
        raise ResourceConflictError(
            f"{joint_names[0]} to {joint_names[-1]} are claimed by both {first} ({first_mode}) and {second} "
            f"({second_mode})"
        )
