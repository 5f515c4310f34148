"""Rotations, poses and inertias.

Names say the frames: `R_a_b` turns coordinates of frame b into those of frame a, `T_a_b` is the pose of b in a, so
T_a_c = T_a_b T_b_c. `transforms` works on numpy matrices. `quaternions` and `poses` work on plain floats, for the
control loop: for so few numbers numpy is slower. Quaternions are x, y, z, w as in ROS; those computed from a numpy
matrix have w >= 0. Roll, pitch, yaw are defined as in URDF. Lengths are in metres, angles in radians.

Import the types, constants and most common functions from here, everything else from the modules.
"""

from hric_core.geometry.inertia import MassProperties, judge, steiner_term, tensor
from hric_core.geometry.poses import ORIGIN, UP_AXES, Pose, Track, compose, minimum_jerk, pose_of_transform, transformed
from hric_core.geometry.quaternions import IDENTITY, Quaternion, Vector, from_rotation_vector, normalized
from hric_core.geometry.transforms import FloatArray, homogeneous, quaternion_from_rotation, transform_from_rpy

__all__ = [
    "IDENTITY",
    "ORIGIN",
    "UP_AXES",
    "FloatArray",
    "MassProperties",
    "Pose",
    "Quaternion",
    "Track",
    "Vector",
    "compose",
    "from_rotation_vector",
    "homogeneous",
    "judge",
    "minimum_jerk",
    "normalized",
    "pose_of_transform",
    "quaternion_from_rotation",
    "steiner_term",
    "tensor",
    "transform_from_rpy",
    "transformed",
]
