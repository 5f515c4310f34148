"""Versions of the arm's protocol: requests, status numbers of outcomes, and the two datagrams."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from franka_sim.box.requests import Outcome
from franka_sim.fci.wire import CommandCodec, StateCodec


class Request(Enum):
    """Requests of a client to the arm."""

    CONNECT = "Connect"
    MOVE = "Move"
    STOP_MOVE = "StopMove"
    GET_CARTESIAN_LIMIT = "GetCartesianLimit"
    SET_COLLISION_BEHAVIOR = "SetCollisionBehavior"
    SET_JOINT_IMPEDANCE = "SetJointImpedance"
    SET_CARTESIAN_IMPEDANCE = "SetCartesianImpedance"
    SET_GUIDING_MODE = "SetGuidingMode"
    SET_EE_TO_K = "SetEEToK"
    SET_NE_TO_EE = "SetNEToEE"
    SET_LOAD = "SetLoad"
    SET_FILTERS = "SetFilters"
    AUTOMATIC_ERROR_RECOVERY = "AutomaticErrorRecovery"
    LOAD_MODEL_LIBRARY = "LoadModelLibrary"
    GET_ROBOT_MODEL = "GetRobotModel"


@dataclass(frozen=True)
class RequestFormat:
    """Layout of a request.

    Attributes:
        request: its meaning.
        layout: struct format of the payload.
        parts: lengths of the vectors in the payload; a length of 1 gives a vector of one element.
    """

    request: Request
    layout: str = ""
    parts: tuple[int, ...] = ()
    payload: struct.Struct = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "payload", struct.Struct("<" + self.layout))

    def decode(self, payload: bytes) -> list[tuple[float, ...]]:
        """Return the vectors of a payload of the correct size."""
        values, vectors, at = self.payload.unpack(payload), [], 0
        for length in self.parts:
            vectors.append(values[at : at + length])
            at += length
        return vectors


Statuses = Mapping[Outcome, int]


@dataclass(frozen=True)
class Protocol:
    """Version of the arm's protocol.

    Attributes:
        version: number in Connect.
        requests: request formats by id.
        statuses: status numbers of outcomes, per request.
        state, command: datagrams.
    """

    version: int
    requests: Mapping[int, RequestFormat]
    statuses: Mapping[Request, Statuses]
    state: StateCodec
    command: CommandCodec

    def status(self, request: Request, outcome: Outcome) -> int:
        """Return the status number of an outcome; without one, the request's last number, its most general failure."""
        numbers = self.statuses[request]
        return numbers.get(outcome, max(numbers.values()))


SETTERS = (
    Request.SET_COLLISION_BEHAVIOR,
    Request.SET_JOINT_IMPEDANCE,
    Request.SET_CARTESIAN_IMPEDANCE,
    Request.SET_GUIDING_MODE,
    Request.SET_EE_TO_K,
    Request.SET_NE_TO_EE,
    Request.SET_LOAD,
)
"""Requests with the same responses in both versions."""

COLLISION_BEHAVIOR = RequestFormat(Request.SET_COLLISION_BEHAVIOR, "52d", (7, 7, 7, 7, 6, 6, 6, 6))
JOINT_IMPEDANCE = RequestFormat(Request.SET_JOINT_IMPEDANCE, "7d", (7,))
CARTESIAN_IMPEDANCE = RequestFormat(Request.SET_CARTESIAN_IMPEDANCE, "6d", (6,))
GUIDING_MODE = RequestFormat(Request.SET_GUIDING_MODE, "7B", (6, 1))
EE_TO_K = RequestFormat(Request.SET_EE_TO_K, "16d", (16,))
NE_TO_EE = RequestFormat(Request.SET_NE_TO_EE, "16d", (16,))
LOAD = RequestFormat(Request.SET_LOAD, "13d", (1, 3, 9))
CONNECT = RequestFormat(Request.CONNECT, "HH", (1, 1))

_SETTER = {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1, Outcome.INVALID_ARGUMENT: 2}
_TRANSFER = {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1}

