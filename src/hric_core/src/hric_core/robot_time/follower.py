"""The time of the run in a process beside the robot: for drivers, which stamp measurements with it, and for emulators,
which go by it."""

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
"""Without a pair for so long, another clock gives the time [s] (project default, unconfirmed)."""
FRESH = NS
"""Where the last pair is no older, the ticks of `/clock` are not subscribed to [ns] (project default, unconfirmed)."""
SAME_MACHINE = 2 * NS
"""Pairs are at most this old when they arrive [ns]; others are of another machine, whose monotonic clock is another
one."""
LOOK = NS // 50
"""Between looks at the wall clock, as between pairs [ns] (project default, unconfirmed)."""
PAIRS, TICKS, WALL, NOTHING = TOPIC, "/clock", "the wall clock", "nothing"


class UnpacedError(FailureError):
    """A sensor on a wire cannot take part in a run that is not paced."""


class RobotTime:
    """Maps the monotonic clock here to the time of the run: by the pairs on `hric/clock`; without them for some
    seconds, by the ticks of `/clock` where `/use_sim_time` is true, else by the wall clock. A clock for `MotiveServer`.
    From any thread.

    A simulated robot announces its time ahead: then all who map by it get the same, to the nanosecond of a stamp.

    Whatever the load of the machine, a later monotonic time never gets an earlier time of the run than one that was
    mapped before, unless the run restarts or another clock takes over.

    Args:
        node: private node, whose name is in messages.
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
        """Unsubscribe."""
        self._pair_subscription.unregister()
        self._subscribe_ticks(False)

    @property
    def source(self) -> str:
        """What gives the time now, for people."""
        with self._lock:
            return self._source()

    @property
    def standing(self) -> bool:
        """Whether the run is paused or has not begun, and an emulator waits with it."""
        with self._lock:
            source = self._source()
            if source == PAIRS and self._schedule is not None:
                late = time.monotonic_ns() - self._schedule.end[0]
                return late > HORIZON_NS or not self._schedule.rises
            return source == NOTHING or (source == PAIRS and self._pairs.standing)

    def robot_time(self, monotonic: int) -> float | None:
        """The time of the run [s] at a monotonic time [ns]; None while it is not known. Waits, for half a second at
        most, while the schedule of the run does not go so far: what covers that time is on its way."""
        with self._lock:
            while (schedule := self._scheduled()) is not None:
                late = time.monotonic_ns() - schedule.end[0]
                if monotonic <= schedule.end[0] or late > HORIZON_NS:
                    return schedule.robot_time(monotonic)
                self._announced.wait((HORIZON_NS - late) / NS + LOOK / NS)
            now = time.monotonic_ns()
            clock = self._clock(self._source(), now)
            clock.settle(min(monotonic, now))  # what has not come yet is no measurement
            return clock.robot_time(monotonic)

    def monotonic(self, run: float) -> int | None:
        """When that was the time of the run, or will be [ns]; None while it is not known."""
        with self._lock:
            if (schedule := self._scheduled()) is None:
                return self._clock(self._source(), time.monotonic_ns()).monotonic(run)
            at, reached = schedule.end
            return schedule.monotonic(run) or at + round((run - reached) * NS)

    def now(self) -> float | None:
        """The time of the run [s], no later than it was announced; None while it is not known."""
        with self._lock:
            schedule = self._scheduled()
            if schedule is not None:
                return schedule.robot_time(time.monotonic_ns())
        return self.robot_time(time.monotonic_ns())

    def tick(self) -> None:
        """Call it about once a second: logs when another clock gives the time.

        Raises:
            UnpacedError: the run is not paced.
        """
        with self._lock:
            source, unpaced, foreign = self._source(), self._unpaced, self._foreign
            fresh = self._known and time.monotonic_ns() - self._received < FRESH
        self._subscribe_ticks(self._simulated and not fresh)
        if unpaced:
            raise UnpacedError(
                f"{self._node.namespace}: the run is not paced (real_time_factor is 0), which no sensor on a wire "
                "can follow; "
                "valid: real_time_factor above 0, or the headless runner, rosrun hric_experiments run"
            )
        if source != self._reported and source != NOTHING:
            self._reported = source
            why = "it comes from another machine" if foreign else f"nothing on {TOPIC}"
            self._node.log_info(f"the time of the run is that of {source}" + ("" if source == PAIRS else f": {why}"))

    def _subscribe_ticks(self, needed: bool) -> None:
        """A hundred a second that are of no use while pairs come."""
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
        """The schedule of the run, where it gives the time now."""
        return self._schedule if self._source() == PAIRS else None

    def _clock(self, source: str, now: int) -> RunClock:
        if source == WALL and now >= self._looked + LOOK:
            if now > self._looked + HORIZON_NS:
                self._wall = RunClock()
            self._looked = now
            wall = time.time_ns()
            self._wall.add(time.monotonic_ns(), wall / NS, 1.0)  # read in this order a pair may be late, never early
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
