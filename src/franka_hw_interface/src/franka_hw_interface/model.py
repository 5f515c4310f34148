"""Dynamic model of the arm for controllers: a protocol with several implementations, and a handle to one."""

from collections.abc import Callable, Sequence
from copy import copy
from enum import Enum
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from franka_hw_interface.robot_state import RobotState
from hric_core.geometry import FloatArray

Vector = Sequence[float] | FloatArray


class FrankaFrame(Enum):
    """Frames of the arm: joints, flange, end effector (flange * F_T_EE), stiffness frame (end effector * EE_T_K)."""

    JOINT1 = "joint1"
    JOINT2 = "joint2"
    JOINT3 = "joint3"
    JOINT4 = "joint4"
    JOINT5 = "joint5"
    JOINT6 = "joint6"
    JOINT7 = "joint7"
    FLANGE = "flange"
    END_EFFECTOR = "end_effector"
    STIFFNESS = "stiffness"

    __hash__ = object.__hash__  # Enum's own is not compiled, and frames are looked up in each cycle


@runtime_checkable
class FrankaModel(Protocol):
    """Dynamics and kinematics of a Franka arm with the configured load and frames. Callers own the returned arrays.

    Base frame: O, `<arm_id>_link0`. Everything mounted at the flange (the hand) is included; where its mass comes from
    depends on the implementation.

    Attributes:
        gravity_list: function from q (7 floats [rad]) to the gravity torque, 7 floats [N m]; fast, for control loops,
            without checks of its argument.
        revision: number of changes of load and frames so far.
    """

    revision: int
    gravity_list: Callable[[Sequence[float]], list[float]]

    def mass(self, q: Vector) -> FloatArray:
        """Return the mass matrix without rotor inertia, shape (7, 7) [kg m^2]; q: shape (7,) [rad]."""

    def coriolis(self, q: Vector, dq: Vector) -> FloatArray:
        """Return the vector C(q, dq) dq, shape (7,) [N m]; dq: shape (7,) [rad/s]."""

    def gravity(self, q: Vector, gravity_base: Sequence[float] | None = None) -> FloatArray:
        """Return the torque against gravity, shape (7,) [N m]; gravity_base: in the base frame, 3 floats [m/s^2]."""

    def pose(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return T_base_frame, shape (4, 4)."""

    def zero_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""

    def body_jacobian(self, frame: FrankaFrame, q: Vector) -> FloatArray:
        """Return the Jacobian of the frame's origin in the frame itself, linear above angular, shape (6, 7)."""

    def set_load(self, mass: float, com: Vector, inertia: Vector | FloatArray) -> None:
        """Replace the payload: mass [kg], centre of mass in the flange [m], inertia about it [kg m^2]."""

    def set_ee(self, F_T_EE: FloatArray) -> None:
        """Set the end effector in the flange frame, shape (4, 4)."""

    def set_stiffness_frame(self, EE_T_K: FloatArray) -> None:
        """Set the stiffness frame in the end-effector frame, shape (4, 4)."""


class Configuration(NamedTuple):
    """Motion of the arm for which a model is evaluated.

    Attributes:
        q, dq: joint positions and velocities, 7 floats each [rad], [rad/s].
        tick: never changes, as for a `RobotState` between two cycles.
    """

    q: Sequence[float]
    dq: Sequence[float]
    tick: int = 0


class FrankaModelHandle:
    """Model evaluated at the robot's present state. Each value is computed when first read, once per cycle.

    The arrays are shared by all users within the cycle, and read-only. `at` and `with_load` return handles for another
    motion and another payload; both together: `handle.with_load(...).at(q)`.
    """

    def __init__(self, name: str, model: FrankaModel, state: RobotState | Configuration) -> None:
        self.name, self._model, self._state = name, model, state
        self._cache: dict[object, FloatArray] = {}
        self._valid = (-1, -1)

    def _cached(self, key: object, compute: Callable[[], FloatArray]) -> FloatArray:
        now = (self._state.tick, self._model.revision)
        if now != self._valid:
            self._cache.clear()
            self._valid = now
        value = self._cache.get(key)
        if value is None:
            value = self._cache[key] = compute()
            value.setflags(write=False)
        return value

    def at(self, q: Vector, dq: Vector = (0.0,) * 7) -> "FrankaModelHandle":
        """Return a handle at other joint positions and velocities, shape (7,) each [rad], [rad/s]."""
        return FrankaModelHandle(self.name, self._model, Configuration(list(map(float, q)), list(map(float, dq))))

    def with_load(self, mass: float, com: Vector, inertia: Vector | FloatArray) -> "FrankaModelHandle":
        """Return a handle with another payload, at the same state; takes milliseconds, so not for the control loop.

        The new handle keeps the present end effector and frames, whatever is configured later.

        Args:
            mass: mass of the payload without the end effector [kg].
            com: centre of mass in the flange, shape (3,) [m].
            inertia: inertia about the centre of mass, 9 values [kg m^2].

        Raises:
            CommandError: this is not a payload.
        """
        other = copy(self._model)
        other.set_load(mass, com, inertia)
        return FrankaModelHandle(self.name, other, self._state)

    def mass(self) -> FloatArray:
        """Return the mass matrix without rotor inertia, shape (7, 7) [kg m^2]."""
        return self._cached("mass", lambda: self._model.mass(self._state.q))

    def coriolis(self) -> FloatArray:
        """Return the vector C(q, dq) dq, shape (7,) [N m]."""
        return self._cached("coriolis", lambda: self._model.coriolis(self._state.q, self._state.dq))

    def gravity(self) -> FloatArray:
        """Return the torque against gravity with the configured load, shape (7,) [N m]."""
        return self._cached("gravity", lambda: np.array(self._model.gravity_list(self._state.q)))

    def pose(self, frame: FrankaFrame) -> FloatArray:
        """Return T_base_frame, shape (4, 4)."""
        return self._cached(("pose", frame), lambda: self._model.pose(frame, self._state.q))

    def zero_jacobian(self, frame: FrankaFrame) -> FloatArray:
        """Return the Jacobian of the frame's origin in the base frame, linear above angular, shape (6, 7)."""
        return self._cached(("zero", frame), lambda: self._model.zero_jacobian(frame, self._state.q))

    def body_jacobian(self, frame: FrankaFrame) -> FloatArray:
        """Return the Jacobian of the frame's origin in the frame itself, linear above angular, shape (6, 7)."""
        return self._cached(("body", frame), lambda: self._model.body_jacobian(frame, self._state.q))
