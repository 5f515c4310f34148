"""Robot time in processes other than the robot's: for the stamps of sensor drivers and for emulated devices."""

import threading
import time
from typing import Any

from rosgraph_msgs.msg import Clock

from hric_core.errors import FailureError
from hric_core.node import Registration
from hric_core.robot_time.clock import HORIZON_NS, NS, RESTART, RunClock
from hric_core.robot_time.schedule import Schedule
from hric_core.ros import RosNode
from hric_msgs.msg import ClockPair

TOPIC = "hric/clock"
PATIENCE = 3.0
"""Time without a clock pair after which another source of time is used [s] (project default, unconfirmed)."""
FRESH = NS
"""Age of the last clock pair up to which `/clock` is not subscribed to [ns] (project default, unconfirmed)."""
SAME_MACHINE = 2 * NS
"""Largest age, at its arrival, of a clock pair that comes from this machine [ns].

Other machines have another monotonic clock, by which their pairs seem much older or newer."""
LOOK = NS // 50
"""Time between two readings of the wall clock, that of clock pairs [ns] (project default, unconfirmed)."""
PAIRS, TICKS, WALL, NOTHING = TOPIC, "/clock", "the wall clock", "nothing"


class UnpacedError(FailureError):
    """Simulation without real-time pacing, which a sensor that streams over a network cannot follow."""


