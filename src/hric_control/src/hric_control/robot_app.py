"""Robot with its controllers, manager and topics: common code of the robot node and of runs without ROS."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter, sleep
from typing import Any

from hric_control import transmission
from hric_control.clock_pairs import RobotClock
from hric_control.control_log import ControlLog
from hric_control.diagnostics import Diagnostics
from hric_control.hardware_interface import JointStateInterface
from hric_control.limits import LimitCounts
from hric_control.manager.controller_manager import ControllerManager
from hric_control.manager.services import ManagerServices
from hric_control.robot_hw import RobotHW
from hric_control.sim.services import SimServices
from hric_control.sim.sim_loop import REAL_TIME_FACTOR
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_control.speed_scale_topics import SpeedScaleTopics
from hric_core import plugins, realtime
from hric_core.errors import DescriptionError, HricError, failing
from hric_core.node import Node
from hric_core.parameters import Settings, flag, number, text
from hric_core.processes import quiet_collector
from hric_core.robot_time import stamps
from hric_core.scoped_node import ScopedNode
from hric_msgs.msg import ControlLog as ControlLogMessage
from hric_msgs.msg import JointLimitCounts

CLOCK_PERIOD = 0.01
"""Period of /clock [s of robot time]."""
COUNTS_PERIOD = 1.0
"""Period of the topic limit_counts [s of robot time]."""
LISTENER_POLL = 0.01
"""Period of the check whether control_log has a subscriber [s of wall time]."""
DRAIN_TIMEOUT = 0.5
"""Longest time for which an unpaced loop waits until its messages are sent [s of wall time]."""
COMMON_PARAMETERS = ("arm_id", "failure", "participants", "plant", "plant_type", "q_start", "realism")
"""Private parameters that are valid for every robot, as one experiment file is used for simulated and real robots.

An experiment sets them, except `failure`, in which the robot node reports why it ended."""


@dataclass(frozen=True)
class RobotSettings(Settings):
    """Parameters common to all robots; each type of robot has further ones."""

    robot_hw: str = text(
        "", valid="a type", text="plugin type of the RobotHW; empty: `robotSimType` of the description"
    )
    real_time_factor: float = REAL_TIME_FACTOR
    control_log: bool = flag(True, text="publish `control_log`")
    wait_for_log_listener: float = number(
        0.0,
        minimum=0.0,
        unit="s of wall time",
        text="longest time for which the run waits at robot time 0 until `control_log` has a subscriber, so that a "
        "recording has every cycle",
    )


def robot_hw_type(root_node: Node, robot_hw_node: Node) -> str:
    """Return the type of the RobotHW plugin: the parameter `robot_hw`, or else `robotSimType` in the description.

    Raises:
        HricError: neither is set; the message lists the existing types.
    """
    type_name = RobotSettings.read(robot_hw_node).robot_hw or transmission.robot_sim_type(
        root_node.search_param("robot_description", "<robot/>")
    )
    if not type_name:
        valid = ", ".join(sorted(plugins.names(plugins.ROBOT_HW))) or "none"
        raise DescriptionError(
            f"{robot_hw_node.resolve('robot_hw')} is not set and robot_description has no robotSimType; valid: {valid}"
        )
    return type_name


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
        self.name = type(hw).__name__ if hw is not None else robot_hw_type(root_node, scope)
        self.hw: RobotHW = hw if hw is not None else plugins.find(plugins.ROBOT_HW, self.name)()
        self.cycles = 0
        self._live = live
        self._end: float | None = None
        self._log_publisher: realtime.RealtimePublisher | None = None
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
        self._counts = realtime.publisher(root, "limit_counts", JointLimitCounts) if counted else None
        self.log = self._make_log()
        period = self.hw.period
        self._clock_cycles, self._counts_cycles = (
            max(1, round(CLOCK_PERIOD / period)),
            max(1, round(COUNTS_PERIOD / period)),
        )
        self.manager = ControllerManager(self.hw, root)
        self.manager.loop_running = self._live
        offered = ScopedNode(root)
        self._closers += [self.manager.shutdown, offered.close]
        self._scale = self.hw.speed_scale
        self._scale_topics = SpeedScaleTopics(offered, self._scale, self._clock.stamp)
        ManagerServices(self.manager, offered)
        self.simulated = isinstance(self.hw, SimulatedRobot)
        if isinstance(self.hw, SimulatedRobot):
            SimServices(self.hw, offered)
        if self._live:
            gate = None if self._pairs is None else self._pairs.gate
            status = Diagnostics(root, self.name, self.loop, self.limit_counts if counted else None, gate)
            status.start()
            self._closers.append(status.stop)

    def _make_log(self) -> ControlLog | None:
        if not (self._settings.control_log and self.hw.log_row()[0]):
            return None
        publisher = self._log_publisher = realtime.publisher(
            self.root_node, "control_log", ControlLogMessage, lossless=True
        )
        states = self.hw.get(JointStateInterface).states
        return ControlLog(states, self.hw.log_row, publisher.publish, self._clock.stamp)

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
        if self._scale.active:
            self._scale_topics.advance(time, period)
        self.manager.update(time, period, reset_controllers)
        if log is not None:
            log.begin(time)
        cycle = self.cycles
        self.cycles = cycle + 1
        if cycle % self._clock_cycles == 0:
            self._clock.publish(stamps.to_time(time))
            if cycle % self._counts_cycles == 0:
                self._publish_counts(time)
        if self._end is not None and time + 1.5 * self.hw.period > self._end:
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
        if timeout == 0.0 or self._log_publisher is None:
            return
        # A switch of controllers that is requested meanwhile must wait longer, as the loop begins later.
        patience, self.manager.loop_timeout = self.manager.loop_timeout, self.manager.loop_timeout + timeout
        deadline = perf_counter() + timeout
        try:
            while not self._log_publisher.subscribers() and not self._stopping:
                if perf_counter() > deadline:
                    self.root_node.log_warn(
                        f"control_log has no subscriber after {timeout:g} s (wait_for_log_listener): the run begins, "
                        "and its first cycles will be missing in a recording"
                    )
                    return
                self._clock.publish(stamps.FIRST)
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
