"""Kinematics and dynamics of the arm by compiled code: the fields of the state all at once, and the torque that the model expects.

The state computes them by itself, one by one, when somebody reads them. A client on the network is sent all of them in every state, which that way
would take longer than all the rest of the cycle.
"""

from __future__ import annotations

import ctypes
import struct
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_sim.box.requests import GeneratorMode
from franka_sim.box.state import ELBOW_FLIP, BoxState
from franka_sim.model_library import SOURCE
from franka_sim.model_library.compiler import compile_cached
from franka_sim.model_library.parameters import c_parameters
from hric_control.errors import HricError

OWN_SOURCE = Path(__file__).with_name("compiled_arm.c")
_CARTESIAN = frozenset((GeneratorMode.CARTESIAN_POSITION, GeneratorMode.CARTESIAN_VELOCITY))
_IN, _FRAMES, _OUT = struct.Struct("41d"), struct.Struct("33d"), struct.Struct("63d")
_MOTION, _MASS, _TORQUE = struct.Struct("21d"), struct.Struct("16d"), struct.Struct("7d")


def open_library(library: bytes) -> ctypes.CDLL:
    """Load a shared library from its bytes. Raises OSError."""
    with tempfile.NamedTemporaryFile(suffix=".so") as file:
        file.write(library)
        file.flush()
        return ctypes.CDLL(file.name)


class CompiledArm:
    """Fills in O_T_EE, O_T_EE_d, O_T_EE_c, O_dP_EE_d, the elbows, the external wrench and the contacts; and computes inverse dynamics.

    Args:
        urdf_xml: robot description.
        arm_id: prefix of its links.
        least_singular_value: of the Jacobian of the stiffness frame, below which the wrench is zero (as the box has it).

    Raises:
        HricError: it cannot be compiled.
        OSError: the library cannot be loaded.
    """

    def __init__(self, urdf_xml: str, arm_id: str, least_singular_value: float) -> None:
        source = c_parameters(urdf_xml, arm_id) + SOURCE.read_text() + OWN_SOURCE.read_text()
        library = open_library(compile_cached(source, f"{arm_id}_arm"))
        self._compute, self._inverse_dynamics = library.fields, library.inverse_dynamics
        for function in (self._compute, self._inverse_dynamics):
            function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], None
        self._motion, self._torque = ctypes.create_string_buffer(_MOTION.size + _MASS.size), ctypes.create_string_buffer(_TORQUE.size)
        self._dynamics_at = ctypes.addressof(self._motion), ctypes.addressof(self._torque)
        self._in, self._out = ctypes.create_string_buffer(_IN.size + _FRAMES.size), ctypes.create_string_buffer(_OUT.size)
        self._addresses = ctypes.addressof(self._in), ctypes.addressof(self._out)
        self._least = least_singular_value
        self._frames: tuple[Any, Any] = (None, None)

    def fill(self, state: BoxState) -> None:
        """Set the fields for the state's present tick."""
        if self._frames[0] is not state.F_T_EE or self._frames[1] is not state.EE_T_K:
            self._take_frames(state)
        q, q_d = state.q, state.q_d
        torques, forces = state.lower()
        _IN.pack_into(self._in, 0, *q, *q_d, *state.dq_d, *state.tau_ext_hat_filtered, *torques, *forces)
        self._compute(*self._addresses)
        out = [*_OUT.unpack_from(self._out)]
        state.O_T_EE, state.O_F_ext_hat_K, state.K_F_ext_hat_K = out[0:16], out[38:44], out[44:50]
        state.joint_contact, state.cartesian_contact = out[50:57], out[57:63]
        elbow_d = [q_d[2], 1.0 if q_d[3] > ELBOW_FLIP else -1.0]
        state.elbow, state.elbow_d, state.O_dP_EE_d = [q[2], 1.0 if q[3] > ELBOW_FLIP else -1.0], elbow_d, out[32:38]
        if state.generator_mode not in _CARTESIAN:  # those generators write them
            state.O_T_EE_d, state.O_T_EE_c, state.elbow_c = out[16:32], out[16:32], elbow_d[:]

    def take_model(self, model: KdlFrankaModel) -> None:
        """What the arm carries, and how it is mounted, for `inverse_dynamics`."""
        total = model.total_inertial
        values = (*model.gravity_base.tolist(), *total.inertia.ravel().tolist(), total.mass, *total.com.tolist())
        _MASS.pack_into(self._motion, _MOTION.size, *values)

    def inverse_dynamics(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> list[float]:
        """M(q) ddq + C(q, dq) dq + g(q), 7 floats [N m]; q, dq, ddq: 7 floats [rad], [rad/s], [rad/s^2]. After `take_model`."""
        _MOTION.pack_into(self._motion, 0, *q, *dq, *ddq)
        self._inverse_dynamics(*self._dynamics_at)
        return [*_TORQUE.unpack_from(self._torque)]

    def _take_frames(self, state: BoxState) -> None:
        self._frames = state.F_T_EE, state.EE_T_K
        F_T_EE, EE_T_K = (np.array(T).reshape(4, 4).T for T in self._frames)
        _FRAMES.pack_into(self._in, _IN.size, *state.F_T_EE, *(F_T_EE @ EE_T_K).T.ravel().tolist(), self._least)


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
