"""Tolerances of the motion generators, read from config/motion_generators.yaml."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from franka_sim.box.config import read_config
from hric_control.errors import ParameterError


@dataclass(frozen=True, slots=True)
class MotionParameters:
    """The numbers of config/motion_generators.yaml, where their reasons stand.

    Attributes:
        velocity_tolerance, acceleration_tolerance, jerk_tolerance: factors on the limits.
        position_tolerance: [rad].
        orthonormal_tolerance: of a commanded rotation matrix.
        singular_value: least singular value of the Jacobian at the start of a Cartesian motion.
        ik_tolerance: remaining error of the inverse kinematics [m, rad].
        ik_steps: Newton steps per millisecond at most.
        elbow_return_rate: [1/s]; elbow_least, elbow_damping: of the elbow that is not commanded.
    """

    velocity_tolerance: float
    acceleration_tolerance: float
    jerk_tolerance: float
    position_tolerance: float
    orthonormal_tolerance: float
    singular_value: float
    ik_tolerance: float
    ik_steps: int
    elbow_return_rate: float
    elbow_least: float
    elbow_damping: float


@cache
def motion_parameters() -> MotionParameters:
    """The parameters.

    Raises:
        ParameterError: the file does not hold exactly these parameters.
    """
    try:
        return MotionParameters(**read_config("motion_generators"))
    except TypeError as error:
        raise ParameterError(f"franka_sim: config/motion_generators.yaml: {error}") from None
