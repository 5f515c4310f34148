"""Loop and clock of a simulated robot: paced or not, with pause, single steps, and requests between two cycles.

A simulated RobotHW owns one loop and runs it:

    def run(self, on_cycle):
        self.loop.run(lambda time, period, reset: self._cycle(on_cycle, time, period, reset))

where `_cycle` reads the states, calls `on_cycle`, writes the commands, steps the plant, and returns True to continue.
All other access to the plant, e.g. by services, goes through `request`, so that only one thread uses the plant.
"""

import math
import threading
import time as wall
from collections.abc import Callable
from queue import Empty, SimpleQueue
from time import monotonic_ns
from typing import Any

from hric_control.loop_requests import LoopRequests, T
from hric_control.sim.loop_stats import LoopMeter, LoopStats
from hric_control.sim.pace import Pace
from hric_core.errors import HricError
from hric_core.parameters import number
from hric_core.robot_time.schedule import NS

Cycle = Callable[[float, float, bool], bool]
"""Callback (robot time at the measuring instant [s], period [s], reset controllers) for one cycle of the loop.

It returns True to continue. A cycle that returns False is counted, and is the last one."""

REAL_TIME_FACTOR: Any = number(
    1.0,
    minimum=0.0,
    name="real_time_factor",
    unit="robot time per wall time",
    text="pace of a simulated robot; 0: as fast as possible",
)
LIVE_FACTOR: Any = number(minimum=0.01, maximum=100.0, name="real_time_factor", unit="robot time per wall time")
"""Pace to which a running simulation can be set; project default, unconfirmed."""
NAP = 10_000_000
"""Longest sleep of the loop at a time [ns], after which it announces its schedule and checks for stop and pause."""
HELD_NAP = 0.002
"""Time between two checks while the next cycle is not in the announced schedule yet [s]."""
PAUSE_POLL = 0.02
"""Period at which a paused loop calls `on_pause` [s]."""
IDLE_PERIOD = 0.1
"""Period at which a loop that is not paced calls `on_idle` [s of robot time]."""


