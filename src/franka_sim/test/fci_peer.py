"""A client of the control box in plain Python, and servers to connect it to."""

import itertools
import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from franka_sim.box.requests import MotionCommand
from franka_sim.fci.device import Device
from franka_sim.fci.server import PROTOCOLS, FciArm, FciServer
from franka_sim.fci.wire import ARM_FRAMING, HAND_FRAMING, Framing

ARM, HAND = 1337, 1338
PATIENCE = 30.0
"""Nothing may take longer [s]."""
CONTROL_BOX = Path(__file__).parents[1] / "nodes" / "control_box"
_counter = itertools.count(os.getpid() * 4999)


def new_address() -> str:
    """Return a loopback address that no other test uses at present."""
    n = next(_counter) % (120 * 250 * 250)
    return f"127.{100 + n // 62500}.{n // 250 % 250 + 2}.{n % 250 + 2}"


def command(tau: float = 0.0, finished: bool = False, **fields: Any) -> MotionCommand:
    """Return a command with seven equal torques, or with the given `fields`."""
    values: dict[str, Any] = {
        "q": [0.0] * 7,
        "dq": [0.0] * 7,
        "O_T_EE": [0.0] * 16,
        "O_dP_EE": [0.0] * 6,
        "elbow": None,
        "tau": [tau] * 7,
    }
    return MotionCommand(**(values | fields), finished=finished)


