"""Network service of the arm: executes a client's requests, sends it states and passes its commands to the box."""

import math
import platform
import selectors
import struct
from collections.abc import Callable

from franka_hw_interface.robot_state import RobotMode
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome
from franka_sim.fci.clock import CycleClock, MotionPhase
from franka_sim.fci.complaints import LOG
from franka_sim.fci.connection import FciMessage
from franka_sim.fci.device import Device
from franka_sim.fci.faults import NetworkFaults
from franka_sim.fci.protocol import FciRequest, Protocol
from franka_sim.fci.session import Service
from franka_sim.fci.wire import ARM_FRAMING
from hric_core.errors import HricError

PORT = 1337
NO_CARTESIAN_LIMIT = bytes(153)
"""Response to GetCartesianLimit: size, frame and "active" of a virtual wall, all zero, as none is emulated."""

ARCHITECTURES = {"x86_64": 0, "i686": 1, "armv7l": 2, "aarch64": 3}
"""Processor architectures by platform name, with their numbers in LoadModelLibrary."""
LINUX = 0

Vectors = list[tuple[float, ...]]
_MESSAGE_ID = struct.Struct("<Q")


class ArmService(Service):
    """Service at the arm's port.

    A command must refer to the last state sent; commands for older states and repeated ones are dropped (libfranka,
    "the command is dropped if it is late"). In an asynchronous motion no command is late, since libfranka reads states
    only when its user requests the feedback; a command is dropped if it refers to an older state than the one before.

    Args:
        selector: selector of the server.
        protocol: protocol version.
        device: the robot.
        clock: clock that waits for the commands to this robot.
        ip: address to listen on.
        faults: faults of the UDP link.

    Attributes:
        message_id: milliseconds of robot time.
        late: number of commands dropped since the start as late or repeated.
    """

    def __init__(
        self,
        selector: selectors.BaseSelector,
        protocol: Protocol,
        device: Device,
        clock: CycleClock,
        ip: str,
        faults: NetworkFaults,
    ) -> None:
        self._protocol, self._device, self._clock = protocol, device, clock
        self.message_id = self.late = 0
        self._command: MotionCommand | None = None
        self._moving: FciMessage | None = None
        self._started = self._asynchronous = False
        self._oldest = 0  # message_id of the oldest state to which the command of an asynchronous motion may refer
        self._stopping: list[FciMessage] = []
        self._recovering: list[FciMessage] = []
        self._handlers = self._make_handlers()
        super().__init__(selector, "arm", ARM_FRAMING, protocol.version, (ip, PORT), faults)

    def _make_handlers(self) -> dict[FciRequest, Callable[[FciMessage, Vectors], RequestOutcome | None]]:
        device = self._device
        return {
            FciRequest.MOVE: self._move,
            FciRequest.STOP_MOVE: lambda message, _: self._when_done(self._stopping, message, device.stop_move()),
            FciRequest.GET_CARTESIAN_LIMIT: lambda _, __: RequestOutcome.SUCCESS,
            FciRequest.SET_COLLISION_BEHAVIOR: lambda _, vectors: device.set_collision_behavior(*vectors),
            FciRequest.SET_JOINT_IMPEDANCE: lambda _, vectors: device.set_joint_impedance(vectors[0]),
            FciRequest.SET_CARTESIAN_IMPEDANCE: lambda _, vectors: device.set_cartesian_impedance(vectors[0]),
            FciRequest.SET_GUIDING_MODE: lambda _, vectors: device.set_guiding_mode(
                [bool(x) for x in vectors[0]], bool(vectors[1][0])
            ),
            FciRequest.SET_EE_TO_K: lambda _, vectors: device.set_EE_T_K(vectors[0]),
            FciRequest.SET_NE_TO_EE: lambda _, vectors: device.set_NE_T_EE(vectors[0]),
            FciRequest.SET_LOAD: lambda _, vectors: device.set_load(vectors[0][0], vectors[1], vectors[2]),
            FciRequest.SET_FILTERS: lambda _, vectors: device.set_filters(vectors[0]),
            FciRequest.AUTOMATIC_ERROR_RECOVERY: lambda message, _: self._when_done(
                self._recovering, message, device.recover()
            ),
            FciRequest.LOAD_MODEL_LIBRARY: self._load_model_library,
            FciRequest.GET_ROBOT_MODEL: self._robot_model,
        }

    @property
    def phase(self) -> MotionPhase:
        """Present phase of the motion, by which the clock decides what to wait for."""
        if self._moving is None or self._asynchronous:
            return MotionPhase.IDLE
        if self._command is not None:
            return MotionPhase.ARRIVED
        return MotionPhase.AWAITING if self._started else MotionPhase.STARTING

    def size_of(self, command: int) -> int | None:
        """Return the payload size of a request [bytes], None if there is no request with this id."""
        row = self._protocol.requests.get(command)
        return None if row is None else row.payload.size

    # -- the millisecond -----------------------------------------------------------------------------------------------

    def on_datagrams(self) -> None:
        """Receive commands and store the one for the last state sent."""
        if self.client is None:
            return
        codec = self._protocol.command
        for datagram in self.client.link.receive():
            if len(datagram) != codec.size:
                self.complaints.warn(
                    "size", f"a command datagram of {len(datagram)} bytes is dropped; expected {codec.size} bytes"
                )
            elif self._moving is not None and self._current(_MESSAGE_ID.unpack_from(datagram)[0]):
                self._oldest, self._command = codec.decode(datagram)
            else:
                self.late += 1

    def _current(self, message_id: int) -> bool:
        """Return True if a command that refers to this state is accepted."""
        return message_id == self.message_id or (self._asynchronous and self._oldest <= message_id < self.message_id)

    def left(self, now: float) -> float:
        """Return the time to wait for this robot before the next cycle [s]; now: time.monotonic [s]."""
        return self._clock.left(now, self.phase)

    def take_command(self, now: float) -> MotionCommand | None:
        """Return the command for the cycle that starts now, None without one; now: time.monotonic [s]."""
        self._clock.ticked(now, self.phase)
        command, self._command = self._command, None
        self._started = self._moving is not None and (self._started or command is not None)
        return command

    def send_state(self) -> None:
        """Send the state of the robot after a cycle to the client, and the responses that became due."""
        self.message_id += 1
        if self.client is not None:
            self.client.link.send(self._device.encode(self._protocol.state, self.message_id))
        self._report()

    def _report(self) -> None:
        """Send the responses of requests whose motion, stop or recovery has ended."""
        outcome = self._device.take_finished()
        if outcome is not None and self._moving is not None:
            message, self._moving, self._command = self._moving, None, None
            self._oldest = self.message_id
            self._respond(message, outcome)
        if self._stopping and self._moving is None:
            self._respond_all(self._stopping)
        if self._recovering and self._device.state.robot_mode is not RobotMode.AUTOMATIC_ERROR_RECOVERY:
            self._respond_all(self._recovering)

    # -- requests ------------------------------------------------------------------------------------------------------

    def handle(self, message: FciMessage) -> None:
        """Execute a request between two cycles; wrong values get an error status, with the reason in the log."""
        row = self._protocol.requests[message.command]
        vectors = row.decode(message.payload)
        try:
            if not all(math.isfinite(x) for vector in vectors for x in vector):
                raise HricError("a value in the request is not finite")
            outcome = self._handlers[row.request](message, vectors)
        except (HricError, ArithmeticError, ValueError) as error:  # e.g. numbers so large that the arithmetic overflows
            self.complaints.warn(row.request.value, f"{row.request.value} refused: {error}")
            outcome = RequestOutcome.INVALID_ARGUMENT
        if outcome is not None:
            tail = NO_CARTESIAN_LIMIT if row.request is FciRequest.GET_CARTESIAN_LIMIT else b""
            self._respond(message, outcome, tail)

    def _respond(self, message: FciMessage, outcome: RequestOutcome, tail: bytes = b"") -> None:
        request = self._protocol.requests[message.command].request
        self.respond(message, self._protocol.status(request, outcome), tail)

    def _respond_all(self, messages: list[FciMessage]) -> None:
        waiting, messages[:] = messages[:], []
        for message in waiting:
            self._respond(message, RequestOutcome.SUCCESS)

    def _move(self, message: FciMessage, vectors: Vectors) -> RequestOutcome:
        try:
            # The request counts generators from 0, the state from 1 (0 is idle).
            controller, generator = ControllerMode(int(vectors[0][0])), GeneratorMode(int(vectors[1][0]) + 1)
        except ValueError:
            raise HricError(
                f"unknown mode: controller number {vectors[0][0]}, motion generator number {vectors[1][0]}"
            ) from None
        if controller is ControllerMode.OTHER or (generator is GeneratorMode.NONE and self._protocol.version < 7):
            raise HricError(f"a motion cannot have controller {controller.name} with motion generator {generator.name}")
        path, goal = vectors[2], vectors[3]
        maximum_velocity = vectors[5] if len(vectors) > 4 and vectors[4][0] else None
        outcome = self._device.move(
            MoveRequest(
                controller, generator, (path[0], path[1], path[2]), (goal[0], goal[1], goal[2]), maximum_velocity
            )
        )
        if outcome is RequestOutcome.STARTED:
            self._moving, self._started, self._command = message, False, None
            self._asynchronous = maximum_velocity is not None
        return outcome

    def _when_done(
        self, waiting: list[FciMessage], message: FciMessage, outcome: RequestOutcome
    ) -> RequestOutcome | None:
        """Delay the response to a stop or recovery until it has ended; an aborted Move gets its response first."""
        if outcome is not RequestOutcome.SUCCESS:
            return outcome
        waiting.append(message)
        self._report()
        return None

    def _load_model_library(self, message: FciMessage, vectors: Vectors) -> RequestOutcome | None:
        library, machine = self._device.model_library, platform.machine()
        if (int(vectors[0][0]), int(vectors[1][0])) != (ARCHITECTURES.get(machine), LINUX):
            refusal = f"it exists for this machine ({machine} Linux) only"
        elif library is None:
            refusal = "this robot has none"
        else:
            self._respond(message, RequestOutcome.SUCCESS, library)
            return None
        LOG.error("%s %s: model library refused: %s", self.name, self._address[0], refusal)
        return RequestOutcome.NOT_POSSIBLE

    def _robot_model(self, message: FciMessage, _: Vectors) -> RequestOutcome | None:
        self.respond(message, 0, self._device.urdf().encode())
        return None

    # -- clients -------------------------------------------------------------------------------------------------------

    def on_client(self) -> None:
        """Discard commands of earlier clients; states are sent from the next cycle on."""
        self._oldest = self.message_id

    def on_client_lost(self) -> None:
        """Abort the motion of a client whose connection ended, and drop its pending requests."""
        for messages in (self._stopping, self._recovering):
            messages.clear()
        self._moving = self._command = None
        self._device.connection_lost()
        self._device.take_finished()
