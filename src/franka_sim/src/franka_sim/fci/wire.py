"""Byte layout of the Franka Control Interface: framing of requests, state datagram, command datagram.

Little endian, packed, column-major. The layouts are those of libfranka's public headers (libfranka-common e6aa0fc for
protocol 5, d96c221 for protocol 10).
"""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter
from typing import Any

from franka_sim.box.requests import MotionCommand

MAX_FLOAT32 = 3.4028234663852886e38

WIRE_ERRORS: tuple[str, ...] = (
    "joint_position_limits_violation",
    "cartesian_position_limits_violation",
    "self_collision_avoidance_violation",
    "joint_velocity_violation",
    "cartesian_velocity_violation",
    "force_control_safety_violation",
    "joint_reflex",
    "cartesian_reflex",
    "max_goal_pose_deviation_violation",
    "max_path_pose_deviation_violation",
    "cartesian_velocity_profile_safety_violation",
    "joint_position_motion_generator_start_pose_invalid",
    "joint_motion_generator_position_limits_violation",
    "joint_motion_generator_velocity_limits_violation",
    "joint_motion_generator_velocity_discontinuity",
    "joint_motion_generator_acceleration_discontinuity",
    "cartesian_position_motion_generator_start_pose_invalid",
    "cartesian_motion_generator_elbow_limit_violation",
    "cartesian_motion_generator_velocity_limits_violation",
    "cartesian_motion_generator_velocity_discontinuity",
    "cartesian_motion_generator_acceleration_discontinuity",
    "cartesian_motion_generator_elbow_sign_inconsistent",
    "cartesian_motion_generator_start_elbow_invalid",
    "force_controller_desired_force_tolerance_violation",
    "start_elbow_sign_inconsistent",
    "communication_constraints_violation",
    "power_limit_violation",
    "cartesian_motion_generator_joint_position_limits_violation",
    "cartesian_motion_generator_joint_velocity_limits_violation",
    "cartesian_motion_generator_joint_velocity_discontinuity",
    "cartesian_motion_generator_joint_acceleration_discontinuity",
    "cartesian_position_motion_generator_invalid_frame",
    "controller_torque_discontinuity",
    "joint_p2p_insufficient_torque_for_planning",
    "tau_j_range_violation",
    "instability_detected",
    "joint_move_in_wrong_direction",
    "cartesian_spline_motion_generator_violation",
    "joint_via_motion_generator_planning_joint_limit_violation",
    "base_acceleration_initialization_timeout",
    "base_acceleration_invalid_reading",
)
"""Names of the 41 errors in the order of their bytes in the datagram (franka_msgs/Errors has another order)."""

_BEFORE_EE = ("O_T_EE", "O_T_EE_d", "F_T_EE", "EE_T_K", "F_T_NE", "NE_T_EE")
_EE = ("I_ee", "F_x_Cee")
_AFTER_LOAD = (
    *("I_load", "F_x_Cload", "elbow", "elbow_d", "tau_J", "tau_J_d", "dtau_J", "q", "q_d", "dq", "dq_d", "ddq_d"),
    *("joint_contact", "cartesian_contact", "joint_collision", "cartesian_collision"),
    *("tau_ext_hat_filtered", "O_F_ext_hat_K", "K_F_ext_hat_K", "O_dP_EE_d", "O_ddP_O"),
    *("elbow_c", "delbow_c", "ddelbow_c", "O_T_EE_c", "O_dP_EE_c", "O_ddP_EE_c", "theta", "dtheta"),
)
FLOATS = 284
"""Count of numbers in the state datagram before the modes, without accelerometers."""
ACCELEROMETERS = 36
"""Count of accelerometer values in protocol 10: 6 sensors at top and bottom, 3 axes each [m/s^2]."""


def error_bytes(names: Iterable[str]) -> bytes:
    """Return the 41 error bytes of a state datagram, 1 for each of the given error names and else 0."""
    active = frozenset(names)
    return bytes(name in active for name in WIRE_ERRORS)


