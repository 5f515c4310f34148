"""Clock and loop of a simulated robot: paced or not, with pause, single steps, and requests between two cycles.

A simulated RobotHW owns one loop and drives it:

    def run(self, on_cycle):
        self.loop.run(lambda time, period, reset: self._cycle(on_cycle, time, period, reset))

where `_cycle` reads, calls `on_cycle`, writes, steps the plant, and returns True to go on. Everything that accesses the
plant from outside (services) goes through `request`, so that only one thread ever uses the plant.
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
"""Callback (robot time at the measuring instant [s], period [s], reset controllers) -> True to go on.

A cycle that returns False counts, and is the last one."""

REAL_TIME_FACTOR: Any = number(
    1.0,
    minimum=0.0,
    name="real_time_factor",
    unit="robot time per wall time",
    text="pace of a simulated robot; 0: as fast as possible",
)
NAP = 10_000_000
"""Longest uninterrupted sleep, so that a slow loop announces its schedule and notices stop and pause [ns]."""
HELD_NAP = 0.002
"""Sleep of a loop whose next cycle is not announced yet [s]."""
PAUSE_POLL = 0.02
"""Period at which a paused loop calls `on_pause` [s]."""
IDLE_PERIOD = 0.1
"""Robot time between two calls of `on_idle` when the loop is not paced [s]."""


class SimLoop:
    """Loop with a fixed time step, which owns robot time.

    Robot time is a whole number of cycles: it has no rounding drift and never goes back; a reset of the robot does not
    change it.

    Args:
        time_step: period of the cycle [s].
        real_time_factor: robot time per wall time, 1.0 for real time; 0: as fast as possible.

    Attributes:
        time_step: period of the cycle [s].
        time: robot time of the state that the next cycle reads, or that the present cycle has read [s].
        cycles: number of cycles finished.
        pace: schedule by which the loop sleeps and which announces when a robot time is due.
        after_cycle: callbacks in the loop after each finished cycle, with the robot time at which that cycle measured.
        on_idle: called in the loop every 0.1 s of robot time when not paced, to let messages out. It may wait.
        on_pause: called in the paused loop, every 20 ms of wall time.
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
        """Statistics; cheap, may be read from any thread."""
        return self._meter.stats(self.pace.slowed)

    def run(self, cycle: Cycle) -> None:
        """Run cycles until `stop`, or until `cycle` returns False. Owns the calling thread; raises what `cycle` raises.

        After a `stop` that came before `run`, it returns at once.
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
        """Let `run` return after the present cycle, also while paused. From any thread or a signal handler."""
        self._stop = True
        self._wake.put(None)

    def pause(self) -> None:
        """Hold robot time after the present cycle; requests are still served."""
        self._paused = True

    def unpause(self) -> None:
        """Continue from the same robot time."""
        self._paused = False
        self._wake.put(None)

    def restart_controllers(self) -> None:
        """Pass reset_controllers = True to the next cycle, after the robot was moved to another pose."""
        self._reset = True

    def request(self, function: Callable[[], T]) -> T:
        """Call `function` inside the loop between two cycles, and return its result or raise its error here.

        While no loop runs, and from the loop's own thread, it is called directly.
        """
        return self._requests.request(function)

    def _woken(self) -> None:
        if self._paused:
            self._wake.put(None)

    def step(self, n: int) -> float:
        """Run exactly `n` cycles while paused, as fast as possible, and wait for their end.

        Returns:
            robot time afterwards [s].

        Raises:
            HricError: the loop is not paused, not running, was stopped before the end; or n is below 1.
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
            raise HricError("the simulation loop is not running: nothing to step")
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
        """Announce that robot time pauses for now, if the loop is paced."""
        if self._factor:
            self.pace.stand(monotonic_ns(), self.time)

    def _sleep(self) -> None:
        """Wait until the next cycle is due by the schedule; count a deadline that has passed."""
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
        """Sleep until there is a request, while paused."""
        self.stand()
        self._meter.stand()
        if self.on_pause is not None:
            self.on_pause()
        try:
            self._wake.get(timeout=PAUSE_POLL)
        except Empty:
            return
