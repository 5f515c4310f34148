"""Conversion of joint and arm states to messages.

Joints: JointState, JointTrajectoryControllerState and the action's feedback, which has the same fields. Arm:
FrankaState, wrench, transforms of the end-effector frames.
"""

from collections.abc import Sequence
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from franka_hw_interface.robot_state import FIELD_NAMES, RobotState
from franka_msgs.msg import Errors, FrankaState
from hric_core.geometry import Pose, stamped

_PLAIN = tuple(name for name in FIELD_NAMES if name not in ("current_errors", "last_motion_errors", "robot_mode"))

Point = tuple[Sequence[float], Sequence[float], Sequence[float], Sequence[float]]
"""Positions [rad or m], velocities, accelerations, efforts [N m or N]; empty if not available."""


def franka_state(state: RobotState, stamp: Any) -> FrankaState:
    """Return a franka_msgs/FrankaState; state: a snapshot, stamp: genpy.Time."""
    message = FrankaState(header=Header(stamp=stamp), robot_mode=int(state.robot_mode))
    for name in _PLAIN:
        setattr(message, name, getattr(state, name))
    message.current_errors = Errors(**dict.fromkeys(state.current_errors, True))
    message.last_motion_errors = Errors(**dict.fromkeys(state.last_motion_errors, True))
    return message


def external_wrench(K_F_ext_hat_K: Sequence[float], arm_id: str, stamp: Any) -> Any:
    """Return the estimated external wrench on the stiffness frame, expressed in it, 6 floats [N], [N m]."""
    return stamped.wrench_stamped(stamped.header(stamp, f"{arm_id}_K"), K_F_ext_hat_K)


def end_effector_frames(
    F_T_NE: Sequence[float], NE_T_EE: Sequence[float], EE_T_K: Sequence[float], arm_id: str, stamp: Any
) -> TFMessage:
    """Return the transforms flange to NE to EE to stiffness frame; arguments: 16 column-major floats each."""
    chain = (("link8", "NE", F_T_NE), ("NE", "EE", NE_T_EE), ("EE", "K", EE_T_K))
    return TFMessage(
        [
            stamped.transform_stamped(
                stamped.header(stamp, f"{arm_id}_{parent}"), f"{arm_id}_{child}", Pose.of_column_major(T)
            )
            for parent, child, T in chain
        ]
    )


def joint_state(
    stamp: Any, names: list[str], position: list[float], velocity: list[float], effort: list[float]
) -> JointState:
    """Return a sensor_msgs/JointState; stamp: genpy.Time, other arguments as in the message."""
    message = JointState()
    message.header.stamp, message.name = stamp, names
    message.position, message.velocity, message.effort = position, velocity, effort
    return message


def build_state(message_type: Any, stamp: Any, joints: Sequence[str], desired: Point, actual: Point) -> Any:
    """Return the state message; error = desired - actual in position and velocity.

    Args:
        message_type: JointTrajectoryControllerState or FollowJointTrajectoryFeedback.
        stamp: time of measurement (genpy.Time).
        joints: joint names.
        desired: n values in each part that is not empty.
        actual: likewise.
    """
    # Fields are set one by one: constructors with arguments check all of them and take four times as long.
    message = message_type()
    message.header.stamp = stamp
    message.joint_names = list(joints)
    _fill(message.desired, desired)
    _fill(message.actual, actual)
    message.error.positions = [d - a for d, a in zip(desired[0], actual[0], strict=True)]
    message.error.velocities = [d - a for d, a in zip(desired[1], actual[1], strict=True)]
    return message


def _fill(point: Any, values: Point) -> None:
    point.positions, point.velocities, point.accelerations, point.effort = values
