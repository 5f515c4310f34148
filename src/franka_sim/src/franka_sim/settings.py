"""Parameters of the simulated Franka arm and its control box, read from the ROS parameter server."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, TypeVar

from franka_hw_interface.arm_parameters import ARM_ID, collision_config, read_arm_id
from franka_hw_interface.arm_services import CollisionThresholds
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import FrankaLimits, franka_limits
from franka_sim.box.config import BoxConfig, CollisionBehavior
from franka_sim.box.internal_impedance import JointImpedanceLaw, defaults
from franka_sim.realism import IDEAL, JOINTS, Realism, parse
from hric_control.limits import ENFORCE_LIMITS
from hric_control.plants import DEFAULT_PLANT, GRAVITY, rotor_inertia
from hric_control.sim.sim_loop import REAL_TIME_FACTOR
from hric_core.errors import CommandError, DescriptionError, ParameterError, UnknownNameError
from hric_core.node import Node
from hric_core.parameters import Settings, anything, flag, mapping, number, numbers, per_joint, section, text
from hric_core.urdf import read as read_urdf

Q_START = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)
"""Joint positions of Franka's usual ready pose [rad]."""


@dataclass(frozen=True)
class InternalImpedance(Settings):
    """Joint stiffness of the control box while the arm follows positions or velocities, or holds its position."""

    stiffness: tuple[float, ...] = numbers(
        7, unit="N m/rad", text="stiffness of the internal joint impedance; the damping goes with its root"
    )

    @classmethod
    def defaults(cls) -> Mapping[str, object]:
        """Return the default values, from config/internal_impedance.yaml."""
        return defaults()


@dataclass(frozen=True)
class BoxSettings(Settings):
    """Parameters of plant and control box that the simulated arm and the node emulated_arm share."""

    arm_id: str = ARM_ID
    plant_type: str = text(DEFAULT_PLANT, text="plugin of base `hric_control::Plant`")
    plant: Mapping[str, object] = mapping(
        default={},
        text="handed to the plant; `friction: identified` gets panda_description's values; `gravity` is also that of "
        "the arm's model; `rotor_inertia` (the description's if absent) also bounds the internal impedance",
    )
    realism: Any = anything(
        IDEAL,
        text="`ideal`, `measured`, or a map: `preset`, and values of `config/realism.yaml` in place of the preset's. "
        "Noise by `plant/seed`; `friction` of the preset where `plant/friction` is absent",
    )
    q_start: tuple[float, ...] = per_joint(
        number(unit="rad"),
        Q_START,
        others=Q_START,
        default_text="`[0, -pi/4, 0, -3pi/4, 0, pi/2, pi/4]`",
        text="start pose; a joint outside its range is allowed, with a warning",
    )
    internal_impedance: InternalImpedance = section(InternalImpedance)
    reflexes: bool = flag(
        True,
        text="`true`: the arm protects itself; `false`: commands are limited where possible, and only NaN ends "
        "a motion",
    )

    def box(
        self, plant: Mapping[str, object], rotors: Mapping[str, float], time_step: float, realism: Realism
    ) -> BoxConfig:
        """Return the parameters of the control box, with the friction it compensates.

        Args:
            plant: parameters of the plant.
            rotors: rotor inertia of the plant's joints by name [kg m^2].
            time_step: control period [s].
            realism: sensor noise, and differences between the arm and the box's model of it.
        """
        return BoxConfig(
            friction=realism.known_friction(plant, list(rotors)),
            rotor_inertia=tuple(rotors.values()),
            time_step=time_step,
            reflexes=self.reflexes,
        )


AnyBoxSettings = TypeVar("AnyBoxSettings", bound=BoxSettings)


