"""What differs between the versions of the protocol: a table of requests, numbers of outcomes, and the two datagrams."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from franka_sim.box.requests import Outcome
from franka_sim.fci.wire import CommandCodec, StateCodec


class Request(Enum):
    """What a client can ask of the arm."""

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
    """One row of a table of requests.

    Attributes:
        request: its meaning.
        layout: of the payload.
        parts: lengths of the vectors that the payload's numbers are cut into; a length of 1 gives a vector of one.
    """

    request: Request
    layout: str = ""
    parts: tuple[int, ...] = ()
    payload: struct.Struct = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "payload", struct.Struct("<" + self.layout))

    def decode(self, payload: bytes) -> list[tuple[float, ...]]:
        """The vectors of the payload, which has the right size."""
        values, vectors, at = self.payload.unpack(payload), [], 0
        for length in self.parts:
            vectors.append(values[at : at + length])
            at += length
        return vectors


Statuses = Mapping[Outcome, int]


@dataclass(frozen=True)
class Protocol:
    """A version of the arm's protocol.

    Attributes:
        version: number in Connect.
        requests: rows by id.
        statuses: numbers of outcomes per request; `refused` for an outcome that a request has no number for.
        refused: number of "not possible", per request.
        state, command: datagrams.
    """

    version: int
    requests: Mapping[int, RequestFormat]
    statuses: Mapping[Request, Statuses]
    state: StateCodec
    command: CommandCodec

    def status(self, request: Request, outcome: Outcome) -> int:
        """Number of an outcome in the answer to a request; what has none becomes the request's last number, its plainest failure."""
        table = self.statuses[request]
        number = table.get(outcome)
        return max(table.values()) if number is None else number


SETTERS = (
    Request.SET_COLLISION_BEHAVIOR,
    Request.SET_JOINT_IMPEDANCE,
    Request.SET_CARTESIAN_IMPEDANCE,
    Request.SET_GUIDING_MODE,
    Request.SET_EE_TO_K,
    Request.SET_NE_TO_EE,
    Request.SET_LOAD,
)
"""Requests that both versions answer alike."""

COLLISION_BEHAVIOR = RequestFormat(Request.SET_COLLISION_BEHAVIOR, "52d", (7, 7, 7, 7, 6, 6, 6, 6))
JOINT_IMPEDANCE = RequestFormat(Request.SET_JOINT_IMPEDANCE, "7d", (7,))
CARTESIAN_IMPEDANCE = RequestFormat(Request.SET_CARTESIAN_IMPEDANCE, "6d", (6,))
GUIDING_MODE = RequestFormat(Request.SET_GUIDING_MODE, "7B", (6, 1))
EE_TO_K = RequestFormat(Request.SET_EE_TO_K, "16d", (16,))
NE_TO_EE = RequestFormat(Request.SET_NE_TO_EE, "16d", (16,))
LOAD = RequestFormat(Request.SET_LOAD, "13d", (1, 3, 9))
CONNECT = RequestFormat(Request.CONNECT, "HH", (1, 1))