class SimLoop:
    """Simulation loop with a fixed time step; it defines robot time.

    Robot time is the number of cycles times the time step, so it has no rounding drift and never goes back; a reset of
    the robot does not change it.

    Args:
        time_step: period of a cycle [s].
        real_time_factor: robot time per wall time, 1.0 for real time; 0: as fast as possible.

    Attributes:
        time_step: period of a cycle [s].
        time: robot time of the state that the present or next cycle reads [s].
        cycles: number of finished cycles.
        pace: schedule of a paced loop, which says when each robot time is due.
        after_cycle: callbacks after each finished cycle, in the loop, with the robot time of the cycle's state [s].
        on_idle: callback in a loop that is not paced, every 0.1 s of robot time, to send messages; it may block.
        on_pause: callback in the paused loop, every 20 ms of wall time.
    """

    def __init__(self, time_step: float, real_time_factor: float = 1.0) -> None:
        if not (math.isfinite(time_step) and time_step > 0.0):
            raise HricError(f"time_step must be above 0 s; got {time_step}")
        self.time_step = time_step
        self.pace = Pace(1.0)
        self.real_time_factor = real_time_factor
        self.time = 0.0
        self.cycles = 0
        self.after_cycle: list[Callable[[float], None]] = []
        self.on_idle: Callable[[], object] | None = None
        self.on_pause: Callable[[], None] | None = None
        self._meter = LoopMeter(time_step)
        self._stop = self._paused = self._reset = False
        self._steps = 0
        self._stepped: threading.Event | None = None
        self._wake: SimpleQueue[None] = SimpleQueue()  # put() is safe in a signal handler
        self._requests = LoopRequests(self._woken)
        self._step_caller = threading.Lock()

    @property
    def real_time_factor(self) -> float:
        """Requested robot time per wall time [1]; 0: as fast as possible. May be changed while running."""
        return self._factor

    @real_time_factor.setter
    def real_time_factor(self, value: float) -> None:
        self._factor: float = REAL_TIME_FACTOR.checked(value, REAL_TIME_FACTOR.name)
        if self._factor:
            self.pace.factor = self._factor

    @property
    def running(self) -> bool:
        """True if `run` is active, paused or not."""
        return self._requests.thread is not None

    @property
    def paused(self) -> bool:
        """True if the run is paused."""
        return self._paused

    @property
    def stats(self) -> LoopStats:
        """Present statistics of the loop; fast, may be read from any thread."""
        return self._meter.stats(self.pace.slowed)

    def run(self, cycle: Cycle) -> None:
        """Run cycles in the calling thread until `stop` is called or `cycle` returns False.

        Errors raised by `cycle` are passed on. If `stop` was called before, this method returns at once.
        """
        with self._requests.lock:
            if self.running:
                raise HricError("the simulation loop is running already")
            self._requests.thread = threading.get_ident()
        if self._factor and not self._paused:
            self.pace.due(monotonic_ns(), self.time)
        self._meter.restart(self.cycles)
        try:
            self._loop(cycle)
        finally:
            with self._requests.lock:
                self._requests.thread = None
                self._stop = False
                self._steps = 0
                self._requests.serve()
                if self._stepped is not None:
                    self._stepped.set()

    def stop(self) -> None:
        """Let `run` return after the present cycle, also while paused; from any thread or a signal handler."""
        self._stop = True
        self._wake.put(None)

    def pause(self) -> None:
        """Pause the loop after the present cycle: robot time stays constant, requests are still executed."""
        self._paused = True

    def unpause(self) -> None:
        """Continue a paused loop, at the robot time of the pause."""
        self._paused = False
        self._wake.put(None)

    def restart_controllers(self) -> None:
        """Let the next cycle restart the controllers; called after the robot was set to another pose."""
        self._reset = True

    def request(self, function: Callable[[], T]) -> T:
        """Call a function in the loop's thread between two cycles; return its result or raise its error here.

        If the loop is not running, or the caller is the loop's thread, the function is called directly.
        """
        return self._requests.request(function)

    def _woken(self) -> None:
        if self._paused:
            self._wake.put(None)

    def step(self, n: int) -> float:
        """Run exactly `n` cycles of the paused loop, as fast as possible, and wait for their end.

        Returns:
            robot time after these cycles [s].

        Raises:
            HricError: the loop is not paused, is not running, or was stopped before the end; or n is below 1.
        """
        if n < 1:
            raise HricError(f"the number of steps must be at least 1; got {n}")
        with self._step_caller:
            done = threading.Event()
            with self._requests.lock:
                self._check_step()
                goal = self.cycles + n
                self._stepped, self._steps = done, n
            self._wake.put(None)
            done.wait()
            self._stepped = None
            if self.cycles < goal:
                raise HricError(f"the simulation was stopped after {n - goal + self.cycles} of {n} steps")
        return self.time

    def _check_step(self) -> None:
        if not self.running:
            raise HricError("the simulation loop is not running, so no step can be made")
        if self._requests.thread == threading.get_ident():
            raise HricError("step must not be called from inside the loop")
        if not self._paused:
            raise HricError("the simulation is not paused: call sim/pause_physics first")

    def _loop(self, cycle: Cycle) -> None:
        period, meter, clock = self.time_step, self._meter, wall.perf_counter
        waiting, serve = self._requests.waiting, self._requests.serve
        idle_cycles = max(1, round(IDLE_PERIOD / period))
        while not self._stop:
            if waiting:
                serve()
            if self._paused and not self._steps:
                self._wait()
                continue
            begin = clock()
            reset, self._reset = self._reset, False
            now = self.time
            going_on = cycle(now, period, reset)
            for hook in self.after_cycle:
                hook(now)
            self.cycles += 1
            self.time = self.cycles * period
            end = clock()
            meter.cycle(begin, end)
            if not going_on:
                return
            if self._steps:
                self._count_step()
            elif self._factor:
                self._sleep()
                continue
            if self.cycles % idle_cycles == 0 and self.on_idle is not None:
                self.on_idle()

    def _count_step(self) -> None:
        self._steps -= 1
        if self._steps == 0 and self._stepped is not None:
            self._stepped.set()

    def stand(self) -> None:
        """Announce in the schedule that robot time is paused now, if the loop is paced."""
        if self._factor:
            self.pace.stand(monotonic_ns(), self.time)

    def _sleep(self) -> None:
        """Wait until the next cycle is due by the schedule; if it is past due already, count a missed deadline."""
        pace, run = self.pace, self.time
        now = monotonic_ns()
        due = pace.due(now, run)
        if due is not None and due <= now:
            self._meter.missed += 1
            return
        while not (self._stop or self._paused):
            if due is None:
                wall.sleep(HELD_NAP)
            elif due <= now:
                return
            else:
                wall.sleep(min(due - now, NAP) / NS)
            now = monotonic_ns()
            if due is None or now < due:
                due = pace.due(now, run)

    def _wait(self) -> None:
        """Wait in a paused loop until there is a request, at most PAUSE_POLL."""
        self.stand()
        self._meter.stand()
        if self.on_pause is not None:
            self.on_pause()
        try:
            self._wake.get(timeout=PAUSE_POLL)
        except Empty:
            return
