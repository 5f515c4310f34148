"""Robot with its controllers, manager and topics: common code of the robot node and of runs without ROS."""

from collections.abc import Callable
from time import perf_counter, sleep
from typing import Any

from hric_control.clock_pairs import RobotClock
from hric_control.control_log import ControlLog
from hric_control.diagnostics import Diagnostics
from hric_control.limits import LimitCounts
from hric_control.manager.controller_manager import ControllerManager
from hric_control.manager.services import ManagerServices
from hric_control.robot_hw import RobotHW
from hric_control.robot_settings import COMMON_PARAMETERS, RobotSettings, new_robot_hw
from hric_control.sim.services import sim_services
from hric_control.speed_scale_topics import SpeedScaleTopics
from hric_core import realtime
from hric_core.errors import HricError, failing
from hric_core.node import Node
from hric_core.processes import quiet_collector
from hric_core.scoped_node import ScopedNode

CLOCK_PERIOD = 0.01
"""Period of /clock [s of robot time]."""
COUNTS_PERIOD = 1.0
"""Period of the topic limit_counts [s of robot time]."""
LISTENER_POLL = 0.01
"""Period of the check whether control_log has a subscriber [s of wall time]."""
DRAIN_TIMEOUT = 0.5
"""Longest time for which an unpaced loop waits until its messages are sent [s of wall time]."""


