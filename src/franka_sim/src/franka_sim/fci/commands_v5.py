"""Protocol 5: Panda, libfranka 0.9.1 and 0.9.2."""

from __future__ import annotations

from franka_sim.box.requests import Outcome
from franka_sim.fci import protocol
from franka_sim.fci.protocol import Protocol, Request, RequestFormat
from franka_sim.fci.wire import CommandCodec, StateCodec

REQUESTS = {
    0: protocol.CONNECT,
    1: RequestFormat(Request.MOVE, "II3d3d", (1, 1, 3, 3)),
    2: RequestFormat(Request.STOP_MOVE),
    3: RequestFormat(Request.GET_CARTESIAN_LIMIT, "i", (1,)),
    4: protocol.COLLISION_BEHAVIOR,
    5: protocol.JOINT_IMPEDANCE,
    6: protocol.CARTESIAN_IMPEDANCE,
    7: protocol.GUIDING_MODE,
    8: protocol.EE_TO_K,
    9: protocol.NE_TO_EE,
    10: protocol.LOAD,
    11: RequestFormat(Request.SET_FILTERS, "5d", (5,)),
    12: RequestFormat(Request.AUTOMATIC_ERROR_RECOVERY),
    13: RequestFormat(Request.LOAD_MODEL_LIBRARY, "BB", (1, 1)),
}
MOVE = {
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
}
STOP_MOVE = {
    Outcome.SUCCESS: 0,
    Outcome.NOT_POSSIBLE: 1,
    Outcome.EMERGENCY_ABORTED: 2,
    Outcome.REFLEX_ABORTED: 3,
    Outcome.ABORTED: 4,
}
SETTER = {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1, Outcome.INVALID_ARGUMENT: 2}
RECOVERY = {
    Outcome.SUCCESS: 0,
    Outcome.NOT_POSSIBLE: 1,
    Outcome.MANUAL_RECOVERY_REQUIRED: 2,
    Outcome.REFLEX_ABORTED: 3,
    Outcome.EMERGENCY_ABORTED: 4,
    Outcome.ABORTED: 5,
}
STATUSES = {
    Request.MOVE: MOVE,
    Request.STOP_MOVE: STOP_MOVE,
    Request.GET_CARTESIAN_LIMIT: SETTER,
    Request.SET_FILTERS: SETTER,
    Request.AUTOMATIC_ERROR_RECOVERY: RECOVERY,
    Request.LOAD_MODEL_LIBRARY: {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1},
    **dict.fromkeys(protocol.SETTERS, SETTER),
}
PROTOCOL = Protocol(5, REQUESTS, STATUSES, StateCodec("d", accelerometers=False), CommandCodec(torque_flag=False))
