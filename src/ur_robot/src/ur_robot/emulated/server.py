"""TCP server of the emulated controller: RTDE, script port and dashboard; polled once per cycle, never waiting."""

import logging
import re
import selectors
import socket
import struct
from collections.abc import Callable, Mapping
from typing import Any

from hric_core.errors import FailureError
from ur_robot.emulated import rtde
from ur_robot.emulated.control_program import Runtime, UrController
from ur_robot.emulated.rtde import Package, Recipe, RtdeError, Value, unpacked

LOG = logging.getLogger("hric.ur")
VERSION = (5, 23, 0, 0)
"""Version of PolyScope that is emulated: major, minor, bugfix, build."""
RECEIVE = 1 << 10
"""Largest amount that is read of a client per cycle [bytes], so that one that floods the server delays itself; ur_rtde
sends less than 200 (project default, unconfirmed)."""
LARGEST_PROGRAM = 1 << 20
"""Largest program [bytes]; ur_rtde's has 60 kB (project default, unconfirmed)."""
MAX_CLIENTS = 64
"""Largest number of clients; beyond it, the oldest one that has sent nothing is disconnected, or else the new one
(project default, unconfirmed)."""
LONGEST_LINE = 1024
"""Longest dashboard command [bytes] (project default, unconfirmed)."""
MAX_UNSENT = 1 << 16
"""Largest amount of responses that a client leaves unread [bytes] (project default, unconfirmed)."""


class RtdeSession:
    """RTDE connection of one client.

    Args:
        controller: the emulated controller.
        owners: sessions by the names of the input variables that they write; shared by all sessions.
    """

    greeting = b""

    def __init__(self, controller: UrController, owners: dict[str, "RtdeSession"]) -> None:
        self._controller, self._owners = controller, owners
        self._outputs: Recipe | None = None
        self._inputs: list[Recipe] = []
        self._interval, self._started = 1, False
        self._responses: dict[int, Callable[[bytes], bytes]] = {
            Package.VERSION: self._version,
            Package.CONTROLLER: lambda _: struct.pack(">4I", *VERSION),
            Package.OUTPUTS: self._set_outputs,
            Package.INPUTS: self._add_inputs,
            Package.START: lambda _: self._start(self._outputs is not None),
            Package.PAUSE: lambda _: bytes([not self._start(False)[0]]),
        }

    def feed(self, received: bytearray) -> bytes:
        """Process the complete packages, remove them, and return the responses. Raises RtdeError."""
        responses = b""
        for kind, payload in rtde.packages(received):
            if kind == Package.DATA:
                self._take(payload)
            elif kind in self._responses:
                responses += rtde.package(Package(kind), self._responses[kind](payload))
            else:
                raise RtdeError(f"a package of type {kind}; valid: {', '.join(str(int(one)) for one in Package)}")
        return responses

    def state(self, cycle: int, values: Mapping[str, Value]) -> bytes:
        """Return the package of a state, empty if none is due in this cycle."""
        if not self._started or self._outputs is None or cycle % self._interval:
            return b""
        return rtde.package(Package.DATA, b"\x01" + self._outputs.pack(values))

    def close(self) -> None:
        """Free the input variables that this client writes."""
        for name in [name for name, owner in self._owners.items() if owner is self]:
            del self._owners[name]

    def _version(self, payload: bytes) -> bytes:
        return bytes([unpacked(struct.Struct(">H"), payload, "a protocol version")[0] == rtde.PROTOCOL])

    def _start(self, started: bool) -> bytes:
        self._started = started
        return bytes([started])

    def _set_outputs(self, payload: bytes) -> bytes:
        (rate,) = unpacked(struct.Struct(">d"), payload[:8], "an output rate")
        if not 1.0 <= rate <= rtde.CYCLE_RATE:
            raise RtdeError(f"an output rate of {rate} Hz; valid: 1 to {rtde.CYCLE_RATE:g} Hz")
        recipe = Recipe(payload[8:], rtde.OUTPUTS)
        self._interval, self._outputs = round(rtde.CYCLE_RATE / rate), recipe if recipe.valid else None
        return bytes([recipe.valid]) + ",".join(recipe.types).encode()

    def _add_inputs(self, payload: bytes) -> bytes:
        recipe = Recipe(payload, rtde.INPUTS)
        used = [self._owners.get(name, self) is not self for name in recipe.names]
        types = ["IN_USE" if taken else kind for taken, kind in zip(used, recipe.types, strict=True)]
        if not recipe.valid or any(used) or len(self._inputs) == 255:
            return b"\x00" + ",".join(types).encode()
        self._owners.update(dict.fromkeys(recipe.names, self))
        self._inputs.append(recipe)
        return bytes([len(self._inputs)]) + ",".join(types).encode()

    def _take(self, payload: bytes) -> None:
        number = payload[0] if payload else 0
        if not 1 <= number <= len(self._inputs):
            raise RtdeError(f"inputs of recipe {number}, but has set up {len(self._inputs)} recipes, numbered from 1")
        self._controller.write(self._inputs[number - 1].unpack(payload[1:]))


