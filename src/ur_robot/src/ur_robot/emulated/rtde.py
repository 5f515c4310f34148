"""Wire format of RTDE, protocol version 2, on the side of the controller; no sockets.

Source: Universal Robots, "Real-Time Data Exchange (RTDE) Guide", docs.universal-robots.com. All numbers are big-endian.
"""

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum

Value = float | Sequence[float]

HEADER = struct.Struct(">HB")
"""Header of a package: size with the header [bytes], type."""
LONGEST = 4096
"""Longest valid package [bytes]; the guide limits a list of names to 2048."""
PROTOCOL = 2
CYCLE_RATE = 500.0
"""Rate of the control loop of an e-Series arm, and highest rate of its states [Hz]."""
REGISTERS = 48
"""Number of input registers, and of output registers, of each type."""


class RtdeError(Exception):
    """Error of a client, whose connection is then closed; the message names what the client sent."""


class Package(IntEnum):
    """Types of packages."""

    VERSION = ord("V")
    CONTROLLER = ord("v")
    DATA = ord("U")
    OUTPUTS = ord("O")
    INPUTS = ord("I")
    START = ord("S")
    PAUSE = ord("P")


FORMATS = {
    "DOUBLE": "d",
    "INT32": "i",
    "UINT32": "I",
    "UINT64": "Q",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
"""Layout of a value by the name of its type."""

_REGISTER_TYPES = {"int": "INT32", "double": "DOUBLE"}
_JOINTS = (
    "target_q target_qd target_qdd target_current target_moment actual_q actual_qd actual_current "
    "actual_current_as_torque joint_control_output joint_temperatures actual_joint_voltage"
)
_TOOL = (
    "actual_TCP_pose actual_TCP_speed actual_TCP_force target_TCP_pose target_TCP_speed ft_raw_wrench payload_inertia"
)
_SCALARS = (
    "timestamp actual_execution_time speed_scaling target_speed_fraction actual_momentum actual_main_voltage "
    "actual_robot_voltage actual_robot_current payload standard_analog_input0 standard_analog_input1 "
    "standard_analog_output0 standard_analog_output1"
)
OUTPUTS: dict[str, str] = {
    **dict.fromkeys((_JOINTS + " " + _TOOL).split(), "VECTOR6D"),
    **dict.fromkeys(_SCALARS.split(), "DOUBLE"),
    **dict.fromkeys(("actual_tool_accelerometer", "payload_cog"), "VECTOR3D"),
    **dict.fromkeys(("runtime_state", "robot_status_bits", "safety_status_bits"), "UINT32"),
    **dict.fromkeys(("actual_digital_input_bits", "actual_digital_output_bits"), "UINT64"),
    **dict.fromkeys(("robot_mode", "safety_mode"), "INT32"),
    "joint_mode": "VECTOR6INT32",
    **{f"output_{kind}_register_{i}": name for kind, name in _REGISTER_TYPES.items() for i in range(REGISTERS)},
}
"""Types of the variables that the controller sends, by name: those that ur_rtde 1.6.5 requests."""
INPUTS: dict[str, str] = {
    "external_force_torque": "VECTOR6D",
    **{f"input_{kind}_register_{i}": name for kind, name in _REGISTER_TYPES.items() for i in range(REGISTERS)},
}
"""Types of the variables that a client may write, by name."""


def packages(received: bytearray) -> Iterator[tuple[int, bytes]]:
    """Yield type and payload of each complete package, and remove it from the bytes. Raises RtdeError."""
    while len(received) >= HEADER.size:
        size, kind = HEADER.unpack_from(received)
        if not HEADER.size <= size <= LONGEST:
            raise RtdeError(f"a package of {size} bytes; valid: {HEADER.size} to {LONGEST}")
        if len(received) < size:
            return
        payload = bytes(received[HEADER.size : size])
        del received[:size]
        yield kind, payload


def package(kind: Package, payload: bytes = b"") -> bytes:
    """Return a package with its header."""
    return HEADER.pack(HEADER.size + len(payload), kind) + payload


def unpacked(layout: struct.Struct, payload: bytes, what: str) -> tuple[float, ...]:
    """Return the values of a payload. Raises RtdeError if it has another size."""
    if len(payload) != layout.size:
        raise RtdeError(f"{what} of {len(payload)} bytes; valid: {layout.size}")
    return layout.unpack(payload)


class Recipe:
    """List of variables that a client sends or receives together.

    Args:
        text: names of the variables, separated by commas, as a client sends them.
        known: types of the existing variables, by name.

    Attributes:
        names: names of the variables.
        types: RTDE types of the variables; NOT_FOUND for a name that does not exist.
    """

    def __init__(self, text: bytes, known: Mapping[str, str]) -> None:
        self.names = tuple(text.decode("ascii", "replace").strip(",").split(","))
        self.types = [known.get(name, "NOT_FOUND") for name in self.names]
        self._sizes = [int(FORMATS.get(name, "0d")[:-1] or 1) for name in self.types]
        self._missing = [
            [math.nan if kind.startswith(("D", "VECTOR3D", "VECTOR6D")) and "register" not in name else 0] * size
            for name, kind, size in zip(self.names, self.types, self._sizes, strict=True)
        ]
        self._layout = struct.Struct(">" + "".join(FORMATS.get(name, "") for name in self.types))

    @property
    def valid(self) -> bool:
        """True if all variables exist."""
        return "NOT_FOUND" not in self.types

    def pack(self, values: Mapping[str, Value]) -> bytes:
        """Return the variables as bytes; a missing one is 0 if it is a register or a whole number, else NaN."""
        flat: list[float] = []
        for name, missing in zip(self.names, self._missing, strict=True):
            value = values.get(name, missing)
            flat += value if isinstance(value, Sequence) else [value]
        return self._layout.pack(*flat)

    def unpack(self, payload: bytes) -> dict[str, float]:
        """Return the scalar variables of a payload by name. Raises RtdeError if it has another size."""
        values = iter(unpacked(self._layout, payload, "inputs"))
        rows = {name: [next(values) for _ in range(size)] for name, size in zip(self.names, self._sizes, strict=True)}
        return {name: row[0] for name, row in rows.items() if len(row) == 1}