_REQUESTS_5 = {
    0: CONNECT,
    1: RequestFormat(Request.MOVE, "II3d3d", (1, 1, 3, 3)),
    2: RequestFormat(Request.STOP_MOVE),
    3: RequestFormat(Request.GET_CARTESIAN_LIMIT, "i", (1,)),
    4: COLLISION_BEHAVIOR,
    5: JOINT_IMPEDANCE,
    6: CARTESIAN_IMPEDANCE,
    7: GUIDING_MODE,
    8: EE_TO_K,
    9: NE_TO_EE,
    10: LOAD,
    11: RequestFormat(Request.SET_FILTERS, "5d", (5,)),
    12: RequestFormat(Request.AUTOMATIC_ERROR_RECOVERY),
    13: RequestFormat(Request.LOAD_MODEL_LIBRARY, "BB", (1, 1)),
}
_STATUSES_5 = {
    Request.MOVE: {
        Outcome.SUCCESS: 0,
        Outcome.STARTED: 1,
        Outcome.PREEMPTED: 2,
        Outcome.NOT_POSSIBLE: 3,
        Outcome.SINGULAR_START: 4,
        Outcome.INVALID_ARGUMENT: 5,
        Outcome.REFLEX_ABORTED: 6,
        Outcome.EMERGENCY_ABORTED: 7,
        Outcome.INPUT_ERROR_ABORTED: 8,
        Outcome.ABORTED: 9,
    },
    Request.STOP_MOVE: {
        Outcome.SUCCESS: 0,
        Outcome.NOT_POSSIBLE: 1,
        Outcome.EMERGENCY_ABORTED: 2,
        Outcome.REFLEX_ABORTED: 3,
        Outcome.ABORTED: 4,
    },
    Request.AUTOMATIC_ERROR_RECOVERY: {
        Outcome.SUCCESS: 0,
        Outcome.NOT_POSSIBLE: 1,
        Outcome.MANUAL_RECOVERY_REQUIRED: 2,
        Outcome.REFLEX_ABORTED: 3,
        Outcome.EMERGENCY_ABORTED: 4,
        Outcome.ABORTED: 5,
    },
    **dict.fromkeys((Request.GET_CARTESIAN_LIMIT, Request.SET_FILTERS, *SETTERS), _SETTER),
    Request.LOAD_MODEL_LIBRARY: _TRANSFER,
}
PROTOCOL_5 = Protocol(
    5, _REQUESTS_5, _STATUSES_5, StateCodec("d", accelerometers=False), CommandCodec(torque_flag=False)
)
"""Panda, libfranka 0.9.1 and 0.9.2."""

_REQUESTS_10 = {
    0: CONNECT,
    1: RequestFormat(Request.MOVE, "II3d3dB7d", (1, 1, 3, 3, 1, 7)),
    2: RequestFormat(Request.STOP_MOVE),
    3: COLLISION_BEHAVIOR,
    4: JOINT_IMPEDANCE,
    5: CARTESIAN_IMPEDANCE,
    6: GUIDING_MODE,
    7: EE_TO_K,
    8: NE_TO_EE,
    9: LOAD,
    10: RequestFormat(Request.AUTOMATIC_ERROR_RECOVERY),
    11: RequestFormat(Request.GET_ROBOT_MODEL),
}
_STATUSES_10 = {
    Request.MOVE: {
        Outcome.SUCCESS: 0,
        Outcome.STARTED: 1,
        Outcome.PREEMPTED: 2,
        # 3, 4: preempted and rejected by the safety function, which the emulated box does not have.
        Outcome.NOT_POSSIBLE: 5,
        Outcome.SINGULAR_START: 6,
        Outcome.INVALID_ARGUMENT: 7,
        Outcome.REFLEX_ABORTED: 8,
        Outcome.EMERGENCY_ABORTED: 9,
        Outcome.INPUT_ERROR_ABORTED: 10,
        Outcome.ABORTED: 11,
    },
    Request.STOP_MOVE: {
        Outcome.SUCCESS: 0,
        Outcome.NOT_POSSIBLE: 1,
        Outcome.EMERGENCY_ABORTED: 3,
        Outcome.REFLEX_ABORTED: 4,
        Outcome.ABORTED: 5,
    },
    Request.AUTOMATIC_ERROR_RECOVERY: {
        Outcome.SUCCESS: 0,
        Outcome.NOT_POSSIBLE: 1,
        Outcome.MANUAL_RECOVERY_REQUIRED: 3,
        Outcome.REFLEX_ABORTED: 4,
        Outcome.EMERGENCY_ABORTED: 5,
        Outcome.ABORTED: 6,
    },
    **dict.fromkeys(SETTERS, _SETTER),
    Request.GET_ROBOT_MODEL: _TRANSFER,
}
PROTOCOL_10 = Protocol(
    10, _REQUESTS_10, _STATUSES_10, StateCodec("f", accelerometers=True), CommandCodec(torque_flag=True)
)
"""FR3, libfranka 0.18 to 0.21."""

PROTOCOLS = {protocol.version: protocol for protocol in (PROTOCOL_5, PROTOCOL_10)}
