"""The arm's state as messages: FrankaState, wrench, and the transforms of the end-effector frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3, Wrench, WrenchStamped
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from franka_hw_interface.robot_state import FIELD_NAMES, RobotState
from franka_msgs.msg import Errors, FrankaState

_PLAIN = tuple(name for name in FIELD_NAMES if name not in ("current_errors", "last_motion_errors", "robot_mode"))


def franka_state(state: RobotState, stamp: Any) -> FrankaState:
    """franka_msgs/FrankaState; state: a snapshot, stamp: genpy.Time."""
    message = FrankaState(header=Header(stamp=stamp), robot_mode=int(state.robot_mode))
    for name in _PLAIN:
        setattr(message, name, getattr(state, name))
    message.current_errors = Errors(**dict.fromkeys(state.current_errors, True))
    message.last_motion_errors = Errors(**dict.fromkeys(state.last_motion_errors, True))
    return message


def external_wrench(K_F_ext_hat_K: Sequence[float], arm_id: str, stamp: Any) -> WrenchStamped:
    """Estimated external wrench on the stiffness frame, expressed in it, 6 floats [N], [N m]."""
    force, torque = K_F_ext_hat_K[:3], K_F_ext_hat_K[3:]
    return WrenchStamped(Header(stamp=stamp, frame_id=f"{arm_id}_K"), Wrench(Vector3(*force), Vector3(*torque)))


def end_effector_frames(F_T_NE: Sequence[float], NE_T_EE: Sequence[float], EE_T_K: Sequence[float], arm_id: str, stamp: Any) -> TFMessage:
    """Flange to nominal end effector, that to the end effector, that to the stiffness frame; each 16 floats, column-major."""
    chain = (("link8", "NE", F_T_NE), ("NE", "EE", NE_T_EE), ("EE", "K", EE_T_K))
    return TFMessage(
        [TransformStamped(Header(stamp=stamp, frame_id=f"{arm_id}_{parent}"), f"{arm_id}_{child}", to_transform(T)) for parent, child, T in chain]
    )


def to_transform(T: Sequence[float]) -> Transform:
    """A column-major transform, 16 floats, as a message."""
    return Transform(Vector3(T[12], T[13], T[14]), Quaternion(*to_quaternion(T)))


def to_quaternion(T: Sequence[float]) -> tuple[float, float, float, float]:
    """Unit quaternion (x, y, z, w) of a column-major transform's rotation, by its largest component, so that none is lost to rounding."""
    r00, r10, r20, _, r01, r11, r21, _, r02, r12, r22 = T[:11]
    diagonal = (1.0 + r00 - r11 - r22, 1.0 - r00 + r11 - r22, 1.0 - r00 - r11 + r22, 1.0 + r00 + r11 + r22)
    rows = (
        (diagonal[0], r10 + r01, r02 + r20, r21 - r12),
        (r10 + r01, diagonal[1], r21 + r12, r02 - r20),
        (r02 + r20, r21 + r12, diagonal[2], r10 - r01),
        (r21 - r12, r02 - r20, r10 - r01, diagonal[3]),
    )
    row = rows[diagonal.index(max(diagonal))]
    norm = math.sqrt(sum(value * value for value in row))
    x, y, z, w = (value / norm for value in row)
    return x, y, z, w