@dataclass(frozen=True)
class SimulatedArmSettings(BoxSettings):
    """Parameters of the simulated arm that is commanded by ROS controllers (FrankaHWSim)."""

    real_time_factor: float = REAL_TIME_FACTOR
    enforce_limits: tuple[str, ...] = ENFORCE_LIMITS
    rate_limiting: bool = flag(
        True,
        text="smooth joint positions and velocities to the limits of acceleration and jerk, as libfranka's loops do",
    )
    collision_config: CollisionThresholds | None = collision_config(False, "`config/control_box.yaml`")
    settings_while_moving: bool = flag(
        False, text="take load, frames and impedances while a motion runs, which the arm refuses"
    )

    @property
    def rate_limits(self) -> FrankaLimits | None:
        """Limits of libfranka's control loops for joint positions and velocities; None if `rate_limiting` is false."""
        return franka_limits().with_margins() if self.rate_limiting else None

    def box(
        self, plant: Mapping[str, object], rotors: Mapping[str, float], time_step: float, realism: Realism
    ) -> BoxConfig:
        """Return the parameters of the control box, with `settings_while_moving` and `collision_config`."""
        config, thresholds = super().box(plant, rotors, time_step, realism), self.collision_config
        config = replace(config, settings_while_moving=self.settings_while_moving)
        if thresholds is None:
            return config
        return replace(config, collision_behavior=CollisionBehavior(*astuple(thresholds)))


def joint_names(arm_id: str) -> tuple[str, ...]:
    """Return the names of a Franka arm's joints; `arm_id`: their prefix."""
    return tuple(f"{arm_id}_joint{i}" for i in range(1, JOINTS + 1))


def read(node: Node, kind: type[AnyBoxSettings]) -> tuple[AnyBoxSettings, Realism]:
    """Read the parameters of a node; return them, and the realism that they select. Raises ParameterError."""
    settings = kind.read(node, joint_names(read_arm_id(node)))
    return settings, parse(settings.realism, node.resolve("realism"))


def make_model(node: Node, urdf_xml: str, arm_id: str, plant: Mapping[str, object]) -> KdlFrankaModel:
    """Return the control box's model of the arm, with the gravity of the plant, as a real arm measures it.

    Args:
        node: private namespace of the robot, for error messages.
        urdf_xml: robot description.
        arm_id: prefix of joints and links.
        plant: parameters of the plant; `gravity` in the world frame [m/s^2].

    Raises:
        ParameterError, DescriptionError: gravity or arm_id is wrong, or the joints are not those of a Franka arm.
    """
    gravity = GRAVITY.checked(plant.get("gravity", GRAVITY), node.resolve("plant/gravity"))
    try:
        model = KdlFrankaModel(urdf_xml, arm_id, gravity_world=gravity)
    except UnknownNameError as error:
        raise ParameterError(f"{node.resolve('arm_id')} is {arm_id!r}, but {error}") from None
    expected = joint_names(arm_id)
    if model.joint_names != expected:
        raise DescriptionError(
            f"the joints of the robot description are {', '.join(model.joint_names)}; those of a Franka arm with "
            f"arm_id {arm_id} are {', '.join(expected)}"
        )
    return model


def rotors_of(urdf_xml: str, joint_names: Sequence[str], plant: Mapping[str, object]) -> dict[str, float]:
    """Return the rotor inertia of joints by name [kg m^2]. Raises ParameterError.

    Args:
        urdf_xml: robot description.
        joint_names: the actuated joints.
        plant: parameters of the plant; `rotor_inertia` has priority over the description.
    """
    return dict(zip(joint_names, rotor_inertia(plant, joint_names, read_urdf(urdf_xml)), strict=True))


def set_internal_impedance(node: Node, stiffness: Sequence[float], law: JointImpedanceLaw) -> None:
    """Set the stiffness of the internal joint impedance [N m/rad]; log the gains if stability requires lower ones."""
    requested = list(stiffness)
    try:
        law.set_stiffness(requested)
    except CommandError as error:
        raise ParameterError(f"{node.resolve('internal_impedance/stiffness')}: {error}") from None
    if law.stiffness != requested:
        lowered = ", ".join(f"{k:.0f}/{d:.1f}" for k, d in zip(law.stiffness, law.damping, strict=True))
        node.log_info(
            "internal impedance: gains lowered to those that are stable with this time step and rotor inertia; "
            f"stiffness/damping per joint [N m/rad]/[N m s/rad]: {lowered}"
        )
