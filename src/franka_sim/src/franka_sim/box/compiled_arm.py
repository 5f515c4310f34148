"""Dynamics of the arm by compiled code: the torque that the model expects, gravity alone, and the estimate of the external torque."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.compiled_fields import CompiledFields
from franka_sim.model_library import SOURCE
from franka_sim.model_library.parameters import c_parameters
from hric_control.compiler import compile_cached
from hric_control.errors import HricError
from hric_control.vectors import put, take

OWN_SOURCE = Path(__file__).with_name("compiled_arm.c")
_TOLD, _MOTION, _JOINTS = 16, 21, 7
"""Sizes of what goes to and fro [doubles]."""
_VALUE, _GRAVITY, _CONSTANTS, _ESTIMATE = 42, 49, 56, 58
"""Places in the C struct Estimate, and its size [doubles]."""

Vector = Sequence[float]
Update = Callable[[list[float], Vector, Vector, Vector, Vector, Vector, Vector | None], list[float]]
"""See `CompiledArm.estimator`."""
_NONE = (0.0,) * 7


def open_library(library: bytes) -> ctypes.CDLL:
    """Load a shared library from its bytes. Raises OSError."""
    with tempfile.NamedTemporaryFile(suffix=".so") as file:
        file.write(library)
        file.flush()
        return ctypes.CDLL(file.name)


class CompiledArm:
    """Inverse dynamics of the arm, and `fields`.

    Args:
        urdf_xml: robot description.
        arm_id: prefix of its links.
        least_singular_value: see `CompiledFields`.

    Attributes:
        fields: kinematics of the state.

    Raises:
        HricError: it cannot be compiled.
        OSError: the library cannot be loaded.
    """

    def __init__(self, urdf_xml: str, arm_id: str, least_singular_value: float) -> None:
        source = c_parameters(urdf_xml, arm_id) + SOURCE.read_text() + OWN_SOURCE.read_text()
        library = open_library(compile_cached(source, f"{arm_id}_arm"))
        self.fields = CompiledFields(library, least_singular_value)
        self._inverse_dynamics = _function(library.inverse_dynamics, 3)
        self._external_torque = _function(library.external_torque, 2)
        self._told, self._told_at = _buffer(_TOLD)
        self._motion, motion_at = _buffer(_MOTION)
        self._rest, rest_at = _buffer(_MOTION)  # dq and ddq stay zero
        self._torque, torque_at = _buffer(_JOINTS)
        self._moving, self._resting = (self._told_at, motion_at, torque_at), (self._told_at, rest_at, torque_at)

    def take_model(self, model: KdlFrankaModel) -> None:
        """What the arm carries, and how it is mounted."""
        total = model.total_inertial
        put(self._told, 0, model.gravity_base.tolist(), total.inertia.ravel().tolist(), [total.mass], total.com.tolist())

    def inverse_dynamics(self, q: Vector, dq: Vector, ddq: Vector) -> list[float]:
        """M(q) ddq + C(q, dq) dq + g(q), 7 floats [N m]; q, dq, ddq: 7 floats [rad], [rad/s], [rad/s^2]. After `take_model`."""
        put(self._motion, 0, q, dq, ddq)
        self._inverse_dynamics(*self._moving)
        return take(self._torque, 0, 7)

    def gravity(self, q: Vector) -> list[float]:
        """g(q), 7 floats [N m]; q: 7 floats [rad]. After `take_model`."""
        put(self._rest, 0, q)
        self._inverse_dynamics(*self._resting)
        return take(self._torque, 0, 7)

    def estimator(self, rate: float, gain: float) -> Update:
        """The update of `estimates.ExternalTorque` as a function (value, q, dq, q_now, dq_now, tau, friction) -> g(q_now); it changes value in place.

        Args:
            rate: cycles per second [1/s].
            gain: share of the low-pass filter per cycle [1].
        """
        values, at = _buffer(_ESTIMATE)
        put(values, _CONSTANTS, (rate, gain))
        compute, told_at = self._external_torque, self._told_at

        def update(value: list[float], q: Vector, dq: Vector, q_now: Vector, dq_now: Vector, tau: Vector, friction: Vector | None) -> list[float]:
            put(values, 0, q, dq, q_now, dq_now, tau, friction or _NONE, value)
            compute(told_at, at)
            value[:] = take(values, _VALUE, 7)
            return take(values, _GRAVITY, 7)

        return update


def _buffer(size: int) -> tuple[Any, int]:
    """(memory, its address); size: [doubles]."""
    memory = ctypes.create_string_buffer(8 * size)
    return memory, ctypes.addressof(memory)


def _function(function: Any, arguments: int) -> Any:
    function.argtypes, function.restype = [ctypes.c_void_p] * arguments, None
    return function


def compiled_arm(urdf_xml: str, arm_id: str, least_singular_value: float, say: Callable[[str], None]) -> CompiledArm | None:
    """The compiled arm, or None where it cannot be compiled, which is said.

    Args:
        urdf_xml, arm_id, least_singular_value: see `CompiledArm`.
        say: takes one line.
    """
    try:
        return CompiledArm(urdf_xml, arm_id, least_singular_value)
    except (HricError, OSError) as error:
        say(f"poses, wrenches and estimates are computed without compiled code, which takes longer: {error}")
        return None
