"""Units of the fields of common messages, by REP 103 and the definitions' own comments. A source's YAML may say otherwise. No ROS."""

from __future__ import annotations

_JOINTS = {"position": "rad", "velocity": "rad/s", "effort": "N m"}
_FRANKA = {
    **dict.fromkeys(("q", "q_d", "theta"), "rad"),
    **dict.fromkeys(("dq", "dq_d", "dtheta"), "rad/s"),
    **dict.fromkeys(("tau_J", "tau_J_d", "tau_ext_hat_filtered"), "N m"),
    "ddq_d": "rad/s^2",
    "dtau_J": "N m/s",
}

UNITS: dict[tuple[str, str], str] = {
    **{("sensor_msgs/JointState", field): unit for field, unit in _JOINTS.items()},
    **{("hric_msgs/ControlLog", field): unit for field, unit in _JOINTS.items()},
    **{("franka_msgs/FrankaState", field): unit for field, unit in _FRANKA.items()},
    ("geometry_msgs/Pose", "position"): "m",
    ("geometry_msgs/Pose", "orientation"): "1",
    ("geometry_msgs/Transform", "translation"): "m",
    ("geometry_msgs/Transform", "rotation"): "1",
    ("geometry_msgs/PointStamped", "point"): "m",
    ("geometry_msgs/Wrench", "force"): "N",
    ("geometry_msgs/Wrench", "torque"): "N m",
    ("geometry_msgs/Twist", "linear"): "m/s",
    ("geometry_msgs/Twist", "angular"): "rad/s",
    ("sensor_msgs/Imu", "orientation"): "1",
    ("sensor_msgs/Imu", "angular_velocity"): "rad/s",
    ("sensor_msgs/Imu", "linear_acceleration"): "m/s^2",
    ("hric_msgs/MocapData", "labelled_markers"): "m",
    ("hric_msgs/MocapData", "marker_sizes"): "m",
    ("hric_msgs/MocapData", "latency"): "s",
    ("hric_msgs/RigidBodyState", "mean_error"): "m",
}
"""(type of the message, field) -> unit of the field and of all numbers below it, unless a type in between says otherwise."""
