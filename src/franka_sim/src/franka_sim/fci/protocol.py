"""Franka Control Interface, protocol versions 5 and 10: requests, status numbers of outcomes, and both datagrams."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from franka_sim.box.requests import RequestOutcome
from franka_sim.fci.wire import CommandCodec, StateCodec


class FciRequest(Enum):
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
    """Byte layout of a request.

    Attributes:
        request: request that has this layout.
        layout: format of the payload in the notation of `struct`.
        parts: lengths of the vectors in the payload; a length of 1 gives a vector of one element.
    """

    request: FciRequest
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


Statuses = Mapping[RequestOutcome, int]


@dataclass(frozen=True)
class Protocol:
    """Version of the Franka Control Interface between client and arm.

    Attributes:
        version: version number, exchanged in Connect.
        requests: request formats by id.
        statuses: status numbers of outcomes, per request.
        state, command: codecs of the state and command datagrams.
    """

    version: int
    requests: Mapping[int, RequestFormat]
    statuses: Mapping[FciRequest, Statuses]
    state: StateCodec
    command: CommandCodec

    def status(self, request: FciRequest, outcome: RequestOutcome) -> int:
        """Return the status number of an outcome; if the request has none for it, its last and most general failure."""
        numbers = self.statuses[request]
        return numbers.get(outcome, max(numbers.values()))


SETTERS = (
    FciRequest.SET_COLLISION_BEHAVIOR,
    FciRequest.SET_JOINT_IMPEDANCE,
    FciRequest.SET_CARTESIAN_IMPEDANCE,
    FciRequest.SET_GUIDING_MODE,
    FciRequest.SET_EE_TO_K,
    FciRequest.SET_NE_TO_EE,
    FciRequest.SET_LOAD,
)
"""Requests whose status numbers are equal in both protocol versions."""

COLLISION_BEHAVIOR = RequestFormat(FciRequest.SET_COLLISION_BEHAVIOR, "52d", (7, 7, 7, 7, 6, 6, 6, 6))
JOINT_IMPEDANCE = RequestFormat(FciRequest.SET_JOINT_IMPEDANCE, "7d", (7,))
CARTESIAN_IMPEDANCE = RequestFormat(FciRequest.SET_CARTESIAN_IMPEDANCE, "6d", (6,))
GUIDING_MODE = RequestFormat(FciRequest.SET_GUIDING_MODE, "7B", (6, 1))
EE_TO_K = RequestFormat(FciRequest.SET_EE_TO_K, "16d", (16,))
NE_TO_EE = RequestFormat(FciRequest.SET_NE_TO_EE, "16d", (16,))
LOAD = RequestFormat(FciRequest.SET_LOAD, "13d", (1, 3, 9))
CONNECT = RequestFormat(FciRequest.CONNECT, "HH", (1, 1))

_SETTER = {RequestOutcome.SUCCESS: 0, RequestOutcome.NOT_POSSIBLE: 1, RequestOutcome.INVALID_ARGUMENT: 2}
_TRANSFER = {RequestOutcome.SUCCESS: 0, RequestOutcome.NOT_POSSIBLE: 1}

_REQUESTS_5 = {
    0: CONNECT,
    1: RequestFormat(FciRequest.MOVE, "II3d3d", (1, 1, 3, 3)),
    2: RequestFormat(FciRequest.STOP_MOVE),
    3: RequestFormat(FciRequest.GET_CARTESIAN_LIMIT, "i", (1,)),
    4: COLLISION_BEHAVIOR,
    5: JOINT_IMPEDANCE,
    6: CARTESIAN_IMPEDANCE,
    7: GUIDING_MODE,
    8: EE_TO_K,
    9: NE_TO_EE,
    10: LOAD,
    11: RequestFormat(FciRequest.SET_FILTERS, "5d", (5,)),
    12: RequestFormat(FciRequest.AUTOMATIC_ERROR_RECOVERY),
    13: RequestFormat(FciRequest.LOAD_MODEL_LIBRARY, "BB", (1, 1)),
}
_STATUSES_5 = {
    FciRequest.MOVE: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.STARTED: 1,
        RequestOutcome.PREEMPTED: 2,
        RequestOutcome.NOT_POSSIBLE: 3,
        RequestOutcome.SINGULAR_START: 4,
        RequestOutcome.INVALID_ARGUMENT: 5,
        RequestOutcome.REFLEX_ABORTED: 6,
        RequestOutcome.EMERGENCY_ABORTED: 7,
        RequestOutcome.INPUT_ERROR_ABORTED: 8,
        RequestOutcome.ABORTED: 9,
    },
    FciRequest.STOP_MOVE: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.NOT_POSSIBLE: 1,
        RequestOutcome.EMERGENCY_ABORTED: 2,
        RequestOutcome.REFLEX_ABORTED: 3,
        RequestOutcome.ABORTED: 4,
    },
    FciRequest.AUTOMATIC_ERROR_RECOVERY: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.NOT_POSSIBLE: 1,
        RequestOutcome.MANUAL_RECOVERY_REQUIRED: 2,
        RequestOutcome.REFLEX_ABORTED: 3,
        RequestOutcome.EMERGENCY_ABORTED: 4,
        RequestOutcome.ABORTED: 5,
    },
    **dict.fromkeys((FciRequest.GET_CARTESIAN_LIMIT, FciRequest.SET_FILTERS, *SETTERS), _SETTER),
    FciRequest.LOAD_MODEL_LIBRARY: _TRANSFER,
}
PROTOCOL_5 = Protocol(
    5, _REQUESTS_5, _STATUSES_5, StateCodec("d", accelerometers=False), CommandCodec(torque_flag=False)
)
"""Panda, libfranka 0.9.1 and 0.9.2."""

_REQUESTS_10 = {
    0: CONNECT,
    1: RequestFormat(FciRequest.MOVE, "II3d3dB7d", (1, 1, 3, 3, 1, 7)),
    2: RequestFormat(FciRequest.STOP_MOVE),
    3: COLLISION_BEHAVIOR,
    4: JOINT_IMPEDANCE,
    5: CARTESIAN_IMPEDANCE,
    6: GUIDING_MODE,
    7: EE_TO_K,
    8: NE_TO_EE,
    9: LOAD,
    10: RequestFormat(FciRequest.AUTOMATIC_ERROR_RECOVERY),
    11: RequestFormat(FciRequest.GET_ROBOT_MODEL),
}
_STATUSES_10 = {
    FciRequest.MOVE: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.STARTED: 1,
        RequestOutcome.PREEMPTED: 2,
        # 3, 4: preempted and rejected by the safety function, which the emulated box does not have.
        RequestOutcome.NOT_POSSIBLE: 5,
        RequestOutcome.SINGULAR_START: 6,
        RequestOutcome.INVALID_ARGUMENT: 7,
        RequestOutcome.REFLEX_ABORTED: 8,
        RequestOutcome.EMERGENCY_ABORTED: 9,
        RequestOutcome.INPUT_ERROR_ABORTED: 10,
        RequestOutcome.ABORTED: 11,
    },
    FciRequest.STOP_MOVE: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.NOT_POSSIBLE: 1,
        RequestOutcome.EMERGENCY_ABORTED: 3,
        RequestOutcome.REFLEX_ABORTED: 4,
        RequestOutcome.ABORTED: 5,
    },
    FciRequest.AUTOMATIC_ERROR_RECOVERY: {
        RequestOutcome.SUCCESS: 0,
        RequestOutcome.NOT_POSSIBLE: 1,
        RequestOutcome.MANUAL_RECOVERY_REQUIRED: 3,
        RequestOutcome.REFLEX_ABORTED: 4,
        RequestOutcome.EMERGENCY_ABORTED: 5,
        RequestOutcome.ABORTED: 6,
    },
    **dict.fromkeys(SETTERS, _SETTER),
    FciRequest.GET_ROBOT_MODEL: _TRANSFER,
}
PROTOCOL_10 = Protocol(
    10, _REQUESTS_10, _STATUSES_10, StateCodec("f", accelerometers=True), CommandCodec(torque_flag=True)
)
"""FR3, libfranka 0.18 to 0.21."""

PROTOCOLS = {protocol.version: protocol for protocol in (PROTOCOL_5, PROTOCOL_10)}
