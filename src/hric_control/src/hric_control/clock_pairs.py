"""Robot time for everybody beside the loop: the robot's nodes, /clock, stamps, and pairs with the machine's clock on
hric/clock, by which drivers and emulators of sensors keep the time of the run."""

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
"""In the robot's namespace: one clock per run."""
PERIOD = 20_000_000
"""Between pairs, of wall time [ns]."""


class ClockPairs:
    """Publishes pairs from the control loop: the knots of the schedule of a paced loop; else what is measured, one in
    20 ms of wall time.

    Args:
        node: where to advertise.
        stamp: robot time [s] -> stamp of the run (genpy.Time).
        loop: of a simulated robot; None: the robot brings its own clock.

    Attributes:
        gate: for whom a paced loop waits; None: there is no loop.
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
        """Publish a pair if one is due; never blocks. Also while the run is paused, so that the pause is
        known.

        Args:
            time: robot time now [s].
        """
        if self._loop is not None and self._loop.real_time_factor:
            return  # its schedule is announced
        now = monotonic_ns()
        if now >= self._due:
            # On a grid, so that cycles of 1 ms give a pair in 20 ms, not in 21.
            self._due = max(self._due + PERIOD, now + PERIOD // 2)
            self._publisher.publish(ClockPair, now, self._stamp(time), 1.0 if self._loop is None else 0.0, False)

    def close(self) -> None:
        """Wait for nobody any more."""
        if self.gate is not None:
            self.gate.close()
        self._publisher.unregister()

    def _on_knot(self, monotonic: int, time: float) -> None:
        assert self._loop is not None
        self._publisher.publish(ClockPair, monotonic, self._stamp(time), self._loop.real_time_factor, True)


class RobotClock:
    """What a robot publishes of its time. One that brings its own clock (no `loop`) has no /clock; its nodes keep ROS
    time.

    Args:
        hw: the robot, initialised.
        nodes: the robot's own; the first one advertises.
        live: publish pairs on hric/clock, for drivers of sensors and emulators.
        on_clock: called with each stamp that goes out on /clock, in the loop; None: nobody.

    Attributes:
        pairs: publishes those pairs; None of a robot that is not live.
    """

    def __init__(
        self, hw: RobotHW, nodes: tuple[Node, ...], live: bool, on_clock: Callable[[Any], None] | None
    ) -> None:
        self._hw, self._on_clock = hw, on_clock
        self._publisher: realtime.RealtimePublisher | None = None
        if (loop := hw.loop) is not None:
            for node in nodes:  # their children share it
                node.clock = lambda: loop.time  # type: ignore[attr-defined]  # LocalNode and RosNode have it
            loop.on_pause = self.pair_now
            self._publisher = realtime.publisher(nodes[0], "/clock", Clock, newest_only=True)
        self.pairs = ClockPairs(nodes[0], self.stamp, hw.loop) if live else None

    @property
    def time(self) -> float:
        """Robot time of the last state [s]; 0 of a robot that does not know it."""
        return self._hw.time or 0.0

    def stamp(self, time: float) -> Any:
        """Stamp of a robot time [s]; a robot that brings its own clock knows at which ROS time that was 0."""
        return stamps.to_time(time + self._hw.epoch)

    def publish(self, stamp: Any) -> None:
        """Send /clock; not 0, which to ROS means that there is no time yet."""
        if self._publisher is None or not stamp:
            return
        if self._on_clock is not None:
            self._on_clock(stamp)
        self._publisher.publish(Clock, stamp)

    def pair_now(self) -> None:
        """Send a pair of clocks if one is due, outside a cycle: robot time is paused."""
        if self.pairs is not None:
            self.pairs.send_due(self.time)
            if self._hw.loop is not None:
                self._hw.loop.stand()
