"""Publisher of the number of samples that an emulated source has sent, for comparison with a recording."""

import time

from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_msgs.msg import SourceCount

TOPIC = "hric/perception/sent"
PERIOD = 0.1
"""Time between messages [s of wall time] (project default, unconfirmed)."""


class SentCounts:
    """Publisher of how many samples one emulated source has sent; called from one thread.

    Args:
        node: node that publishes.
        source: name of the source in its driver's messages; "": the frames of the motion capture.
        counts: counted items: samples or frames.
        rate: samples or frames per second of robot time [Hz].
    """

    def __init__(self, node: Node, source: str, counts: str, rate: float) -> None:
        self._publisher = node.advertise(node.beside(TOPIC), SourceCount, queue_size=100)
        self._source, self._counts, self._rate = source, counts, rate
        self._published = 0.0

    def publish(self, following: int, sent: int, last: float) -> None:
        """Publish the counts, at most once per PERIOD.

        Args:
            following: sequence number of the next sample.
            sent: samples sent so far; all of them are on the wire.
            last: robot time of the last sample sent [s].
        """
        now = time.monotonic()
        if now - self._published < PERIOD or last < 0.0:
            return
        self._published = now
        message = SourceCount(source=self._source, counts=self._counts, next=following, sent=sent, rate=self._rate)
        message.header.stamp = stamps.to_time(last)
        self._publisher.publish(message)
