"""Network services of the emulated hand (protocol version 3) and vacuum gripper (version 1), for Panda and FR3."""

import math
import selectors
import struct
from collections.abc import Mapping
from typing import ClassVar

from franka_hw_interface.hand import HandMotion, HandOutcome
from franka_sim.fci.connection import FciMessage
from franka_sim.fci.faults import NetworkFaults
from franka_sim.fci.session import Service
from franka_sim.fci.wire import CONNECT, CONNECT_PAYLOAD, HAND_FRAMING
from franka_sim.gripper import Gripper
from franka_sim.vacuum import VacuumGripper

Tool = Gripper | VacuumGripper
PORT = 1338
VERSION = 3
HOMING, GRASP, MOVE, STOP = 1, 2, 3, 4
PAYLOADS = {
    CONNECT: CONNECT_PAYLOAD,
    HOMING: struct.Struct("<"),
    GRASP: struct.Struct("<5d"),
    MOVE: struct.Struct("<2d"),
    STOP: struct.Struct("<"),
}
STATUS = {HandOutcome.SUCCESS: 0, HandOutcome.FAIL: 1, HandOutcome.UNSUCCESSFUL: 2, HandOutcome.ABORTED: 3}
STATE = struct.Struct("<IddBH")
"""State datagram: message_id, width [m], max_width [m], is_grasped, temperature [degrees Celsius]."""
STATE_PERIOD = 0.05
"""Wall time between two states sent [s]; users report 10 to 20 Hz for the real hand."""
STEP = 0.01
"""Robot time between two steps of the hand [s]: project default, unconfirmed, ten cycles of the arm."""


class HandService(Service):
    """Service at the hand's port.

    Args:
        selector: selector of the server.
        hand: the emulated hand.
        ip: address to listen on.
        faults: faults of the UDP link.
    """

    name, port, version = "hand", PORT, VERSION
    payloads: ClassVar[Mapping[int, struct.Struct]] = PAYLOADS

    def __init__(self, selector: selectors.BaseSelector, hand: Tool, ip: str, faults: NetworkFaults) -> None:
        self._hand = hand
        self._pending: list[tuple[FciMessage, HandMotion]] = []  # requests without a response
        self._message_id = 0
        self._next_state = 0.0
        super().__init__(selector, self.name, HAND_FRAMING, self.version, (ip, self.port), faults)

    def size_of(self, command: int) -> int | None:
        """Return the payload size of a request [bytes], None if there is no request with this id."""
        payload = self.payloads.get(command)
        return None if payload is None else payload.size

    def handle(self, message: FciMessage) -> None:
        """Start the requested motion. A running one is aborted, and its response is sent first."""
        values = self.payloads[message.command].unpack(message.payload)
        if not all(map(math.isfinite, values)):
            self.complaints.warn("not finite", f"request {message.command} refused: values {values} are not finite")
            self.respond(message, STATUS[HandOutcome.FAIL])
            return
        motion = self._begin(message.command, values)
        self._report()
        self._pending.append((message, motion))
        self._report()

    def _begin(self, command: int, values: tuple[float, ...]) -> HandMotion:
        hand = self._hand
        assert isinstance(hand, Gripper)
        if command == HOMING:
            return hand.homing()
        if command == STOP:
            return hand.stop()
        if command == MOVE:
            return hand.move(*values)
        return hand.grasp(*values)

    def _state(self) -> bytes:
        hand = self._hand
        assert isinstance(hand, Gripper)
        return STATE.pack(self._message_id, hand.width, hand.max_width, hand.is_grasped, hand.temperature)

    def on_client(self) -> None:
        """Send the first state to a new client at once."""
        self._next_state = 0.0

    def on_client_lost(self) -> None:
        """Drop pending responses to a client that has left; a running motion continues, since nobody stopped it."""
        self._pending.clear()

    def on_datagrams(self) -> None:
        """Log received datagrams as an error: a client of the hand sends none."""
        if self.client is not None and self.client.link.receive():
            self.complaints.warn("datagram", "a UDP datagram is ignored: the hand accepts requests over TCP only")

    def tick(self, now: float, dt: float) -> None:
        """Advance the hand by robot time, and send its state if a period of wall time has passed.

        Args:
            now: time.monotonic [s].
            dt: robot time since the last call [s].
        """
        self._hand.step(dt)
        self._report()
        if self.client is not None and now >= self._next_state:
            self._next_state = now + STATE_PERIOD
            self._message_id = (self._message_id + 1) & 0xFFFFFFFF
            self.client.link.send(self._state())

    def _report(self) -> None:
        ended = [(message, motion, motion.outcome) for message, motion in self._pending if motion.outcome is not None]
        self._pending = [(message, motion) for message, motion in self._pending if motion.outcome is None]
        for message, motion, outcome in ended:
            if outcome is HandOutcome.FAIL:
                self.complaints.warn("refused", f"{motion.name} refused: {motion.reason}")
            self.respond(message, STATUS[outcome])


VACUUM, DROP_OFF, VACUUM_STOP = 1, 2, 3
VACUUM_STATE = struct.Struct("<I???Bii")
"""State datagram of the vacuum gripper.

Fields: message_id, in_control_range, part_detached, part_present, device status, power [%], vacuum [mbar].
"""
GREEN = 0
"""Device status without warnings: nothing wears out here."""


class VacuumService(HandService):
    """Network service of the emulated vacuum gripper; arguments as for `HandService`."""

    name, port, version = "vacuum gripper", 1339, 1
    payloads: ClassVar[Mapping[int, struct.Struct]] = {
        CONNECT: CONNECT_PAYLOAD,
        VACUUM: struct.Struct("<BBq"),  # setpoint [10 mbar], profile, time-out [ms]
        DROP_OFF: struct.Struct("<q"),
        VACUUM_STOP: struct.Struct("<"),
    }

    def _begin(self, command: int, values: tuple[float, ...]) -> HandMotion:
        pump = self._hand
        assert isinstance(pump, VacuumGripper)
        if command == VACUUM_STOP:
            return pump.stop()
        timeout = values[-1] / 1000.0
        if command == VACUUM:
            return pump.suck(10.0 * values[0], timeout, int(values[1]))
        return pump.drop_off(timeout)

    def _state(self) -> bytes:
        pump = self._hand
        assert isinstance(pump, VacuumGripper)
        flags = pump.in_control_range, pump.part_detached, pump.part_present
        return VACUUM_STATE.pack(self._message_id, *flags, GREEN, pump.power, round(pump.vacuum))


def tool_service(selector: selectors.BaseSelector, tool: Tool, ip: str, faults: NetworkFaults) -> HandService:
    """Return the service of a hand or vacuum gripper; arguments as for `HandService`. Raises HricError."""
    kind = VacuumService if isinstance(tool, VacuumGripper) else HandService
    return kind(selector, tool, ip, faults)
