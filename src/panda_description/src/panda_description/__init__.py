"""Franka Panda: URDF from xacro, identified dynamics, friction and limits with their sources."""

from panda_description.description import DescriptionArgument, arguments, load, load_file, process_xacro
from panda_description.inertial_sets import inertials
from panda_description.parameters import (
    CartesianLimit,
    JointLimit,
    cartesian_limits,
    config,
    friction_parameters,
    ignored_pairs,
    joint_limit_parameters,
    joint_limits,
    rotor_inertia,
)

__all__ = [
    "CartesianLimit",
    "DescriptionArgument",
    "JointLimit",
    "arguments",
    "cartesian_limits",
    "config",
    "friction_parameters",
    "ignored_pairs",
    "inertials",
    "joint_limit_parameters",
    "joint_limits",
    "load",
    "load_file",
    "process_xacro",
    "rotor_inertia",
]
