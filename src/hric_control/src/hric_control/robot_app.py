"""One robot with its controllers: what the robot node and the headless runner share."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

from rosgraph_msgs.msg import Clock

from hric_control import manager_services, plugins, realtime, sim_services, stamps, transmission
from hric_control.clock_pairs import ClockPairs
from hric_control.control_log import ControlLog
from hric_control.controller_manager import ControllerManager
from hric_control.diagnostics import Diagnostics
from hric_control.errors import DescriptionError, HricError, ParameterError
from hric_control.hardware_interface import JointStateInterface
from hric_control.limit_counts import LimitCounts, merged
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_control.sim_loop import SimLoop
from hric_msgs.msg import ControlLog as ControlLogMessage
from hric_msgs.msg import JointLimitCounts

CLOCK_EVERY = 0.01
"""[s of run time]"""
COUNTS_EVERY = 1.0
"""[s of run time]"""
LISTENER_POLL = 0.01
"""[s of wall time]"""
DRAIN_TIMEOUT = 0.5
"""Longest wait of an unpaced loop for queued messages [s of wall time]."""


def robot_hw_type(root_node: Node, robot_hw_node: Node) -> str:
    """Which RobotHW: the parameter `robot_hw`, or else what the description says in `robotSimType`.

    Raises:
        HricError: neither says it; the message lists the types.
    """
    name = robot_hw_node.param("robot_hw", "")
    if not isinstance(name, str):
        raise ParameterError(f"{robot_hw_node.resolve('robot_hw')} must be a type name; got {name!r}")
    found = name or transmission.robot_sim_type(root_node.search_param("robot_description", "<robot/>"))
    if not found:
        valid = ", ".join(sorted(plugins.names(plugins.ROBOT_HW))) or "none"
        raise DescriptionError(f"{robot_hw_node.resolve('robot_hw')} is not set and robot_description has no robotSimType; valid: {valid}")
    return found


def import_controllers(root_node: Node) -> list[str]:
    """Import the module of every controller that is configured below the robot's namespace, so that loading one later does not hold the loop.

    Returns:
        the type names imported. One that cannot be imported is logged and left for `load` to refuse.
    """
    everything = root_node.param(root_node.namespace, {})
    exported = plugins.names(plugins.CONTROLLER)
    wanted = {value.get("type") for value in everything.values() if isinstance(value, dict)} if isinstance(everything, dict) else set()
    done = []
    for name in sorted(kind for kind in wanted if isinstance(kind, str) and kind in exported):
        try:
            plugins.find(plugins.CONTROLLER, name)
            done.append(name)
        except HricError as error:
            root_node.log_error(str(error))
    return done


class RobotApp:
    """Wires a RobotHW, the controller manager, its services, the control log, clock and diagnostics on any Node.

    Args:
        root_node: the robot's namespace.
        robot_hw_node: where the RobotHW and this class find their parameters (`robot_hw`, `control_log`, and the robot's own).
        hw: a robot that is made already (not yet initialised); None: the plugin that the parameters name.
        live: a process with a master: `/diagnostics` come at 1 Hz of wall time from a thread, drivers are told the time on `/hric/clock`, and a
            switch always waits for the loop. Otherwise nothing happens but in the caller's thread, and a switch between two runs acts at once.
        on_clock: called with each stamp that goes out on /clock, in the loop.

    Attributes:
        hw: the robot.
        name: its type string.
        simulated: whether it has a plant, and so a clock and services of its own.
        manager: the controller manager.
        loop: the loop of a simulated robot, or None.
        cycles: number of cycles so far.

    Raises:
        HricError: the robot cannot be used.
    """

    def __init__(
        self,
        root_node: Node,
        robot_hw_node: Node,
        *,
        hw: RobotHW | None = None,
        live: bool = False,
        on_clock: Callable[[Any], None] | None = None,
    ) -> None:
        self.root_node, self.robot_hw_node = root_node, robot_hw_node
        self.name = type(hw).__name__ if hw is not None else robot_hw_type(root_node, robot_hw_node)
        self.hw: RobotHW = hw if hw is not None else plugins.find(plugins.ROBOT_HW, self.name)()
        self.cycles = 0
        self._live, self._on_clock = live, on_clock
        self._end: float | None = None
        self._log_publisher: realtime.RealtimePublisher | None = None
        self._stopping = False
        self._hook: Callable[[float], None] | None = None
        self._closers: list[Callable[[], None]] = []
        self.hw.init(root_node, robot_hw_node)
        self._closers.append(self.hw.shutdown)
        try:
            self._wire()
        except BaseException:
            self.shutdown()
            raise

    def _wire(self) -> None:
        root = self.root_node
        self.loop: SimLoop | None = getattr(self.hw, "loop", None)
        if self.loop is not None:
            loop = self.loop
            for node in (root, self.robot_hw_node):  # their children share it
                node.clock = lambda: loop.time  # type: ignore[attr-defined]  # LocalNode and RosNode have it
            loop.on_idle = self._drain
        self.simulated = self.loop is not None and hasattr(self.hw, "plant")
        self._clock = realtime.publisher(root, "/clock", Clock, newest_only=True) if self.simulated else None
        self._pairs = ClockPairs(root, self._stamp, self._factor) if self._live else None
        if self.loop is not None:
            self.loop.on_pause = self._tell_time
        counted = hasattr(self.hw, "limiter_counts")
        self._counts = realtime.publisher(root, "limit_counts", JointLimitCounts) if counted else None
        self.log = self._make_log()
        period = self.loop.time_step if self.loop is not None else 0.001
        self._clock_cycles, self._counts_cycles = max(1, round(CLOCK_EVERY / period)), max(1, round(COUNTS_EVERY / period))
        self.manager = ControllerManager(self.hw, root)
        self.manager.loop_running = self._live
        self._closers.append(self.manager.shutdown)
        self._closers.append(manager_services.serve(self.manager, root).unregister)
        if self.simulated:
            self._closers.append(sim_services.serve(self.hw, root).unregister)  # type: ignore[arg-type]  # has a loop and a plant
        if self._live:
            status = Diagnostics(root, self.name, self.loop, self.limit_counts if counted else None)
            status.start()
            self._closers.append(status.stop)

    def _make_log(self) -> ControlLog | None:
        wanted = self.robot_hw_node.param("control_log", True)
        if not isinstance(wanted, bool):
            raise ParameterError(f"{self.robot_hw_node.resolve('control_log')} must be true or false; got {wanted!r}")
        if not (wanted and hasattr(self.hw, "log_row")):
            return None
        publisher = self._log_publisher = realtime.publisher(self.root_node, "control_log", ControlLogMessage, lossless=True)
        states = self.hw.get(JointStateInterface).states
        return ControlLog(states, self.hw.log_row, publisher.publish, self._stamp)

    def limit_counts(self) -> LimitCounts:
        """Snapshot of what the limits did since the start, over all interfaces of the robot."""
        counts: Any = self.hw.limiter_counts()  # type: ignore[attr-defined]  # asked for before
        return merged(counts if isinstance(counts, list | tuple) else [counts])

    def on_cycle(self, time: float, period: float, reset_controllers: bool) -> bool:
        """One cycle between the robot's `read` and `write`: the controllers, and a row of the log.

        Args:
            time: run time at the measuring instant [s].
            period: time since the last cycle [s].
            reset_controllers: restart the running controllers.

        Returns:
            False when a robot that drives its own loop shall leave its mode for a switch.
        """
        log = self.log
        if log is not None:
            log.complete()
        if self._pairs is not None:
            self._pairs.tell(time)
        if self._hook is not None:
            self._hook(time)
        self.manager.update(time, period, reset_controllers)
        if log is not None:
            log.begin(time)
        cycle = self.cycles
        self.cycles = cycle + 1
        if cycle % self._clock_cycles == 0:
            self._tick(time, cycle)
        if self._end is not None and time + 1.5 * period > self._end:
            self.hw.stop()
        return self.loop is not None or not self.manager.switch_pending

    def _tick(self, time: float, cycle: int) -> None:
        if time > 0.0:  # 0 would mean that there is no time yet
            self._publish_clock(stamps.to_time(time))
        if self._counts is not None and cycle % self._counts_cycles == 0:
            self._publish_counts(time)

    def _publish_clock(self, stamp: Any) -> None:
        if self._clock is None:
            return

        if self._on_clock is not None:
            self._on_clock(stamp)
        self._clock.publish(Clock, stamp)

    def _publish_counts(self, time: float) -> None:
        if self._counts is not None:
            self._counts.publish(LimitCounts.message, self.limit_counts(), self._stamp(time))

    def wait_for_log_listener(self) -> None:
        """Hold run time at its start until somebody listens to the control log, so that a recording has every cycle from the first one on.

        Before `run`. The parameter `wait_for_log_listener` is the longest wait [s of wall time], 0 by default. Without a log, or when `stop` was
        called, returns at once; when nobody came in time, warns and goes on.
        """
        timeout = self.robot_hw_node.param("wait_for_log_listener", 0.0)
        if isinstance(timeout, bool) or not isinstance(timeout, int | float) or not 0.0 <= timeout < math.inf:
            raise ParameterError(f"{self.robot_hw_node.resolve('wait_for_log_listener')} must be a time of 0 s or more; got {timeout!r}")
        if timeout == 0.0 or self._log_publisher is None:
            return
        # A switch that is asked for meanwhile waits for the loop as well.
        patience, self.manager.loop_timeout = self.manager.loop_timeout, self.manager.loop_timeout + timeout
        deadline = perf_counter() + timeout
        try:
            while not self._log_publisher.subscribers() and not self._stopping:
                if perf_counter() > deadline:
                    self.root_node.log_warn(f"nobody listens to control_log after {timeout:g} s: run time begins without a recording of it")
                    return
                self._publish_clock(stamps.FIRST)
                if self.simulated:
                    self._tell_time()
                sleep(LISTENER_POLL)
        finally:
            self.manager.loop_timeout = patience

    def run(self, duration: float | None = None, on_cycle_hook: Callable[[float], None] | None = None) -> None:
        """Run the robot until `stop`, or for `duration`. What is left of the log and the last limit counts are published at the end.

        Args:
            duration: run time to cover, a whole number of cycles [s]; None: until stopped. For simulated robots.
            on_cycle_hook: called in the loop with the run time, after `read` and before the controllers; must not block.
        """
        if duration is not None and self.loop is None and not hasattr(self.hw, "time"):
            raise HricError(f"a duration cannot be given for {self.name}, which does not tell its run time; call stop() instead")
        start = self._run_time()
        if duration is not None and round(duration / self._period()) < 1:
            return
        self._end, self._hook = None if duration is None else start + duration, on_cycle_hook
        self.manager.loop_running = True
        paced = self.loop is None or self.loop.real_time_factor > 0.0
        thresholds = gc.get_threshold()
        realtime.set_polling(paced)
        if paced:
            self._quiet_collector()
        try:
            self.hw.run(self.on_cycle)
        finally:
            self.manager.loop_running = self._live
            self._end = self._hook = None
            realtime.set_polling(True)
            if paced:
                gc.set_threshold(*thresholds)
                gc.unfreeze()
            self._finish_log()

    def _run_time(self) -> float:
        return self.loop.time if self.loop is not None else getattr(self.hw, "time", 0.0)

    def _stamp(self, time: float) -> Any:
        """Stamp of a run time; a robot with a clock of its own tells at which ROS time that was 0."""
        return stamps.to_time(time + getattr(self.hw, "epoch", 0.0))

    def _period(self) -> float:
        return self.loop.time_step if self.loop is not None else 0.001

    def _factor(self) -> float:
        return self.loop.real_time_factor if self.loop is not None else 1.0

    def _tell_time(self) -> None:
        if self._pairs is not None:
            self._pairs.tell(self._run_time())

    @staticmethod
    def _quiet_collector() -> None:
        """Keep the garbage collector from walking over everything that was loaded, in the middle of a cycle."""
        gc.collect()
        gc.freeze()
        gc.set_threshold(50_000, 20, 20)

    def _finish_log(self) -> None:
        if self.log is not None:
            self.log.complete()
            self.log.flush()
        if self.cycles:
            self._publish_counts(self._run_time())
        self._drain()

    def _drain(self) -> None:
        realtime.drain(DRAIN_TIMEOUT)

    def stop(self) -> None:
        """Let `run` return after this cycle; from any thread or a signal handler."""
        self._stopping = True
        self.hw.stop()

    def shutdown(self) -> None:
        """Take everything back and release the robot; after `run` returned. The first failure is raised when all have been tried."""
        failure: Exception | None = None
        while self._closers:
            try:
                self._closers.pop()()
            except Exception as error:
                failure = failure or error
        if failure is not None:
            raise failure