class Peer:
    """Client that connects, sends requests and commands, and receives states."""

    def __init__(self, ip: str, version: int = 5, port: int = ARM, connect: bool = True) -> None:
        self.ip, self.version = ip, version
        self.framing: Framing = ARM_FRAMING if port == ARM else HAND_FRAMING
        self.protocol = PROTOCOLS.get(version)
        self.tcp = socket.create_connection((ip, port), PATIENCE)
        self.tcp.settimeout(PATIENCE)
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.bind(("127.0.0.1", 0))
        self.udp.settimeout(PATIENCE)
        self.server: tuple[str, int] = (ip, 0)
        self.message_id = 0
        self._ids = itertools.count()
        self._responses: dict[int, list[bytes]] = {}
        if connect:
            response = self.exchange(0, struct.pack("<HH", version, self.udp.getsockname()[1]))
            assert response[: self.framing.status.size] == bytes(self.framing.status.size), (
                f"not connected: {response.hex()}"
            )

    def __enter__(self) -> "Peer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.tcp.close()
        self.udp.close()

    def request(self, number: int, payload: bytes = b"") -> int:
        command_id = next(self._ids)
        self.tcp.sendall(self.framing.frame(number, command_id, payload))
        return command_id

    def response(self, command_id: int) -> bytes:
        while not self._responses.get(command_id):
            size_of_header = self.framing.header.size
            header = self._exactly(size_of_header)
            _, got, size = self.framing.header.unpack(header)
            self._responses.setdefault(got, []).append(self._exactly(size - size_of_header))
        return self._responses[command_id].pop(0)

    def _exactly(self, n: int) -> bytes:
        data = b""
        while len(data) < n:
            part = self.tcp.recv(n - len(data))
            if not part:
                raise ConnectionError("closed by the server")
            data += part
        return data

    def exchange(self, number: int, payload: bytes = b"") -> bytes:
        return self.response(self.request(number, payload))

    def state(self) -> bytes:
        datagram, self.server = self.udp.recvfrom(4096)
        self.message_id = struct.unpack_from("<Q", datagram)[0]
        return datagram

    def newest_state(self) -> bytes:
        datagram = self.state()
        self.udp.setblocking(False)
        try:
            while True:
                datagram = self.state()
        except BlockingIOError:
            return datagram
        finally:
            self.udp.settimeout(PATIENCE)

    def send(self, motion: MotionCommand, message_id: int | None = None) -> None:
        assert self.protocol is not None
        self.udp.sendto(
            self.protocol.command.encode(self.message_id if message_id is None else message_id, motion), self.server
        )

    def move(self, controller: int = 2, generator: int = 1) -> int:
        """Request a motion; the caller has to receive the response."""
        payload = struct.pack("<II6d", controller, generator, 10.0, 3.12, 6.28, 10.0, 3.12, 6.28)
        return self.request(1, payload + (bytes(57) if self.version == 10 else b""))

    def modes(self, datagram: bytes) -> tuple[int, int, int]:
        """Return (motion generator mode, controller mode, robot mode) of a state."""
        at = 2280 if self.version == 5 else 1288
        return datagram[at], datagram[at + 1], datagram[at + 84]

    def flags(self, datagram: bytes) -> tuple[bytes, bytes]:
        """Return (errors, reflex reasons) of a state."""
        at = (2280 if self.version == 5 else 1288) + 2
        return datagram[at : at + 41], datagram[at + 41 : at + 82]

    def until_moving(self) -> None:
        while self.modes(self.state())[2] != 2:
            pass
        self.state()

    def until_modes(self, *modes: int) -> bool:
        """Read states until one shows these modes, or only the robot mode if one is given; False when none does in
        time."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if self.modes(self.state())[-len(modes) :] == modes:
                return True
        return False

    def finish(self) -> None:
        """Send commands with motion_generation_finished until the state shows the end of the motion."""
        while True:
            self.send(command(finished=True))
            if self.modes(self.state())[2] != 2:
                return


@contextmanager
def serving(device: Device, version: int = 5, **arguments: Any) -> Iterator[str]:
    """Run a server in a thread; yield its address."""
    ip = new_address()
    with running(FciServer([FciArm(device, ip, version)], **arguments)):
        yield ip


@contextmanager
def running(server: FciServer) -> Iterator[None]:
    """Run a server in a thread, and close it."""
    failure: list[BaseException] = []

    def run() -> None:
        try:
            server.run()
        except BaseException as error:
            failure.append(error)

    thread = threading.Thread(target=run, name="server")
    thread.start()
    try:
        yield
    finally:
        server.stop()
        thread.join(PATIENCE)
        alive = thread.is_alive()
        server.close()
        assert not failure, f"the server died of {failure[0]!r}"
        assert not alive, "the server hangs"


@contextmanager
def control_box(*words: str, ip: str = "") -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Run the command `control_box` as a process; yield its address and the process."""
    ip = ip or new_address()
    with tempfile.TemporaryFile("w+") as log:  # a pipe that nobody reads would fill
        process = subprocess.Popen(
            [sys.executable, str(CONTROL_BOX), "--ip", ip, *words], stdin=subprocess.PIPE, stderr=log, text=True
        )
        process.stderr = log  # so that it can be read
        try:
            wait_until_up(ip, process)
            yield ip, process
        finally:
            process.kill()
            process.stderr = None
            process.communicate()


def log_of(process: subprocess.Popen[str]) -> str:
    """Return the output of a control box so far."""
    assert process.stderr is not None
    process.stderr.seek(0)
    return process.stderr.read()


def wait_for_log(process: subprocess.Popen[str], text: str) -> None:
    """Wait until the output of the control box contains a text."""
    end = time.monotonic() + PATIENCE
    while text not in log_of(process):
        assert time.monotonic() < end, f"{text!r} is not in the log:\n{log_of(process)}"
        time.sleep(0.01)


def wait_until_up(ip: str, process: subprocess.Popen[str], limit: float = 60.0) -> None:
    end = time.monotonic() + limit
    while time.monotonic() < end:
        if process.poll() is not None:
            raise AssertionError(f"the control box ended: {log_of(process)}")
        try:
            Peer(ip, connect=False).close()
            return
        except OSError:
            time.sleep(0.05)
    raise AssertionError(f"the control box at {ip} does not listen")


def run_client(script: str, *words: str, limit: float = 60.0) -> str:
    """Run a client in a process of its own (libfranka's bindings keep the interpreter lock); return its output."""
    done = subprocess.run(
        [sys.executable, "-c", script, *words], capture_output=True, text=True, timeout=limit, check=False
    )
    assert done.returncode == 0, f"the client failed:\n{done.stdout}\n{done.stderr}"
    return done.stdout