class StateCodec:
    """Codec of the state datagram: 2373 bytes in protocol 5 (64-bit numbers), 1377 in protocol 10 (32-bit).

    Args:
        real: format character of one number in `struct`: "d" (64 bits) or "f" (32 bits).
        accelerometers: True if the datagram has the two accelerometer blocks (protocol 10).

    Attributes:
        names: numeric fields in the order of the datagram.
        accelerometers: fields of the accelerometers, which follow `names`; empty: the datagram has none.
        size: size of the datagram [bytes].
    """

    names = (*_BEFORE_EE, "m_ee", *_EE, "m_load", *_AFTER_LOAD)

    def __init__(self, real: str, accelerometers: bool) -> None:
        extra = ACCELEROMETERS if accelerometers else 0
        self._struct = struct.Struct(f"<Q{FLOATS + extra}{real}BB41s41sB{real}")
        self._head, self._tail = struct.Struct("<Q"), struct.Struct(f"<BB41s41sB{real}")
        self.size = self._struct.size
        self.real, self._extra = real, [0.0] * extra
        self.accelerometers = ("accelerometer_top", "accelerometer_bottom") if accelerometers else ()
        self._before_ee, self._ee, self._after_load = (
            attrgetter(*_BEFORE_EE),
            attrgetter(*_EE),
            attrgetter(*_AFTER_LOAD),
        )
        self._errors: dict[frozenset[str], bytes] = {}

    def encode(self, message_id: int, state: Any) -> bytes:
        """Return the datagram of a robot state without accelerometers: their fields are zero.

        Args:
            message_id: robot time [ms].
            state: a RobotState with `generator_mode` and `controller_mode`.
        """
        flat = chain.from_iterable
        numbers = [
            *flat(self._before_ee(state)),
            state.m_ee,
            *flat(self._ee(state)),
            state.m_load,
            *flat(self._after_load(state)),
        ]
        tail = self._modes(state)
        try:
            return self._struct.pack(message_id, *numbers, *self._extra, *tail)
        except OverflowError:  # an unstable arm must not stop the server
            numbers = [min(max(number, -MAX_FLOAT32), MAX_FLOAT32) for number in numbers]
            return self._struct.pack(message_id, *numbers, *self._extra, *tail)

    def join(self, message_id: int, numbers: bytes, state: Any) -> bytes:
        """Return the datagram of a robot state.

        Args:
            message_id: robot time [ms].
            numbers: packed fields `names` and `accelerometers`, little endian.
            state: state whose modes, errors and success rate follow the numbers.
        """
        return self._head.pack(message_id) + numbers + self._tail.pack(*self._modes(state))

    def _modes(self, state: Any) -> tuple[int, int, bytes, bytes, int, float]:
        """Return modes, errors and success rate, which follow the numbers in the datagram."""
        return (
            state.generator_mode,
            state.controller_mode,
            self._flags(state.current_errors),
            self._flags(state.last_motion_errors),
            state.robot_mode,
            state.control_command_success_rate,
        )

    def _flags(self, names: frozenset[str]) -> bytes:
        flags = self._errors.get(names)
        if flags is None:
            flags = self._errors[names] = error_bytes(names)
        return flags


class CommandCodec:
    """Codec of the command datagram: 370 bytes, or 371 with the flag that torque control ends (protocol 7 and later).

    Numbers always have 64 bits. torque_flag: True if the datagram has that flag.
    """

    def __init__(self, torque_flag: bool) -> None:
        self._struct = struct.Struct("<Q38dBB7dB" if torque_flag else "<Q38dBB7d")
        self.size = self._struct.size
        self._torque_flag = torque_flag

    def decode(self, datagram: bytes) -> tuple[int, MotionCommand]:
        """Decode a datagram; return the message_id of the state to which it refers, and the command."""
        values = self._struct.unpack(datagram)
        elbow = (values[37], values[38]) if values[39] else None
        finished = bool(values[40]) or (self._torque_flag and bool(values[48]))
        q, dq, pose, twist = list(values[1:8]), list(values[8:15]), list(values[15:31]), list(values[31:37])
        return values[0], MotionCommand(q, dq, pose, twist, elbow, list(values[41:48]), finished)

    def encode(self, message_id: int, command: MotionCommand) -> bytes:
        """Return the datagram of a client's command."""
        elbow = command.elbow or (0.0, 0.0)
        numbers = (*command.q, *command.dq, *command.O_T_EE, *command.O_dP_EE, *elbow)
        flags = (command.elbow is not None, command.finished)
        tail = (command.finished,) if self._torque_flag else ()
        return self._struct.pack(message_id, *numbers, *flags, *command.tau, *tail)


@dataclass(frozen=True)
class Framing:
    """Byte layout of requests and responses on TCP.

    Attributes:
        header: request id, the client's sequence number, size of the complete message.
        status: first part of every response's payload.
    """

    header: struct.Struct
    status: struct.Struct

    def frame(self, command: int, command_id: int, payload: bytes) -> bytes:
        """Return a complete message: header and payload; command: request id, command_id: sequence number."""
        return self.header.pack(command, command_id, self.header.size + len(payload)) + payload


ARM_FRAMING = Framing(struct.Struct("<III"), struct.Struct("<B"))
HAND_FRAMING = Framing(struct.Struct("<HII"), struct.Struct("<H"))
CONNECT = 0
"""Id of the Connect request, in all services."""
CONNECT_PAYLOAD = struct.Struct("<HH")
"""Layout of a Connect request: protocol version and UDP port of the client."""
VERSION = struct.Struct("<H")
"""Layout of the server's protocol version, after the status in the response to Connect."""
