"""Publication of robot time: on /clock, as stamps, and as clock pairs on hric/clock.

A clock pair is one instant on the machine's monotonic clock and on the robot's clock. By these pairs, sensor drivers
and emulated devices compute the robot time of their data."""

from collections.abc import Callable
from time import monotonic_ns
from typing import Any

from rosgraph_msgs.msg import Clock

from hric_control.robot_hw import RobotHW
from hric_control.sim.sim_loop import SimLoop
from hric_core import realtime
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_core.robot_time.progress import Gate
from hric_msgs.msg import ClockPair

TOPIC = "hric/clock"
"""Topic of the clock pairs, relative to the robot's namespace."""
PERIOD = 20_000_000
"""Wall time between two measured clock pairs [ns]."""


class ClockPairs:
    """Publisher of clock pairs (monotonic time, robot time), called by the control loop.

    A simulation loop that is paced publishes the knots of its schedule in advance; any other loop publishes measured
    pairs every 20 ms of wall time.

    Args:
        node: node that advertises.
        stamp: function that converts robot time [s] to a message stamp (genpy.Time).
        loop: loop of a simulated robot; None: the robot has its own clock.

    Attributes:
        gate: limit of robot time by progress reports, for which a paced loop waits; None: there is no loop.
    """

    __slots__ = ("_due", "_loop", "_publisher", "_stamp", "gate")

    def __init__(self, node: Node, stamp: Callable[[float], Any], loop: SimLoop | None) -> None:
        self._stamp, self._loop, self._due = stamp, loop, 0
        self._publisher = realtime.publisher(node, TOPIC, ClockPair, lossless=True)
        self.gate: Gate | None = None
        if loop is not None:
            self.gate = Gate(node)
            loop.pace.on_knot, loop.pace.limit = self._on_knot, self.gate.limit

    def send_due(self, time: float) -> None:
        """Publish a measured clock pair if one is due. Never blocks.

        It is also called while the simulation is paused, so that other processes notice the pause.

        Args:
            time: present robot time [s].
        """
        if self._loop is not None and self._loop.real_time_factor:
            return  # a paced loop announces its schedule instead
        now = monotonic_ns()
        if now >= self._due:
            # Due times are on a grid, so that a loop with cycles of 1 ms publishes every 20 ms, not every 21 ms.
            self._due = max(self._due + PERIOD, now + PERIOD // 2)
            self._publisher.publish(ClockPair, now, self._stamp(time), 1.0 if self._loop is None else 0.0, False)

    def close(self) -> None:
        """Stop waiting for progress reports and unregister the topic."""
        if self.gate is not None:
            self.gate.close()
        self._publisher.unregister()

    def _on_knot(self, monotonic: int, time: float) -> None:
        assert self._loop is not None
        self._publisher.publish(ClockPair, monotonic, self._stamp(time), self._loop.real_time_factor, True)


class RobotClock:
    """Publisher of robot time on /clock and hric/clock.

    For a real robot, which has its own clock (no `loop`), /clock is not published, and its nodes use ROS time. For a
    robot that shares its plant, neither is published: this is the task of the robots' common RobotHW.

    Args:
        hw: the robot, initialised.
        nodes: nodes of the robot; the first one advertises.
        live: True to publish clock pairs on hric/clock, for sensor drivers and emulated devices.
        on_clock: callback, in the loop's thread, for each stamp published on /clock; None: no callback.

    Attributes:
        pairs: publisher of clock pairs; None if `live` is False.
    """

    def __init__(
        self, hw: RobotHW, nodes: tuple[Node, ...], live: bool, on_clock: Callable[[Any], None] | None
    ) -> None:
        self._hw, self._on_clock = hw, on_clock
        live = live and hw.shared is None
        self.pairs = ClockPairs(nodes[0], self.stamp, hw.loop) if live else None
        self._publisher: realtime.RealtimePublisher | None = None
        if (loop := hw.loop) is not None:
            for node in nodes:  # also the clock of their children
                node.clock = lambda: loop.time  # type: ignore[attr-defined]  # LocalNode and RosNode have it
            if hw.shared is not None:
                return
            loop.on_pause = self.pair_now
            self._publisher = realtime.publisher(nodes[0], "/clock", Clock, newest_only=True)

    @property
    def time(self) -> float:
        """Robot time of the last measured state [s]; 0 if the robot does not know it."""
        return self._hw.time or 0.0

    def stamp(self, time: float) -> Any:
        """Return the message stamp of a robot time [s]: robot time plus the ROS time at which robot time was 0."""
        return stamps.to_time(time + self._hw.epoch)

    def publish(self, time: float | None) -> None:
        """Publish /clock at a robot time [s] but 0, which in ROS is no time yet; None: the smallest that is valid."""
        publisher, on_clock = self._publisher, self._on_clock
        if publisher is None or not (on_clock is not None or publisher.needed):
            return
        stamp = stamps.FIRST if time is None else stamps.to_time(time)
        if not stamp:
            return
        if on_clock is not None:
            on_clock(stamp)
        publisher.publish(_clock_message, stamp)

    def pair_now(self) -> None:
        """Publish a clock pair if one is due; called between cycles while the simulation is paused."""
        if self.pairs is not None:
            self.pairs.send_due(self.time)
            if self._hw.loop is not None:
                self._hw.loop.stand()


def _clock_message(stamp: Any) -> Clock:
    message: Clock = object.__new__(Clock)  # the constructor takes five times as long
    message.clock = stamp
    return message
