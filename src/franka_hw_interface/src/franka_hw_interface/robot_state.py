"""State of the Franka arm, with the field names of libfranka and franka_msgs/FrankaState."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from enum import IntEnum
from typing import Any

from hric_core.errors import UnknownNameError

ERROR_NAMES: tuple[str, ...] = (
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
    "cartesian_motion_generator_joint_position_limits_violation",
    "cartesian_motion_generator_joint_velocity_limits_violation",
    "cartesian_motion_generator_joint_velocity_discontinuity",
    "cartesian_motion_generator_joint_acceleration_discontinuity",
    "cartesian_position_motion_generator_invalid_frame",
    "force_controller_desired_force_tolerance_violation",
    "controller_torque_discontinuity",
    "start_elbow_sign_inconsistent",
    "communication_constraints_violation",
    "power_limit_violation",
    "joint_p2p_insufficient_torque_for_planning",
    "tau_j_range_violation",
    "instability_detected",
    "joint_move_in_wrong_direction",
    "cartesian_spline_motion_generator_violation",
    "joint_via_motion_generator_planning_joint_limit_violation",
    "base_acceleration_initialization_timeout",
    "base_acceleration_invalid_reading",
)
"""Names of the 41 error flags, in the order of franka_msgs/Errors."""

Errors = frozenset[str]
"""Set of active errors, by libfranka's names."""

NO_ERRORS: Errors = frozenset()


def errors(names: Iterable[str]) -> Errors:
    """Return the error names as a set. Raises UnknownNameError for a name that libfranka does not have."""
    result = frozenset(names)
    for name in sorted(result):
        if name not in ERROR_NAMES:
            raise UnknownNameError("error", name, ERROR_NAMES, "franka_msgs/Errors")
    return result


class RobotMode(IntEnum):
    """Mode of the arm; numbers as in franka_msgs/FrankaState."""

    OTHER = 0
    IDLE = 1
    MOVE = 2
    GUIDING = 3
    REFLEX = 4
    USER_STOPPED = 5
    AUTOMATIC_ERROR_RECOVERY = 6


def _zeros(n: int) -> Callable[[], list[float]]:
    return lambda: [0.0] * n


_zeros_2, _zeros_3, _zeros_6, _zeros_7, _zeros_9 = _zeros(2), _zeros(3), _zeros(6), _zeros(7), _zeros(9)


def identity16() -> list[float]:
    """Return a column-major identity transform, 16 floats."""
    return [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]


