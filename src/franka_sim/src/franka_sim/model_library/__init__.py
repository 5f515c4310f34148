"""Shared library with the arm's dynamics that libfranka (protocol 5 to 9) downloads from the control box."""

import functools
from pathlib import Path

from franka_sim.model_library.parameters import arm_parameters
from hric_core.native import load

MARKER = b"HRIC arm 187 f64"
"""Bytes in the built library (arm.c) after which the arm's parameters are written."""

FUNCTIONS: tuple[str, ...] = (
    *(f"O_T_J{i}" for i in range(1, 10)),
    *(f"O_J_J{i}" for i in range(1, 10)),
    *(f"Ji_J_J{i}" for i in range(1, 10)),
    "M_NE",
    "c_NE",
    "g_NE",
)
"""Names of the 30 functions that libfranka looks up in the library; its `load_model` fails if one is missing."""


@functools.lru_cache(maxsize=16)
def library_for(urdf_xml: str, arm_id: str = "panda") -> bytes:
    """Return the shared library with this arm's dynamics, for this machine, as sent in response to LoadModelLibrary.

    The library excludes everything attached to `<arm_id>_link8` (the hand, and the mass of the flange link): libfranka
    passes end effector and payload together as I_total, m_total, F_x_Ctotal to its functions.

    Args:
        urdf_xml: robot description (pure URDF).
        arm_id: prefix of the links.

    Raises:
        DescriptionError, UnknownNameError: the URDF has no such arm.
        HricError: the library is not built.
    """
    parameters = arm_parameters(urdf_xml, arm_id)
    built = Path(str(load("hric_arm").__file__)).with_name("libfranka_model.so").read_bytes()
    begin = built.index(MARKER) + len(MARKER)
    return built[:begin] + parameters + built[begin + len(parameters) :]
