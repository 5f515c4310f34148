"""Conversion of joint and arm states to messages.

For joints: JointState, JointTrajectoryControllerState and FollowJointTrajectoryFeedback (which has equal fields). For
the arm: FrankaState, its external wrench, and the transforms of the end-effector frames.
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import Any

import genpy
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from franka_hw_interface.robot_state import FIELD_NAMES, RobotState
from franka_msgs.msg import Errors, FrankaState
from hric_core.geometry import Pose, stamped

_PLAIN = tuple(name for name in FIELD_NAMES if name not in ("current_errors", "last_motion_errors", "robot_mode"))
_plain_fields = attrgetter(*_PLAIN)
_new: Any = object.__new__

Point = tuple[Sequence[float], Sequence[float], Sequence[float], Sequence[float]]
"""State of n joints: positions [rad or m], velocities, accelerations, efforts [N m or N]; empty if not available."""


def franka_state(state: RobotState, stamp: Any) -> FrankaState:
    """Return a franka_msgs/FrankaState; state: snapshot of the arm's state, stamp: its time (genpy.Time)."""
    message: FrankaState = _new(FrankaState)
    message.header, message.robot_mode = stamped.header(stamp, ""), int(state.robot_mode)
    for name, value in zip(_PLAIN, _plain_fields(state), strict=True):
        setattr(message, name, value)
    message.current_errors = Errors(**dict.fromkeys(state.current_errors, True))
    message.last_motion_errors = Errors(**dict.fromkeys(state.last_motion_errors, True))
    return message


def external_wrench(K_F_ext_hat_K: Sequence[float], arm_id: str, stamp: Any) -> Any:
    """Return the estimated external wrench on the stiffness frame K as a geometry_msgs/WrenchStamped.

    Args:
        K_F_ext_hat_K: wrench in axes of K, 6 floats [N], [N m].
        arm_id: name of the arm.
        stamp: time of the wrench (genpy.Time).
    """
    return stamped.wrench_stamped(stamped.header(stamp, f"{arm_id}_K"), K_F_ext_hat_K)


def end_effector_frames(
    F_T_NE: Sequence[float], NE_T_EE: Sequence[float], EE_T_K: Sequence[float], arm_id: str, stamp: Any
) -> TFMessage:
    """Return the transforms from flange to nominal end effector NE, on to end effector EE, and on to stiffness frame K.

    The transforms are 16 column-major floats each; arm_id: name of the arm, stamp: time (genpy.Time).
    """
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
    """Return a sensor_msgs/JointState; stamp: time (genpy.Time), other arguments: fields of the message."""
    message: JointState = _new(JointState)
    message.header, message.name = stamped.header(stamp, ""), names
    message.position, message.velocity, message.effort = position, velocity, effort
    return message


def build_state(message_type: Any, stamp: Any, joints: Sequence[str], desired: Point, actual: Point) -> Any:
    """Return a message with the desired and actual states of n joints, and their differences as the errors.

    The errors are desired minus actual positions and velocities.

    Args:
        message_type: JointTrajectoryControllerState or FollowJointTrajectoryFeedback.
        stamp: time of measurement (genpy.Time).
        joints: joint names.
        desired: desired state; positions and velocities are not empty.
        actual: measured state; positions and velocities are not empty.
    """
    # Fields are set one by one: constructors check and fill all of them, and take four times as long.
    message = _new(message_type)
    message.header, message.joint_names = stamped.header(stamp, ""), list(joints)
    message.desired, message.actual = _point(desired), _point(actual)
    positions = [d - a for d, a in zip(desired[0], actual[0], strict=True)]
    velocities = [d - a for d, a in zip(desired[1], actual[1], strict=True)]
    message.error = _point((positions, velocities, [], []))
    return message


def _point(values: Point) -> JointTrajectoryPoint:
    point: JointTrajectoryPoint = _new(JointTrajectoryPoint)
    point.positions, point.velocities, point.accelerations, point.effort = values
    point.time_from_start = genpy.Duration()
    return point