class RobotApp:
    """Robot (RobotHW) with controller manager, services, control log, clock and diagnostics, with or without ROS.

    Args:
        root_node: node of the robot's namespace.
        robot_hw_node: node with the parameters of the RobotHW and of this class (`robot_hw`, `control_log`, ...).
        hw: robot that is constructed but not initialised; None: the plugin selected by the parameters.
        live: True in a process with a ROS master: a thread publishes `/diagnostics` at 1 Hz of wall time, sensor
            drivers get robot time on `hric/clock`, and a switch of controllers always waits for the loop. False:
            everything happens in the calling thread, and a switch between two runs is executed at once.
        on_clock: callback, in the loop's thread, for each stamp published on /clock.

    Attributes:
        hw: the robot.
        name: plugin type of the robot.
        simulated: True if the robot is simulated; then it has a clock and services of its own.
        manager: the controller manager.
        loop: loop of a simulated robot, or None.
        cycles: number of cycles so far.

    Raises:
        HricError: the robot cannot be initialised.
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
        scope = ScopedNode(robot_hw_node)
        self.name, self.hw = new_robot_hw(root_node, scope) if hw is None else (type(hw).__name__, hw)
        self.cycles = 0
        self._live = live
        self._end: float | None = None
        self._stopping = False
        self._hook: Callable[[float], None] | None = None
        self._closers: list[Callable[[], None]] = []
        self.hw.init(root_node, scope)
        self._closers.append(self.hw.shutdown)
        try:
            RobotSettings.read(scope)
            scope.refuse_unread(COMMON_PARAMETERS)
            self._wire(on_clock)
        except BaseException:
            self.shutdown()
            raise

    def _wire(self, on_clock: Callable[[Any], None] | None) -> None:
        self._settings = RobotSettings.read(self.robot_hw_node)
        root, self.loop = self.root_node, self.hw.loop
        if self.loop is not None:
            self.loop.on_idle = lambda: realtime.hand_over(DRAIN_TIMEOUT)
        self._clock = RobotClock(self.hw, (root, self.robot_hw_node), self._live, on_clock)
        self._pairs = self._clock.pairs
        counted = self.hw.limiter_counts() is not None
        self._counts = LimitCounts.publisher(root) if counted else None
        logged = self._settings.control_log and self.hw.log_row()[0]
        self.log = ControlLog(self.hw, root, self._clock.stamp) if logged else None
        period = self.hw.period
        self._clock_cycles = max(1, round(CLOCK_PERIOD / period))
        self._counts_cycles = max(1, round(COUNTS_PERIOD / period))
        self._ahead = 1.5 * period
        self.manager = ControllerManager(self.hw, root)
        self.manager.loop_running = self._live
        self.manager.share_robots([app.manager for app in self.hw.apps.values()])
        offered = ScopedNode(root)
        self._closers += [self.manager.shutdown, offered.close]
        self._scale = self.hw.speed_scale
        self._scale_topics: SpeedScaleTopics | None = None
        ManagerServices(self.manager, offered)
        self.simulated = False
        if self.hw.shared is not None:
            return  # the robots' common RobotHW has the topics and services of world, speed scale and loop
        self._scale_topics = SpeedScaleTopics(offered, self._scale, self._clock.stamp)
        self.simulated = sim_services(self.hw, offered) is not None
        if self._live:
            gate = None if self._pairs is None else self._pairs.gate
            status = Diagnostics(root, self.name, self.loop, self.limit_counts if counted else None, gate)
            status.start()
            self._closers.append(status.stop)

    def limit_counts(self) -> LimitCounts:
        """Return a copy of the limit counts since the start, over all interfaces; without joints if there are none."""
        counts = self.hw.limiter_counts()
        return LimitCounts((), ()) if counts is None else counts.copy()

    def on_cycle(self, time: float, period: float, reset_controllers: bool) -> bool:
        """Run the part of a cycle between the robot's `read` and `write`: update the controllers and log a row.

        Args:
            time: robot time at the measuring instant [s].
            period: time since the last cycle [s].
            reset_controllers: True to restart the running controllers first.

        Returns:
            False if a robot without a `loop` must leave its command mode, as controllers are being switched.
        """
        log = self.log
        if log is not None:
            log.complete()
        if self._pairs is not None:
            self._pairs.send_due(time)
        if self._hook is not None:
            self._hook(time)
        if self._scale.active and self._scale_topics is not None:
            self._scale_topics.advance(time, period)
        self.manager.update(time, period, reset_controllers)
        if log is not None:
            log.begin(time)
        cycle = self.cycles
        self.cycles = cycle + 1
        if cycle % self._clock_cycles == 0:
            self._clock.publish(time)
            if cycle % self._counts_cycles == 0:
                self._publish_counts(time)
        if self._end is not None and time + self._ahead > self._end:
            self.hw.stop()
        return self.loop is not None or not self.manager.switch_pending

    def _publish_counts(self, time: float) -> None:
        if self._counts is not None:
            self._counts.publish(LimitCounts.message, self.limit_counts(), self._clock.stamp(time))

    def wait_for_log_listener(self) -> None:
        """Wait until `control_log` has a subscriber, so that a recording contains every cycle; robot time stays at 0.

        To be called before `run`. The parameter `wait_for_log_listener` is the longest wait [s of wall time], 0 by
        default; after it, a warning is logged. Returns at once if there is no control log or `stop` was called.
        """
        timeout = self._settings.wait_for_log_listener
        if timeout == 0.0 or self.log is None:
            return
        # A switch of controllers that is requested meanwhile must wait longer, as the loop begins later.
        patience, self.manager.loop_timeout = self.manager.loop_timeout, self.manager.loop_timeout + timeout
        deadline = perf_counter() + timeout
        try:
            while not self.log.publisher.subscribers() and not self._stopping:
                if perf_counter() > deadline:
                    self.root_node.log_warn(
                        f"control_log has no subscriber after {timeout:g} s (wait_for_log_listener): the run begins, "
                        "and its first cycles will be missing in a recording"
                    )
                    return
                self._clock.publish(None)
                if self.simulated:
                    self._clock.pair_now()
                sleep(LISTENER_POLL)
        finally:
            self.manager.loop_timeout = patience

    def run(self, duration: float | None = None, on_cycle_hook: Callable[[float], None] | None = None) -> None:
        """Run the robot until `stop` is called, or for `duration`; at the end, publish the rest of the control log.

        Args:
            duration: robot time for which to run, a whole number of cycles [s]; None: until stopped.
            on_cycle_hook: callback with robot time [s], in each cycle after `read` and before the controllers; must not
                block.
        """
        if duration is not None and self.hw.time is None:
            raise HricError(
                f"{self.name} has no robot time, so run() cannot have a duration; call run() without one, then stop()"
            )
        if duration is not None and round(duration / self.hw.period) < 1:
            return
        self._end, self._hook = None if duration is None else self._clock.time + duration, on_cycle_hook
        self.manager.loop_running = True
        try:
            with failing(), quiet_collector():
                self.hw.run(self.on_cycle)
        finally:
            self.manager.loop_running = self._live
            self._end = self._hook = None
            self._finish_log()

    def _finish_log(self) -> None:
        if self.log is not None:
            self.log.complete()
            self.log.flush()
        if self.cycles:
            self._publish_counts(self._clock.time)
        realtime.drain(DRAIN_TIMEOUT)

    def stop(self) -> None:
        """Let `run` return after the present cycle. May be called from any thread or a signal handler."""
        self._stopping = True
        self.hw.stop()

    def shutdown(self) -> None:
        """Unregister all topics and services and release the robot; to be called after `run` has returned.

        An error does not prevent the remaining steps; the first error is raised at the end."""
        failure: Exception | None = None
        while self._closers:
            try:
                self._closers.pop()()
            except Exception as error:
                failure = failure or error
        if failure is not None:
            raise failure
