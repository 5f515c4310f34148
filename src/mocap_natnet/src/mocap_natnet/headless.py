"""Emulated Motive and its publisher in one process: no sockets, but the same encoder and decoder as live.

The result depends only on the seed.
"""

import math
from collections import deque

from hric_core.errors import ParameterError
from mocap_natnet.client import Received
from mocap_natnet.codec import Codec
from mocap_natnet.node.publisher import MocapPublisher
from mocap_natnet.server import Motive

NS = 1_000_000_000
STAMP = 1.0 / NS
"""Resolution of a ROS stamp [s]."""


class HeadlessMocap:
    """Motion capture of a headless run: publishes each frame one latency after its exposure, in robot time.

    The publisher must be made with the function `robot_time` of this module. Poses of simulated bodies are read in the
    first `advance` that reaches the middle of the exposure.

    Args:
        motive: emulated Motive.
        publisher: publisher of its frames.
        begin: robot time at which the stream begins [s].

    Raises:
        ParameterError: the emulated Motive has jitter, which would change the order of frames.
    """

    def __init__(self, motive: Motive, publisher: MocapPublisher, begin: float = 0.0) -> None:
        if motive.settings.jitter:
            raise ParameterError(
                f"jitter is {motive.settings.jitter}; valid in a headless run, which has no network: 0"
            )
        self._motive, self._publisher, self._begin = motive, publisher, begin
        self._codec = Codec(motive.version)
        self._exposed: deque[tuple[float, float, bytes]] = deque()
        self._number = 0
        publisher.describe(self._codec.decode_model(self._codec.encode_model(motive.scene.model())))

    def advance(self, time: float, known: float = math.inf) -> None:
        """Advance to a robot time, and publish the frames that are due.

        Args:
            time: robot time [s].
            known: robot time up to which all poses are known [s]; frames with later exposures wait.
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
    """Return the robot time [s] of a monotonic time [ns]; headless, both clocks are the same."""
    return monotonic / NS
