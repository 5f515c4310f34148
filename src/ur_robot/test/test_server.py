"""Bounds of what clients cost the emulated controller, in process."""

import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress

import pytest
from fci_peer import new_address

from ur_robot.emulated.control_program import UrController
from ur_robot.emulated.server import MAX_CLIENTS, UrServer

HELLO = bytes((0, 5, ord("V"), 0, 2))


class Served:
    """Emulated controller, and the longest processor time that it took for a cycle [s]."""

    def __init__(self) -> None:
        self.ip, self.controller = new_address(), UrController([0.0] * 6, [(-6.0, 6.0, 3.0)] * 6)
        self.server, self.slowest = UrServer(self.controller, self.ip), 0.0

    def poll(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            begin = time.thread_time()
            self.server.poll(self.controller.state([0.0] * 6, [0.0] * 6, [0.0] * 6))
            self.slowest = max(self.slowest, time.thread_time() - begin)


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.server.close()


def test_a_crowd_of_silent_clients_is_bounded_and_locks_nobody_out(served: Served) -> None:
    with ExitStack() as stack:
        crowd = [stack.enter_context(socket.create_connection((served.ip, 30004), 5.0))]
        crowd[0].sendall(HELLO)
        for _ in range(3 * MAX_CLIENTS):
            served.poll()
            crowd.append(stack.enter_context(socket.create_connection((served.ip, 30004), 5.0)))
        served.poll(5)
        assert len(served.server._clients) == MAX_CLIENTS
        assert crowd[0].recv(4)[:3] == bytes((0, 4, ord("V")))
        crowd[-1].sendall(HELLO)
        served.poll()
        assert crowd[-1].recv(4)[:3] == bytes((0, 4, ord("V")))


def test_a_program_without_an_end_delays_no_cycle(served: Served) -> None:
    """Each cycle reads 1 KiB of it; at worst, the whole is searched for its end each time."""
    with socket.create_connection((served.ip, 30003), 5.0) as client:
        client.settimeout(0.0)
        rest = b"def rtde_control():\n" + b"x = 1\n" * 80_000
        while rest:
            with suppress(BlockingIOError):
                rest = rest[client.send(rest[:4096]) :]
            served.poll()
    assert served.slowest < 5e-3
