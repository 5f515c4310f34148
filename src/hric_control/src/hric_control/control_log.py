"""Log of every control cycle, published in batches: measured states, and commands before and after the limits."""

from collections.abc import Callable, Sequence
from typing import Any

from hric_control.hardware_interface import JointStateInterface
from hric_control.robot_hw import RobotHW
from hric_core import realtime
from hric_core.geometry import stamped
from hric_core.node import Node
from hric_msgs.msg import ControlLog as ControlLogMessage

BATCH = 20
"""Number of control cycles per message: at 1 kHz, 50 messages per second."""


class ControlLog:
    """Collector of one row of values per control cycle; it publishes a message with a batch of rows.

    The loop handles plain floats; the message is built in another thread. A row is begun after the update of the
    controllers and completed at the start of the next cycle. By then the robot has written its commands, even a robot
    that drives the loop itself.

    Args:
        hw: robot, initialised, with joints; its states are copied by `begin`.
        node: node that advertises `control_log`; `publisher` is an attribute.
        stamp: function that converts robot time [s] to a message stamp.
    """

    def __init__(self, hw: RobotHW, node: Node, stamp: Callable[[float], Any]) -> None:
        self._states, self._row, self._stamp = hw.get(JointStateInterface).states, hw.log_row, stamp
        self.publisher = realtime.publisher(node, "control_log", ControlLogMessage, lossless=True)
        self._names = list(self._states.names)
        self._first = 0
        self._open = False
        self._kinds: list[str] = []
        self._last_kinds: Sequence[str] | None = None
        self._clear()

    def _clear(self) -> None:
        self._time: list[float] = []
        self._position: list[float] = []
        self._velocity: list[float] = []
        self._effort: list[float] = []
        self._raw: list[float] = []
        self._sent: list[float] = []

    def begin(self, time: float) -> None:
        """Begin a row with the states measured in this cycle; called after the controllers' update.

        Args:
            time: robot time of the cycle [s].
        """
        states = self._states
        self._time.append(time)
        self._position += states.position
        self._velocity += states.velocity
        self._effort += states.effort
        self._open = True

    def complete(self) -> None:
        """Complete the row of the last cycle with its commands, which are written by now; do nothing without a row."""
        if not self._open:
            return
        self._open = False
        kinds, raw, sent = self._row()
        # Between two switches the robot returns the same list object, so that an identity test saves comparing names.
        if kinds is not self._last_kinds and self._change_kinds(kinds):
            self._split(raw, sent)
            return
        self._raw += raw
        self._sent += sent
        if len(self._time) >= BATCH:
            self.flush()

    def _change_kinds(self, kinds: Sequence[str]) -> bool:
        self._last_kinds = kinds
        if kinds == self._kinds:
            return False
        self._next_kinds = list(kinds)
        return True

    def _split(self, raw: Sequence[float], sent: Sequence[float]) -> None:
        """Publish the rows before the last one, and begin a new message with that, as its command interfaces differ."""
        n, states = len(self._names), (self._position, self._velocity, self._effort)
        time, last = self._time.pop(), [values[-n:] for values in states]
        for values in states:
            del values[-n:]
        self.flush()
        self._kinds = self._next_kinds
        self._time, self._raw, self._sent = [time], list(raw), list(sent)
        self._position, self._velocity, self._effort = last

    def flush(self) -> None:
        """Publish the completed rows, if there are any."""
        n = len(self._time)
        if n == 0:
            return
        first, self._first = self._first, self._first + n
        values = (self._time, self._position, self._velocity, self._effort, self._raw, self._sent)
        names, kinds, stamp = self._names, self._kinds, self._stamp
        self._clear()
        self.publisher.publish(_message, names, kinds, first, stamp(values[0][0]), values)


def _message(names: list[str], kinds: list[str], first: int, stamp: Any, values: tuple[list[float], ...]) -> Any:
    # Fields are set one by one: constructors check and fill all of them, and take three times as long.
    message: ControlLogMessage = object.__new__(ControlLogMessage)
    message.joint_names, message.command_interface = names, kinds
    message.first_cycle, message.n_cycles = first, len(values[0])
    message.time, message.position, message.velocity, message.effort, message.command_raw, message.command = values
    message.header = stamped.header(stamp, "")
    return message
