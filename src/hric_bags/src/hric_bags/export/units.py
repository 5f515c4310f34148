"""Units of message fields, from REP 103 and the comments of the message definitions."""

import re
from collections.abc import Iterable

from hric_perception.sync import paths as sync_units

RADIAN_TO_METRE = {"rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2", "N m": "N", "N m/s": "N/s"}
"""Unit for a revolute joint -> unit for a prismatic one."""
_OWN: dict[str, dict[str, str]] = {
    "geometry_msgs/Pose2D": {"x y": "m", "theta": "rad"},
    "geometry_msgs/Accel": {"linear": "m/s^2", "angular": "rad/s^2"},
    "geometry_msgs/Point": {"x y z": "m"},
    "trajectory_msgs/JointTrajectoryPoint": {
        "positions": "rad",
        "velocities": "rad/s",
        "accelerations": "rad/s^2",
        "effort": "N m",
    },
    "hric_msgs/JointLimitCounts": {"velocity_ratio_max": "1", "position_excess_max": "rad"},
    "hric_msgs/JointReactions": {"positions": "m"},
    "hric_msgs/SyncedSample": {"age": "s"},
    "hric_msgs/ClockPair": {"monotonic": "ns", "real_time_factor": "1"},
    "franka_msgs/FrankaState": {
        "K_F_ext_hat_K O_F_ext_hat_K": "N (first three), N m",
        "O_dP_EE_d O_dP_EE_c": "m/s (first three), rad/s",
        "O_ddP_EE_c": "m/s^2 (first three), rad/s^2",
        "elbow elbow_d elbow_c": "rad, 1",
        "delbow_c": "rad/s, 1",
        "ddelbow_c": "rad/s^2, 1",
        "O_T_EE O_T_EE_d O_T_EE_c F_T_EE F_T_NE NE_T_EE EE_T_K": "1 (column-major; 12 to 14: m)",
        "m_ee m_load m_total": "kg",
        "I_ee I_load I_total": "kg m^2",
        "F_x_Cee F_x_Cload F_x_Ctotal": "m",
        "time": "s",
        "control_command_success_rate": "1",
    },
}
_ALL = {
    **{
        (kind, field): unit
        for kind, fields in _OWN.items()
        for names, unit in fields.items()
        for field in names.split()
    },
    **sync_units.UNITS,
}
UNITS = {(kind.replace("/", "/msg/"), field): unit for (kind, field), unit in _ALL.items()}
"""(message type as in rosbags, field) -> unit of that field and of all fields in it."""
COMMAND_UNITS = {"effort": "N m", "velocity": "rad/s", "position": "rad"}
"""Command interface in the control log -> unit of the command."""
_PRISMATIC = re.compile(r"<joint\s+(?=[^>]*\btype=\"prismatic\")[^>]*\bname=\"([^\"]+)\"")


def prismatic_joints(urdf: str) -> frozenset[str]:
    """Return the names of the prismatic joints of a URDF."""
    return frozenset(_PRISMATIC.findall(urdf))


def of_joint(unit: str, joint: str, prismatic: Iterable[str]) -> str:
    """Return the unit of a joint's value, given the unit for a revolute joint."""
    return RADIAN_TO_METRE.get(unit, unit) if joint in prismatic else unit
