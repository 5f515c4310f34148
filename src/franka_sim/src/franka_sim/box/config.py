"""Parameters of the control box and its motion generators; the values are in config/."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from franka_hw_interface.limits import FrankaLimits, franka_limits
from hric_core.parameters import Settings, flag, number, numbers, package_yaml, section, whole
from panda_description import rotor_inertia

Vector = tuple[float, ...]


def read_config(name: str) -> dict[str, Any]:
    """Return the contents of config/<name>.yaml of this package."""
    return package_yaml(__file__, name)


@dataclass(frozen=True)
class CollisionBehavior(Settings):
    """Thresholds of contact (lower) and collision (upper), in the order of libfranka's setCollisionBehavior.

    Attributes:
        *_torque_*: external joint torque, 7 floats [N m].
        *_force_*: external wrench on the stiffness frame, 3 forces [N] and 3 moments [N m].
        *_acceleration: while the desired motion accelerates; *_nominal: otherwise.
    """

    lower_torque_acceleration: Vector = numbers(7, minimum=0.0, unit="N m")
    upper_torque_acceleration: Vector = numbers(7, minimum=0.0, unit="N m")
    lower_torque_nominal: Vector = numbers(7, minimum=0.0, unit="N m")
    upper_torque_nominal: Vector = numbers(7, minimum=0.0, unit="N m")
    lower_force_acceleration: Vector = numbers(6, minimum=0.0, unit="N, N m")
    upper_force_acceleration: Vector = numbers(6, minimum=0.0, unit="N, N m")
    lower_force_nominal: Vector = numbers(6, minimum=0.0, unit="N, N m")
    upper_force_nominal: Vector = numbers(6, minimum=0.0, unit="N, N m")


@dataclass(frozen=True)
class BoxConfig(Settings):
    """Parameters of the emulated control box; those not listed here are explained in config/control_box.yaml.

    Attributes:
        limits: limits of joints and end effector.
        friction: phi1 [N m], phi2 [s/rad], phi3 [rad/s] by joint name, as `panda_description.friction_parameters()`
            returns them: the friction that the box compensates and expects; None: no friction.
        rotor_inertia: 7 floats [kg m^2].
        time_step: control period [s].
        reflexes: True: collisions and violated limits end a motion; False: commands are limited if possible, and only
            NaN ends a motion.
        max_lost_packets: maximum number of consecutive lost packets; None: no limit.
        settings_while_moving: True if load, frames and impedances may be set during a motion; a real arm refuses
            this.
    """

    limits: FrankaLimits = field(default_factory=franka_limits)
    friction: Mapping[str, Mapping[str, float]] | None = None
    rotor_inertia: Vector = numbers(7, minimum=0.0, unit="kg m^2")
    time_step: float = number(above=0.0, unit="s")
    reflexes: bool = flag(True)
    max_lost_packets: int | None = whole(None, minimum=1)
    settings_while_moving: bool = flag(False)
    success_window: int = whole(minimum=1)
    torque_rate_tolerance: float = number(minimum=0.0)
    position_margin: float = number(minimum=0.0, unit="rad")
    start_tolerance: float = number(minimum=0.0, unit="rad")
    external_torque_cutoff: float = number(above=0.0, unit="Hz")
    min_singular_value: float = number(above=0.0, name="least_singular_value")
    self_collision_margin: float = number(minimum=0.0, unit="m")
    reach: Vector = numbers(7, minimum=0.0, unit="m")
    stop_deceleration: float = number(above=0.0)
    collision_behavior: CollisionBehavior = section(CollisionBehavior)

    @classmethod
    def defaults(cls) -> Mapping[str, object]:
        """Return the default values from config/control_box.yaml, and the arm's published rotor inertias."""
        return read_config("control_box") | {"rotor_inertia": rotor_inertia()}


@dataclass(frozen=True)
class MotionParameters(Settings):
    """Parameters of the motion generators; config/motion_generators.yaml has the values and their reasons.

    Attributes:
        velocity_tolerance, acceleration_tolerance, jerk_tolerance: factors; a command above limit times factor is
            refused.
        position_tolerance: allowed excess over the position limits [rad].
        orthonormal_tolerance: tolerance of a commanded rotation matrix.
        singular_value: minimum singular value of the Jacobian at the start of a Cartesian motion.
        ik_tolerance: remaining error of the inverse kinematics [m, rad].
        ik_steps: maximum number of Newton steps per millisecond.
        elbow_return_rate, elbow_min, elbow_damping, elbow_decay: gain [1/s], threshold, damping and rate of decay
            [1/s] for an elbow that is not commanded.
    """

    velocity_tolerance: float = number()
    acceleration_tolerance: float = number()
    jerk_tolerance: float = number()
    position_tolerance: float = number(unit="rad")
    orthonormal_tolerance: float = number()
    singular_value: float = number()
    ik_tolerance: float = number(unit="m, rad")
    ik_steps: int = whole(minimum=1)
    elbow_return_rate: float = number(unit="1/s")
    elbow_min: float = number(name="elbow_least")
    elbow_damping: float = number()
    elbow_decay: float = number(unit="1/s")


@cache
def motion_parameters() -> MotionParameters:
    """Return the parameters of the motion generators from config/motion_generators.yaml.

    Raises:
        ParameterError: the file lacks a parameter or has one that is unknown.
    """
    return MotionParameters.of(read_config("motion_generators"), "franka_sim/config/motion_generators.yaml:")
