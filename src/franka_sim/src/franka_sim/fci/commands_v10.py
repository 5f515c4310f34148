"""Protocol 10: FR3, libfranka 0.18 to 0.21."""

from __future__ import annotations

from franka_sim.box.requests import Outcome
from franka_sim.fci import protocol
from franka_sim.fci.protocol import Protocol, Request, RequestFormat
from franka_sim.fci.wire import CommandCodec, StateCodec

REQUESTS = {
    0: protocol.CONNECT,
    1: RequestFormat(Request.MOVE, "II3d3dB7d", (1, 1, 3, 3, 1, 7)),
    2: RequestFormat(Request.STOP_MOVE),
    3: protocol.COLLISION_BEHAVIOR,
    4: protocol.JOINT_IMPEDANCE,
    5: protocol.CARTESIAN_IMPEDANCE,
    6: protocol.GUIDING_MODE,
    7: protocol.EE_TO_K,
    8: protocol.NE_TO_EE,
    9: protocol.LOAD,
    10: RequestFormat(Request.AUTOMATIC_ERROR_RECOVERY),
    11: RequestFormat(Request.GET_ROBOT_MODEL),
}
MOVE = {
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
}
STOP_MOVE = {
    Outcome.SUCCESS: 0,
    Outcome.NOT_POSSIBLE: 1,
    Outcome.EMERGENCY_ABORTED: 3,
    Outcome.REFLEX_ABORTED: 4,
    Outcome.ABORTED: 5,
}
SETTER = {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1, Outcome.INVALID_ARGUMENT: 2}
RECOVERY = {
    Outcome.SUCCESS: 0,
    Outcome.NOT_POSSIBLE: 1,
    Outcome.MANUAL_RECOVERY_REQUIRED: 3,
    Outcome.REFLEX_ABORTED: 4,
    Outcome.EMERGENCY_ABORTED: 5,
    Outcome.ABORTED: 6,
}
STATUSES = {
    Request.MOVE: MOVE,
    Request.STOP_MOVE: STOP_MOVE,
    Request.AUTOMATIC_ERROR_RECOVERY: RECOVERY,
    Request.GET_ROBOT_MODEL: {Outcome.SUCCESS: 0, Outcome.NOT_POSSIBLE: 1},
    **dict.fromkeys(protocol.SETTERS, SETTER),
}
PROTOCOL = Protocol(10, REQUESTS, STATUSES, StateCodec("f", accelerometers=True), CommandCodec(torque_flag=True))