@dataclass(slots=True)
class RobotState:
    """State of the arm, owned and written in place by the robot; lists of plain floats, transforms column-major.

    Frames: O base (`<arm_id>_link0`), F flange (`<arm_id>_link8`), NE nominal end effector, EE end effector, K
    stiffness frame. `_d` desired, `_c` commanded, `_hat` estimated. Units: m, rad, N, N m, kg, kg m^2, s.

    To store a state beyond its cycle, or to pass it to another thread, take a `snapshot()`.

    Attributes:
        q, dq: measured joint position [rad] and velocity [rad/s]; q_d, dq_d, ddq_d: desired position, velocity,
            acceleration.
        theta, dtheta: position and velocity on the motor side, seen from the link.
        tau_J: measured link-side torque, gravity included; tau_J_d: desired, without gravity; dtau_J: derivative of
            tau_J [N m/s].
        tau_ext_hat_filtered: external torque; O_F_ext_hat_K, K_F_ext_hat_K: external wrench on K in the base and in the
            stiffness frame.
        joint_contact, joint_collision, cartesian_contact, cartesian_collision: 0, or the contact level that is reached.
        O_T_EE: measured pose; O_T_EE_d, O_T_EE_c, O_dP_EE_d, O_dP_EE_c, O_ddP_EE_c: desired and commanded pose, twist,
            acceleration.
        elbow: position of joint 3 [rad] and side of joint 4 (-1 or +1).
        m_ee, F_x_Cee, I_ee: everything mounted at the flange; m_load, F_x_Cload, I_load: configured payload;
            _total: both. Inertia about the centre of mass, axes of the flange frame, column-major.
        O_ddP_O: gravity in the base frame [m/s^2].
        time: robot time [s].
        tick: number of the control cycle; results computed from the state are valid for one tick. Not part of the ROS
            message.
    """

    tick: int = 0
    cartesian_collision: list[float] = field(default_factory=_zeros_6)
    cartesian_contact: list[float] = field(default_factory=_zeros_6)
    q: list[float] = field(default_factory=_zeros_7)
    q_d: list[float] = field(default_factory=_zeros_7)
    dq: list[float] = field(default_factory=_zeros_7)
    dq_d: list[float] = field(default_factory=_zeros_7)
    ddq_d: list[float] = field(default_factory=_zeros_7)
    theta: list[float] = field(default_factory=_zeros_7)
    dtheta: list[float] = field(default_factory=_zeros_7)
    tau_J: list[float] = field(default_factory=_zeros_7)
    dtau_J: list[float] = field(default_factory=_zeros_7)
    tau_J_d: list[float] = field(default_factory=_zeros_7)
    K_F_ext_hat_K: list[float] = field(default_factory=_zeros_6)
    elbow: list[float] = field(default_factory=_zeros_2)
    elbow_d: list[float] = field(default_factory=_zeros_2)
    elbow_c: list[float] = field(default_factory=_zeros_2)
    delbow_c: list[float] = field(default_factory=_zeros_2)
    ddelbow_c: list[float] = field(default_factory=_zeros_2)
    joint_collision: list[float] = field(default_factory=_zeros_7)
    joint_contact: list[float] = field(default_factory=_zeros_7)
    O_F_ext_hat_K: list[float] = field(default_factory=_zeros_6)
    O_dP_EE_d: list[float] = field(default_factory=_zeros_6)
    O_ddP_O: list[float] = field(default_factory=_zeros_3)
    O_dP_EE_c: list[float] = field(default_factory=_zeros_6)
    O_ddP_EE_c: list[float] = field(default_factory=_zeros_6)
    tau_ext_hat_filtered: list[float] = field(default_factory=_zeros_7)
    m_ee: float = 0.0
    F_x_Cee: list[float] = field(default_factory=_zeros_3)
    I_ee: list[float] = field(default_factory=_zeros_9)
    m_load: float = 0.0
    F_x_Cload: list[float] = field(default_factory=_zeros_3)
    I_load: list[float] = field(default_factory=_zeros_9)
    m_total: float = 0.0
    F_x_Ctotal: list[float] = field(default_factory=_zeros_3)
    I_total: list[float] = field(default_factory=_zeros_9)
    O_T_EE: list[float] = field(default_factory=identity16)
    O_T_EE_d: list[float] = field(default_factory=identity16)
    O_T_EE_c: list[float] = field(default_factory=identity16)
    F_T_EE: list[float] = field(default_factory=identity16)
    F_T_NE: list[float] = field(default_factory=identity16)
    NE_T_EE: list[float] = field(default_factory=identity16)
    EE_T_K: list[float] = field(default_factory=identity16)
    time: float = 0.0
    control_command_success_rate: float = 0.0
    robot_mode: RobotMode = RobotMode.OTHER
    current_errors: Errors = NO_ERRORS
    last_motion_errors: Errors = NO_ERRORS

    @property
    def idle(self) -> bool:
        """True if the arm is ready for a motion."""
        return self.robot_mode is RobotMode.IDLE

    @property
    def moving(self) -> bool:
        """True while a motion runs."""
        return self.robot_mode is RobotMode.MOVE

    def snapshot(self) -> "RobotState":
        """Return a copy that later cycles do not change; fields computed on demand are computed now."""
        values = {name: getattr(self, name) for name in FIELD_NAMES}
        copies: dict[str, Any] = {
            name: value[:] if isinstance(value, list) else value for name, value in values.items()
        }
        return RobotState(tick=self.tick, **copies)


FIELD_NAMES: tuple[str, ...] = tuple(item.name for item in fields(RobotState) if item.name != "tick")
"""Names of the fields in franka_msgs/FrankaState, without the header."""


def lazy_field(name: str, compute: Callable[[Any], Any]) -> Any:
    """Return a property for a subclass of RobotState that computes a field when it is read, at most once per cycle.

    The subclass must set its attribute `computed_at: dict[str, int]` before it calls `super().__init__()`.

    Args:
        name: field of RobotState.
        compute: function from the state to the value.
    """
    if name not in FIELD_NAMES:
        raise UnknownNameError("field", name, FIELD_NAMES, "RobotState")
    slot = RobotState.__dict__[name]

    def get(state: Any) -> Any:
        if state.computed_at.get(name) != state.tick:
            slot.__set__(state, compute(state))
            state.computed_at[name] = state.tick
        return slot.__get__(state)

    def set_(state: Any, value: Any) -> None:
        slot.__set__(state, value)
        state.computed_at[name] = state.tick

    return property(get, set_, doc=f"{name}, computed when read")
