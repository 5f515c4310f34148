"""The model library that libfranka (protocol 5 to 9) downloads from the control box: our own, with an arm's
parameters."""

import functools
from pathlib import Path

from franka_sim.model_library.parameters import arm_parameters
from hric_control.native import load

MARKER = b"HRIC arm 187 f64"
"""In the library as it is built, before the parameters (arm.c)."""

FUNCTIONS: tuple[str, ...] = (
    *(f"O_T_J{i}" for i in range(1, 10)),
    *(f"O_J_J{i}" for i in range(1, 10)),
    *(f"Ji_J_J{i}" for i in range(1, 10)),
    "M_NE",
    "c_NE",
    "g_NE",
)
"""The 30 symbols that libfranka resolves; one missing symbol fails its `load_model`."""


@functools.lru_cache(maxsize=16)
def library_for(urdf_xml: str, arm_id: str = "panda") -> bytes:
    """The shared library of this arm for this machine: its bytes, as the response to LoadModelLibrary carries them.

    What hangs on `<arm_id>_link8` (the hand, and the flange link's own mass) is no part of the library: libfranka
    passes end effector and payload together as I_total, m_total, F_x_Ctotal, and the box reports the former as m_ee.

    Args:
        urdf_xml: robot description (pure URDF).
        arm_id: prefix of the links.

    Raises:
        DescriptionError, UnknownNameError: the URDF does not hold such an arm.
        HricError: the library is not built.
    """
    parameters = arm_parameters(urdf_xml, arm_id)
    built = Path(str(load("hric_arm").__file__)).with_name("libfranka_model.so").read_bytes()
    begin = built.index(MARKER) + len(MARKER)
    return built[:begin] + parameters + built[begin + len(parameters) :]