class ScriptSession:
    """Connection to the script port, which accepts ur_rtde's control program only; `controller`: the emulated one."""

    greeting = b""
    _program = re.compile(rb"def rtde_control\(\):\n.*?\nend\n", re.DOTALL)
    _offset = re.compile(rb"reg_offset_int = # int register offset\n(\d+)")

    def __init__(self, controller: UrController) -> None:
        self._controller = controller

    def feed(self, received: bytearray) -> bytes:
        """Start the program when it is complete. Raises RtdeError for another program."""
        if len(received) > LARGEST_PROGRAM or not b"def rtde_control():\n".startswith(received[:20]):
            raise RtdeError("a program that is not ur_rtde's control script; no other URScript is emulated")
        if b"\nend\n" in received and (program := self._program.match(received)):
            offset = self._offset.search(program[0])
            if offset is None or int(offset[1]) not in (0, 24):
                raise RtdeError("a control script without a register offset of 0 or 24, as ur_rtde 1.6 writes it")
            del received[: program.end()]
            self._controller.start_program(int(offset[1]))
        return b""


class DashboardSession:
    """Connection to the dashboard server; responses as in "Dashboard Server e-Series, port 29999" of the manufacturer.

    Args:
        controller: the emulated controller.
    """

    greeting = b"Connected: Universal Robots Dashboard Server\n"

    def __init__(self, controller: UrController) -> None:
        self._controller = controller

    def feed(self, received: bytearray) -> bytes:
        """Respond to the complete lines. Raises RtdeError for a line that is too long."""
        *lines, rest = bytes(received).split(b"\n")
        if len(rest) > LONGEST_LINE:
            raise RtdeError(f"a line of more than {LONGEST_LINE} bytes")
        received[:] = rest
        return "".join(self._response(line.decode("ascii", "replace").strip()) + "\n" for line in lines).encode()

    def _response(self, line: str) -> str:
        controller = self._controller
        playing = controller.runtime is Runtime.PLAYING
        mode = "PROTECTIVE_STOP" if controller.stop_reason else "NORMAL"
        if line == "stop":
            controller.end_program("dashboard")
        if line == "unlock protective stop":
            return (
                "Protective stop releasing"
                if controller.unlock()
                else (
                    "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop "
                    "before unlocking"
                )
            )
        fixed = {
            "PolyscopeVersion": f"URSoftware {'.'.join(map(str, VERSION))} (emulated)",
            "get serial number": "0",
            "is in remote control": "true",
            "running": f"Program running: {str(playing).lower()}",
            "robotmode": "Robotmode: RUNNING",
            "safetymode": f"Safetymode: {mode}",
            "safetystatus": f"Safetystatus: {mode}",
            "programState": f"{controller.runtime.name} rtde_control",
            "stop": "Stopped",
        }
        return fixed.get(line, f"could not understand: '{line}'")


