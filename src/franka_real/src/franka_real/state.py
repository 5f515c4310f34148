"""State of a real arm as a RobotState: q, dq and tau_J are copied each cycle, other fields when they are read."""

import json
from collections.abc import Sequence
from typing import Any

from franka_hw_interface.robot_state import (
    ERROR_NAMES,
    FIELD_NAMES,
    NO_ERRORS,
    Errors,
    RobotMode,
    RobotState,
    identity16,
    lazy_field,
)
from franka_hw_interface.transforms import column_major, from_column_major
from hric_control.hardware_interface import JointStates
from hric_core.geometry.transforms import inverse

OWN_FIELDS = frozenset(
    {"time", "q", "dq", "tau_J", "robot_mode", "current_errors", "last_motion_errors", "F_T_NE", "NE_T_EE", "O_ddP_O"}
)
"""Fields that are not simply copied from the attribute of the same name in libfranka's state."""

GRAVITY = [0.0, 0.0, -9.81]
"""Gravity in the base frame (O_ddP_O) of an upright arm [m/s^2], for the Panda, whose binding does not report it."""


def read_errors(flags: Any) -> Errors:
    """Return the active errors of a libfranka error object, from its text.

    The text has all active errors by name in both bindings, but not all of them are attributes.
    """
    text = str(flags)
    return NO_ERRORS if len(text) <= 2 else frozenset(json.loads(text)) & frozenset(ERROR_NAMES)


def read_mode(mode: Any) -> RobotMode:
    """Return the robot mode; libfranka's enumeration has the same numbers as franka_msgs/FrankaState."""
    return RobotMode(int(mode))


def _taken(name: str) -> Any:
    def compute(state: Any) -> Any:
        value = getattr(state.raw, name)
        return list(value) if isinstance(value, list | tuple) else value

    return lazy_field(name, compute)


def _F_T_NE(state: Any) -> list[float]:
    if hasattr(state.raw, "F_T_NE"):
        return list(state.raw.F_T_NE)
    F_T_EE, NE_T_EE = map(from_column_major, (state.raw.F_T_EE, state.set_NE_T_EE))
    return column_major(F_T_EE @ inverse(NE_T_EE))


class LibfrankaState(RobotState):
    """Franka state of a real arm; q, dq and tau_J are the same list objects as in the joint states.

    The Panda's binding lacks F_T_NE, NE_T_EE and O_ddP_O: NE_T_EE is the last one set (initially the identity), F_T_NE
    follows from F_T_EE, and gravity is that of an upright arm.

    Attributes:
        joints: joint states.
        raw: libfranka's state of this cycle.
        set_NE_T_EE: argument of the last `set_EE_frame`, 16 floats column-major.
    """

    __slots__ = ("computed_at", "joints", "raw", "set_NE_T_EE")

    robot_mode = lazy_field("robot_mode", lambda state: read_mode(state.raw.robot_mode))
    current_errors = lazy_field("current_errors", lambda state: read_errors(state.raw.current_errors))
    last_motion_errors = lazy_field("last_motion_errors", lambda state: read_errors(state.raw.last_motion_errors))
    F_T_NE = lazy_field("F_T_NE", _F_T_NE)
    NE_T_EE = lazy_field("NE_T_EE", lambda state: list(getattr(state.raw, "NE_T_EE", state.set_NE_T_EE)))
    O_ddP_O = lazy_field("O_ddP_O", lambda state: list(getattr(state.raw, "O_ddP_O", GRAVITY)))

    def __init__(self, joint_names: Sequence[str], raw: Any) -> None:
        self.computed_at: dict[str, int] = {}
        self.raw = raw
        super().__init__()
        self.set_NE_T_EE = identity16()
        self.joints = states = JointStates(joint_names)
        self.q, self.dq, self.tau_J = states.position, states.velocity, states.effort
        self.computed_at.clear()
        self.take(raw, 0.0)

    def take(self, raw: Any, time: float) -> None:
        """Store a new state of libfranka; time: robot time of the measurement [s]."""
        self.raw = raw
        self.q[:], self.dq[:], self.tau_J[:] = raw.q, raw.dq, raw.tau_J
        self.time = time
        self.tick += 1


for _name in FIELD_NAMES:
    if _name not in OWN_FIELDS:
        setattr(LibfrankaState, _name, _taken(_name))