class RobotTime:
    """Map from the local monotonic clock to robot time. Its methods may be called from any thread.

    It uses the clock pairs on `hric/clock`. If there is none for PATIENCE, it uses the messages of `/clock` if
    `/use_sim_time` is true, else the wall clock. A simulated robot announces its time in advance; then all processes
    get the same stamps, to the nanosecond. Robot time never goes back, whatever the load of the machine, unless the run
    restarts or another source of time is used.

    Args:
        node: private node, whose name is used in log lines.
    """

    def __init__(self, node: RosNode) -> None:
        self._node, self._lock = node, threading.Lock()
        self._announced = threading.Condition(self._lock)
        self._schedule: Schedule | None = None
        self._simulated = bool(node.param("/use_sim_time", False))
        self._pairs, self._ticks, self._wall = RunClock(), RunClock(), RunClock()
        self._looked = 0
        self._received = time.monotonic_ns()
        self._known = self._unpaced = self._foreign = False
        self._reported = PAIRS
        self._pair_subscription = node.subscribe(node.beside(TOPIC), ClockPair, self._on_pair, queue_size=0)
        self._tick_subscription: Registration | None = None
        self._subscribe_ticks(self._simulated)

    def close(self) -> None:
        """Unsubscribe from the topics of the clocks."""
        self._pair_subscription.unregister()
        self._subscribe_ticks(False)

    @property
    def source(self) -> str:
        """Current source of robot time, as text for users: "hric/clock", "/clock", "the wall clock" or "nothing"."""
        with self._lock:
            return self._source()

    @property
    def standing(self) -> bool:
        """True if the run is paused or has not begun, in which case an emulated device waits."""
        with self._lock:
            source = self._source()
            if source == PAIRS and self._schedule is not None:
                late = time.monotonic_ns() - self._schedule.end[0]
                return late > HORIZON_NS or not self._schedule.rises
            return source == NOTHING or (source == PAIRS and self._pairs.standing)

    def robot_time(self, monotonic: int) -> float | None:
        """Return the robot time [s] at a monotonic time [ns]; None while it is unknown.

        If the robot announces its time in advance, this waits, for half a second at most, until the announcement covers
        the requested time."""
        with self._lock:
            while (schedule := self._scheduled()) is not None:
                late = time.monotonic_ns() - schedule.end[0]
                if monotonic <= schedule.end[0] or late > HORIZON_NS:
                    return schedule.robot_time(monotonic)
                self._announced.wait((HORIZON_NS - late) / NS + LOOK / NS)
            now = time.monotonic_ns()
            clock = self._clock(self._source(), now)
            clock.settle(min(monotonic, now))  # a future time is no measurement
            return clock.robot_time(monotonic)

    def monotonic(self, run: float) -> int | None:
        """Return the monotonic time [ns] of a robot time [s], past or future; None while it is unknown."""
        with self._lock:
            if (schedule := self._scheduled()) is None:
                return self._clock(self._source(), time.monotonic_ns()).monotonic(run)
            at, reached = schedule.end
            return schedule.monotonic(run) or at + round((run - reached) * NS)

    def now(self) -> float | None:
        """Return the current robot time [s], limited to what the robot has announced; None while it is unknown."""
        with self._lock:
            schedule = self._scheduled()
            if schedule is not None:
                return schedule.robot_time(time.monotonic_ns())
        return self.robot_time(time.monotonic_ns())

    def tick(self) -> None:
        """Log a change of the source of robot time; to be called about once a second.

        Raises:
            UnpacedError: the simulation is not paced.
        """
        with self._lock:
            source, unpaced, foreign = self._source(), self._unpaced, self._foreign
            fresh = self._known and time.monotonic_ns() - self._received < FRESH
        self._subscribe_ticks(self._simulated and not fresh)
        if unpaced:
            raise UnpacedError(
                f"{self._node.namespace}: the simulation is not paced (real_time_factor is 0), so a sensor that "
                "streams over a network cannot follow it; valid: real_time_factor above 0, or a run without ROS (hric "
                "run)"
            )
        if source != self._reported and source != NOTHING:
            self._reported = source
            why = f"{TOPIC} comes from another machine" if foreign else f"no message on {TOPIC}"
            self._node.log_info(f"stamps now use the time of {source}" + ("" if source == PAIRS else f": {why}"))

    def _subscribe_ticks(self, needed: bool) -> None:
        """Subscribe to `/clock`, or unsubscribe if its hundred messages a second are not needed: clock pairs arrive."""
        if self._tick_subscription is None and needed:
            self._tick_subscription = self._node.subscribe("/clock", Clock, self._on_tick, queue_size=0)
        elif self._tick_subscription is not None and not needed:
            self._tick_subscription.unregister()
            self._tick_subscription = None

    def _source(self) -> str:
        waited = time.monotonic_ns() - self._received
        if waited <= PATIENCE * NS:
            return PAIRS if self._known else NOTHING
        if not self._simulated:
            return WALL
        if self._ticks.robot_time(0) is not None:
            return TICKS
        return PAIRS if self._known else NOTHING

    def _scheduled(self) -> Schedule | None:
        """Return the announced schedule of robot time if it is the current source of time, else None."""
        return self._schedule if self._source() == PAIRS else None

    def _clock(self, source: str, now: int) -> RunClock:
        if source == WALL and now >= self._looked + LOOK:
            if now > self._looked + HORIZON_NS:
                self._wall = RunClock()
            self._looked = now
            wall = time.time_ns()
            self._wall.add(time.monotonic_ns(), wall / NS, 1.0)  # in this order a pair may be late, never early
        return {WALL: self._wall, TICKS: self._ticks}.get(source, self._pairs)

    def _on_pair(self, message: Any) -> None:
        now = time.monotonic_ns()
        with self._lock:
            self._foreign = not -SAME_MACHINE < now - message.monotonic < SAME_MACHINE
            if self._foreign:
                return
            self._received, self._known, self._unpaced = now, True, message.real_time_factor == 0.0
            run = message.run_time.to_sec()
            if not message.scheduled:
                self._schedule = None
                self._pairs.add(message.monotonic, run, message.real_time_factor)
            elif self._schedule is None or run < self._schedule.end[1] - RESTART:
                self._schedule = Schedule(message.monotonic, run)
            else:
                self._schedule.add(message.monotonic, run)
            self._announced.notify_all()

    def _on_tick(self, message: Any) -> None:
        now = time.monotonic_ns()
        with self._lock:
            if self._source() != PAIRS:
                self._ticks.add(now, message.clock.to_sec())