Session = RtdeSession | ScriptSession | DashboardSession


class _Client:
    """Connected client: socket, session, and the bytes that were not processed or not sent yet."""

    def __init__(self, connected: socket.socket, session: Session) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket, self.session = connected, session
        self.received, self.unsent = bytearray(), bytearray(session.greeting)
        self.silent = True

    def receive(self) -> None:
        """Process what has arrived. Raises RtdeError, or OSError if the client is gone."""
        data = self.socket.recv(RECEIVE)
        if not data:
            raise ConnectionResetError("closed by the client")
        self.silent = False
        self.received += data
        self.unsent += self.session.feed(self.received)
        if len(self.unsent) > MAX_UNSENT:
            raise RtdeError(f"requests without reading the responses ({len(self.unsent)} bytes; valid: {MAX_UNSENT})")

    def send(self) -> None:
        """Send the waiting responses and states. Raises OSError if the client is gone."""
        try:
            while self.unsent:
                del self.unsent[: self.socket.send(self.unsent)]
        except BlockingIOError:
            pass


class UrServer:
    """Server of an emulated controller for any number of clients, on the ports of a real one.

    Args:
        controller: the emulated controller.
        ip: address to listen on.

    Raises:
        FailureError: a port is not available.
    """

    def __init__(self, controller: UrController, ip: str) -> None:
        self._controller, self._cycle = controller, 0
        self._selector = selectors.DefaultSelector()
        self._clients: list[_Client] = []
        self._listeners: list[socket.socket] = []
        owners: dict[str, RtdeSession] = {}
        sessions: dict[int, Callable[[], Session]] = {
            30004: lambda: RtdeSession(controller, owners),
            30003: lambda: ScriptSession(controller),
            29999: lambda: DashboardSession(controller),
        }
        try:
            for port, session in sessions.items():
                self._listen(ip, port, session)
        except OSError as error:
            self.close()
            raise FailureError(f"cannot listen at {ip}:{port}: {error.strerror}") from error

    def _listen(self, ip: str, port: int, session: Callable[[], Session]) -> None:
        listener = socket.create_server((ip, port))
        listener.setblocking(False)
        self._listeners.append(listener)
        self._selector.register(listener, selectors.EVENT_READ, session)

    def poll(self, values: Mapping[str, Value]) -> None:
        """Process what has arrived, and send the state of this cycle; `values`: its variables by name."""
        for key, _ in self._selector.select(0):
            if isinstance(key.data, _Client):
                self._guarded(key.data, key.data.receive)
            else:
                self._accept(key.fileobj, key.data)
        self._cycle += 1
        for client in self._clients[:]:
            # A client that reads slowly misses states, as with a real controller.
            if isinstance(client.session, RtdeSession) and not client.unsent:
                client.unsent += client.session.state(self._cycle, values)
            self._guarded(client, client.send)

    def _accept(self, listener: Any, session: Callable[[], Session]) -> None:
        try:
            client = _Client(listener.accept()[0], session())
        except OSError:
            return
        self._clients.append(client)
        self._selector.register(client.socket, selectors.EVENT_READ, client)
        if len(self._clients) > MAX_CLIENTS:
            self._drop(next((one for one in self._clients if one.silent), client))

    def _guarded(self, client: _Client, call: Callable[[], None]) -> None:
        if client not in self._clients:
            return
        try:
            call()
        except BlockingIOError:
            return
        except (OSError, RtdeError) as error:
            if isinstance(error, RtdeError):
                LOG.error("a client of port %d sent %s; disconnected", client.socket.getsockname()[1], error)
            self._drop(client)

    def _drop(self, client: _Client) -> None:
        self._clients.remove(client)
        self._selector.unregister(client.socket)
        client.socket.close()
        if isinstance(client.session, RtdeSession):
            client.session.close()

    def close(self) -> None:
        """Disconnect all clients and free the ports."""
        for client in self._clients[:]:
            self._drop(client)
        for listener in self._listeners:
            listener.close()
        self._selector.close()
