"""A client's session and an emulated Motive on a simulated network: no sockets, no waiting, reproducible."""

import heapq
import itertools

import numpy as np

from mocap_natnet.client import ClientSettings as ClientSettings
from mocap_natnet.client import Received, Session
from mocap_natnet.server import Motive, MotiveSettings, SceneBody, ServedScene, SinusoidSource

NS = 1_000_000_000
CLIENT = ("10.0.0.2", 50000)
START = 7_000 * NS
"""Time of the client's clock when the stream begins [ns]."""


def one_body(**settings: object) -> Motive:
    return Motive(MotiveSettings(**settings), ServedScene((SceneBody("marker", SinusoidSource()),)))


class Link:
    """Simulated network that advances session and Motive in steps of a millisecond.

    Args:
        motive: the server, whose stream begins at time 0; may be replaced while running.
        settings: of the client.
        transit: mean and scatter of the way of a datagram [s].
        keep: passes a datagram to the client, changed or not; None loses it.
    """

    def __init__(
        self, motive: Motive, settings: ClientSettings | None = None, transit: tuple[float, float] = (30e-6, 0.0)
    ) -> None:
        self.motive = motive
        self.frames: list[Received] = []
        self.restarts = 0
        self.session = Session(settings or ClientSettings(), self.frames.append, on_restart=self._restarted)
        self.keep = lambda datagram: datagram
        self.serving = True
        self.time = 0.0
        self.begin = 0.0
        self._number = 0
        self._order = itertools.count()
        self._queue: list[tuple[float, int, str, bytes]] = []
        self._transit, self._random = transit, np.random.default_rng(0)

    @property
    def now(self) -> int:
        return START + round(self.time * NS)

    def replace(self, motive: Motive) -> None:
        """Replace the server by another one, whose stream begins at 0."""
        self.motive, self.begin, self._number = motive, self.time, 0

    def run(self, seconds: float) -> None:
        end = self.time + seconds
        while self.time < end:
            self._step()

    def _restarted(self) -> None:
        self.restarts += 1

    def _send(self, at: float, to: str, datagram: bytes) -> None:
        mean, scatter = self._transit
        delay = mean + (float(self._random.exponential(scatter)) if scatter else 0.0)
        heapq.heappush(self._queue, (at + delay, next(self._order), to, datagram))

    def _step(self) -> None:
        for datagram in self.session.poll(self.now):
            self._send(self.time, "server", datagram)
        motive, period = self.motive, self.motive.settings.period
        stream = self.time - self.begin
        while self.serving and (delay := motive.delay(self._number) or 0.0) + self._number * period <= stream + 0.001:
            due = self.begin + self._number * period + delay
            for datagram, _ in motive.stream(motive.frame(self._number), due - self.begin):
                self._send(due, "client", datagram)
            self._number += 1
        following = self.time + 0.001
        while self._queue and self._queue[0][0] <= following:
            at, _, to, datagram = heapq.heappop(self._queue)
            self.time = max(self.time, at)
            if to == "server":
                for answer, _ in motive.respond(datagram, CLIENT, at - self.begin) if self.serving else ():
                    self._send(at, "client", answer)
            elif (kept := self.keep(datagram)) is not None:
                self.session.receive(kept, self.now)
        self.time = following
