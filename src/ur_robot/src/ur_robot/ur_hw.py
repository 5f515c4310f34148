"""Arm of Universal Robots as a RobotHW, through ur_rtde."""

import math
from collections.abc import Sequence

from hric_control.hardware_interface import JointCommands, JointStateInterface, JointStates, PositionJointInterface
from hric_control.limits import LimitCounts, PositionLimiter, load_limits
from hric_control.robot_hw import ControllerInfo, LogRow, OnCycle, RobotHW
from hric_control.transmission import parse_transmissions
from hric_core.errors import DescriptionError
from hric_core.node import Node
from hric_core.realtime_setup import realtime
from hric_core.robot_time.arm_time import ArmTime
from hric_core.urdf import read
from ur_robot.connection import UrConnection, UrSettings

JOINTS = 6
PERIOD = 0.002
"""Period of the states and of servo commands of an e-Series arm [s]."""


class UrHW(RobotHW):
    """Arm of Universal Robots (e-Series) as a RobotHW: joint states, and joint positions by `servoj` at 500 Hz.

    The controller's clock times the cycles. Joints that no controller claims hold the position that was last commanded.
    The run ends with an error if the arm stops, the control program ends, or no state arrives. Nothing recovers by
    itself.

    Attributes, in addition to those of `RobotHW`:
        description: URDF of the robot.
        states: joint states; the effort is NaN, as ur_rtde's Python interface does not give it.
    """

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters, connect to the arm and start its control program."""
        self._node = robot_hw_node
        self._settings = settings = UrSettings.read(robot_hw_node)
        self.description = root_node.search_param("robot_description")
        names = [transmission.joint for transmission in parse_transmissions(self.description)]
        if len(names) != JOINTS:
            raise DescriptionError(
                f"robot_description has {len(names)} joints with a transmission; an arm of UR has {JOINTS}"
            )
        limits = load_limits(self.description, root_node, names, settings.enforce_limits)
        _check_order(self.description, names)
        self.states = states = JointStates(names)
        states.effort[:] = [math.nan] * JOINTS
        self._commands = JointCommands(states)
        self._counts = LimitCounts(states.names, [limit.velocity for limit in limits])
        self._limiter = PositionLimiter(states, self._commands, limits, self._counts)
        self.register_interface(JointStateInterface(states))
        self.register_interface(PositionJointInterface(self._commands))
        self._claimed: set[str] = set()
        self._moved = False
        self._limiter.select(())
        self._stop = False
        self.arm_time = self._robot_time = ArmTime([root_node, robot_hw_node], PERIOD)
        self._connection = UrConnection(settings)
        self._connection.wait()
        self._connection.read(states.position, states.velocity)
        self._hold()

    @property
    def period(self) -> float:
        """Period of the control loop [s]."""
        return PERIOD

    def limiter_counts(self) -> LimitCounts:
        """Return the counts of limited commands since the start."""
        return self._counts

    def log_row(self) -> LogRow:
        """Return the commands of the last cycle, for the control log."""
        kinds = ["position" if name in self._claimed else "none" for name in self.states.names]
        return kinds, self._raw, self._commands.value

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Hold each joint whose claim changes at the position that was last commanded."""
        before = set(self._claimed)
        for info in stop:
            self._claimed -= _positions(info)
        for info in start:
            self._claimed |= _positions(info)
        if before != self._claimed:
            self._limiter.select(self._claimed)
            self._limiter.reset(self._commands.value)
        self._moved = self._moved or bool(self._claimed)

    def run(self, on_cycle: OnCycle) -> None:
        """Run one cycle after each state of the controller, until `stop`. Raises UrLostError or UrStoppedError."""
        settings, connection, states = self._settings, self._connection, self.states
        with realtime(settings.realtime_priority, settings.lock_memory, settings.switch_interval) as measures:
            for measure in measures:
                (self._node.log_info if measure.done else self._node.log_warn)(f"real time: {measure.text}")
            connection.start()
            self._hold()
            reset = True
            while not self._stop:
                period = self._robot_time.advance(round(1e3 * connection.wait()))
                connection.read(states.position, states.velocity)
                if period <= 0.0:
                    continue
                on_cycle(self._robot_time.time, period, reset)
                self.write(self._robot_time.time, period)
                reset = False
        self._stop = False

    def _hold(self) -> None:
        """Set the commands to the position that the arm holds."""
        self._commands.value[:] = self._raw = self._connection.target()
        self._limiter.reset(self._commands.value)
        self._moved = bool(self._claimed)

    def write(self, time: float, period: float) -> None:
        """Limit the commands, then send them; before the first motion, only report that the program runs."""
        self._raw = self._commands.value[:]
        if self._claimed:
            self._limiter.enforce(period)
        if self._moved:
            self._connection.servo(self._commands.value, PERIOD)
        else:
            self._connection.keep()

    def stop(self) -> None:
        """Let `run` return after the present cycle; may be called from any thread or a signal handler."""
        self._stop = True

    def shutdown(self) -> None:
        """End the control program and the connection; the arm stops and holds."""
        self._connection.close()


def _check_order(description: str, names: Sequence[str]) -> None:
    """Refuse joints that are not in the order of the controller's values, which is from the base to the flange."""
    tree = read(description)
    ordered = sorted(names, key=lambda name: len(tree.path(tree.root, tree.joints[name].child)))
    if list(names) != ordered:
        raise DescriptionError(
            f"robot_description has transmissions in the order {', '.join(names)}; valid: from the base to the flange, "
            f"{', '.join(ordered)}"
        )


def _positions(info: ControllerInfo) -> frozenset[str]:
    return info.claims.get(PositionJointInterface.cpp_name, frozenset())
