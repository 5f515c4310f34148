"""UDP link to a client, fault-free or with injected latency, jitter and loss."""

import heapq
import random
import socket
import time
from dataclasses import dataclass

from hric_core.parameters import Settings, number, whole

MAX_DATAGRAM = 512
"""Maximum number of bytes read from a datagram; larger than any valid command."""
MAX_READ = 64
"""Maximum number of datagrams read at a time, so that a flood does not delay the robot."""
MAX_UNDERWAY = 10000
"""Maximum number of datagrams in transit per direction of the emulated network; further ones are lost."""


@dataclass(frozen=True)
class NetworkFaults(Settings):
    """Faults of the emulated network, in each direction."""

    latency: float = number(0.0, minimum=0.0, unit="s")
    jitter: float = number(
        0.0,
        minimum=0.0,
        unit="s",
        text="maximum random delay in addition to the latency, evenly distributed; datagrams may overtake each other",
    )
    loss: float = number(0.0, minimum=0.0, maximum=1.0, text="share of datagrams that are lost")
    seed: int = whole(0, text="seed of the random numbers")

    @property
    def any(self) -> bool:
        """True if there is any fault to inject."""
        return self.latency > 0.0 or self.jitter > 0.0 or self.loss > 0.0


class DatagramLink:
    """Datagrams between server and one client, on a connected socket: the system drops those of other senders.

    Args:
        ip: the server's address.
        client: the client's (address, port).
    """

    def __init__(self, ip: str, client: tuple[str, int]) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.setblocking(False)
            self.socket.bind((ip, 0))
            self.socket.connect(client)
        except OSError:
            self.socket.close()
            raise

    def send(self, datagram: bytes) -> None:
        """Send a datagram; if that fails, it counts as lost, since the TCP connection shows that a client has left."""
        try:
            self.socket.send(datagram)
        except OSError:
            return

    def receive(self) -> list[bytes]:
        """Return the received datagrams, oldest first."""
        received: list[bytes] = []
        for _ in range(MAX_READ):
            try:
                received.append(self.socket.recv(MAX_DATAGRAM))
            except ConnectionRefusedError:  # an earlier state was sent to a socket that the client had closed
                continue
            except OSError:
                break
        return received

    def next_due(self) -> float | None:
        """Return the time (time.monotonic) [s] at which a delayed datagram is due; None: none is delayed."""
        return None

    def move(self) -> bool:
        """Forward delayed datagrams that are due; return True if one has arrived at the server."""
        return False

    def close(self) -> None:
        """Close the socket."""
        self.socket.close()


class _Network:
    """One direction of the emulated network: datagrams in transit, by their time of arrival."""

    def __init__(self, faults: NetworkFaults, seed: str) -> None:
        self._faults, self._random = faults, random.Random(seed)
        self.underway: list[tuple[float, int, bytes]] = []
        self._count = 0

    def take(self, datagram: bytes) -> None:
        if self._random.random() < self._faults.loss or len(self.underway) >= MAX_UNDERWAY:
            return
        due = time.monotonic() + self._faults.latency + self._random.random() * self._faults.jitter
        self._count += 1
        heapq.heappush(self.underway, (due, self._count, datagram))

    def due(self) -> list[bytes]:
        now, arrived = time.monotonic(), []
        while self.underway and self.underway[0][0] <= now:
            arrived.append(heapq.heappop(self.underway)[2])
        return arrived


class FaultyLink(DatagramLink):
    """Link over an emulated network with latency, jitter and loss; the same seed loses the same datagrams.

    Args:
        ip: the server's address.
        client: the client's (address, port).
        faults: faults to inject.
    """

    def __init__(self, ip: str, client: tuple[str, int], faults: NetworkFaults) -> None:
        super().__init__(ip, client)
        self._out, self._in = _Network(faults, f"{faults.seed} states"), _Network(faults, f"{faults.seed} commands")

    def send(self, datagram: bytes) -> None:
        """Put a datagram into the emulated network."""
        self._out.take(datagram)
        self.move()

    def receive(self) -> list[bytes]:
        """Return the datagrams that have arrived through the emulated network."""
        for datagram in super().receive():
            self._in.take(datagram)
        return self._in.due()

    def next_due(self) -> float | None:
        """Return the time at which the next datagram arrives at either end, None without one."""
        return min((network.underway[0][0] for network in (self._out, self._in) if network.underway), default=None)

    def move(self) -> bool:
        """Send the states that are due; return True if a command is due."""
        for datagram in self._out.due():
            super().send(datagram)
        return bool(self._in.underway) and self._in.underway[0][0] <= time.monotonic()


def make_link(ip: str, client: tuple[str, int], faults: NetworkFaults) -> DatagramLink:
    """Return a UDP link from the server at `ip` to the client's (address, port) with these faults. Raises OSError."""
    return FaultyLink(ip, client, faults) if faults.any else DatagramLink(ip, client)
