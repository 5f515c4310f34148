"""The emulated Motive and the publisher in one process, without sockets: through the same encoder and decoder, the same
for each seed."""

import math
from collections import deque

from hric_control.errors import ParameterError
from mocap_natnet.client import Received
from mocap_natnet.codec import Codec
from mocap_natnet.node.publisher import MocapPublisher
from mocap_natnet.server import Motive

NS = 1_000_000_000
STAMP = 1.0 / NS
"""To how much the stamp of a message is the time that it means [s]."""


class HeadlessMocap:
    """Publishes each frame when its latency is over, at the time of the run. The publisher's `robot_time` is
    `headless.robot_time`.

    A source that looks at a simulation is called at the first `advance` that reaches the middle of the exposure.

    Args:
        motive: what is seen.
        publisher: publishes what is seen.
        begin: time of the run at which the stream begins [s].

    Raises:
        ParameterError: the emulated Motive delays frames by another time each, which would put them out of order.
    """

    def __init__(self, motive: Motive, publisher: MocapPublisher, begin: float = 0.0) -> None:
        if motive.settings.jitter:
            raise ParameterError("jitter is for the network; valid without a network: 0")
        self._motive, self._publisher, self._begin = motive, publisher, begin
        self._codec = Codec(motive.version)
        self._exposed: deque[tuple[float, float, bytes]] = deque()
        self._number = 0
        publisher.describe(self._codec.decode_model(self._codec.encode_model(motive.scene.model())))

    def advance(self, time: float, known: float = math.inf) -> None:
        """Go on.

        Args:
            time: of the run [s].
            known: up to then it is known where everything is [s]; frames of later exposures wait.
        """
        motive, period = self._motive, self._motive.settings.period
        while (exposed := self._begin + self._number * period) <= min(time, known + STAMP):
            delay = motive.delay(self._number)
            datagram = motive.datagram(motive.frame(self._number))
            if delay is not None and motive.live:
                due = exposed + delay if known == math.inf else max(exposed + delay, time)
                self._exposed.append((due, exposed, datagram))
            self._number += 1
        while self._exposed and self._exposed[0][0] <= time:
            due, exposed, datagram = self._exposed.popleft()
            frame = self._codec.decode_frame(datagram)
            self._publisher.publish(Received(frame, round(due * NS), round(exposed * NS), "mid-exposure"))


def robot_time(monotonic: int) -> float:
    """Headless, both clocks are one [ns] -> [s]."""
    return monotonic / NS
