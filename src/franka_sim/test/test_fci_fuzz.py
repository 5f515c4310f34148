"""Garbage on each port: the box neither ends nor hangs, and serves the next client."""

import random
import select
import struct
import subprocess
import time
from contextlib import suppress

import pytest
from fci_peer import ARM, HAND, PATIENCE, Peer, command, control_box

from franka_sim.fci.hand_service import PAYLOADS, VacuumService
from franka_sim.fci.server import PROTOCOLS

NORMAL, MANY = 300, 100000
amounts = pytest.mark.parametrize("n", [NORMAL, pytest.param(MANY, marks=pytest.mark.slow)])
RECOVERY = {5: 12, 10: 10}


class Garbage:
    """Source of random bytes, and of messages that were valid until they were changed at random."""

    def __init__(self, sizes: dict[int, int], header: struct.Struct, seed: int) -> None:
        self.random, self._sizes, self._header = random.Random(seed), sizes, header

    def message(self) -> bytes:
        kind = self.random.random()
        if kind < 0.1:
            return self.random.randbytes(self.random.randrange(1, 600))
        number = self.random.choice(list(self._sizes))
        payload = self._payload(self._sizes[number])
        whole = self._header.pack(number, self.random.randrange(2**32), self._header.size + len(payload)) + payload
        return whole if kind < 0.6 else self.mutated(whole)

    def _payload(self, size: int) -> bytes:
        if self.random.random() < 0.5 or size % 8:
            return self.random.randbytes(size)
        scale = self.random.choice([0.1, 1.0, 10.0, 1e9, 1e300])
        return struct.pack(f"<{size // 8}d", *(self.random.gauss(0.0, scale) for _ in range(size // 8)))

    def mutated(self, whole: bytes) -> bytes:
        """Return a message with some bytes changed, cut off or added."""
        data = bytearray(whole)
        for _ in range(self.random.randrange(1, 5)):
            data[self.random.randrange(len(data))] = self.random.randrange(256)
        cut = self.random.random()
        if cut < 0.2:
            return bytes(data[: self.random.randrange(1, len(data) + 1)])
        return bytes(data) + self.random.randbytes(self.random.randrange(20)) if cut < 0.3 else bytes(data)


def connected(ip: str, version: int, port: int) -> Peer:
    """Return a connected client; the box may need a moment to notice that the client before has disconnected."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return Peer(ip, version, port)
        except OSError:
            assert time.monotonic() < end, "the box does not take a client any more"


def throw(ip: str, version: int, port: int, garbage: Garbage, n: int) -> None:
    """n messages, over as many connections as the box ends; half of them shake hands first."""
    peer: Peer | None = None
    for k in range(n):
        if peer is None:
            peer = (
                connected(ip, version, port)
                if garbage.random.random() < 0.5
                else Peer(ip, version, port, connect=False)
            )
        try:
            peer.tcp.sendall(garbage.message())
            select.select([peer.tcp], [], [], 5e-4)  # mostly a response, or the end of the connection
            peer.tcp.setblocking(False)
            with suppress(BlockingIOError):
                while received := peer.tcp.recv(65536):
                    del received
                raise ConnectionError("closed by the box")
            peer.tcp.settimeout(PATIENCE)
        except ConnectionError:
            peer.close()
            peer = None
        if peer is not None and k % 50 == 49:
            peer.close()
            peer = None
    if peer is not None:
        peer.close()


def check_usable(ip: str, version: int) -> None:
    """Assert that a client gets states, can start a motion, and can use the hand."""
    with connected(ip, version, ARM) as peer:
        assert len(peer.state()) == PROTOCOLS[version].state.size
        assert peer.exchange(RECOVERY[version]) == b"\x00"
        motion = peer.move()
        assert peer.response(motion) == b"\x01"
        peer.until_moving()
        peer.finish()
        assert peer.response(motion) == b"\x00"
    with connected(ip, 3, HAND) as hand:
        assert len(hand.udp.recv(100)) == 23


@amounts
def test_garbage_on_the_port_of_the_vacuum_gripper(n: int) -> None:
    sizes = {number: payload.size for number, payload in VacuumService.payloads.items()}
    with control_box("--no-collision", "--vacuum") as (ip, process):
        throw(ip, 1, VacuumService.port, Garbage(sizes, struct.Struct("<HII"), 1), n)
        check_alive(process)
        with connected(ip, 1, VacuumService.port) as gripper:
            assert len(gripper.udp.recv(100)) == 16


def check_alive(process: subprocess.Popen[str]) -> None:
    assert process.poll() is None, "the control box has ended"


@amounts
@pytest.mark.parametrize("version", [5, 10])
def test_garbage_on_the_port_of_the_arm(version: int, n: int) -> None:
    sizes = {number: row.payload.size for number, row in PROTOCOLS[version].requests.items()}
    with control_box("--robot", "panda" if version == 5 else "fr3", "--real-time-factor", "0", "--no-collision") as (
        ip,
        process,
    ):
        throw(ip, version, ARM, Garbage(sizes, struct.Struct("<III"), version), n)
        check_alive(process)
        check_usable(ip, version)


@amounts
def test_garbage_on_the_port_of_the_hand(n: int) -> None:
    sizes = {number: payload.size for number, payload in PAYLOADS.items()}
    with control_box("--no-collision") as (ip, process):
        throw(ip, 3, HAND, Garbage(sizes, struct.Struct("<HII"), 1), n)
        check_alive(process)
        check_usable(ip, 5)


@amounts
@pytest.mark.parametrize("version", [5, 10])
def test_garbage_in_place_of_commands(version: int, n: int) -> None:
    codec = PROTOCOLS[version].command
    garbage = Garbage({0: codec.size}, struct.Struct("<III"), 7)
    with control_box("--robot", "panda" if version == 5 else "fr3", "--real-time-factor", "0", "--no-collision") as (
        ip,
        process,
    ):
        with connected(ip, version, ARM) as peer:
            for _ in range(n // 3):
                moving = peer.modes(peer.newest_state())[2] == 2
                if not moving:
                    peer.exchange(RECOVERY[version])
                    peer.move(*garbage.random.choice([(2, 0), (2, 1), (0, 0), (0, 1), (0, 2), (1, 3)]))
                good = codec.encode(peer.message_id, command(garbage.random.gauss(0.0, 1.0)))
                for datagram in (
                    garbage.mutated(good),
                    garbage.random.randbytes(garbage.random.randrange(1, 700)),
                    good[:8] + garbage.mutated(good[8:]),
                ):
                    peer.udp.sendto(datagram, peer.server)
        check_alive(process)
        check_usable(ip, version)
