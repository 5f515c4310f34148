"""Hand of a human: the base class of motion programs, and the hand that runs one."""

import math
import threading

from hric_core.errors import HricError
from hric_core.geometry import Pose, Vector

REST, MOVING, DONE = "rest", "moving", "done"
BEFORE = -1.0
"""Program time that is used for any time before the program's start [s]."""


class Program:
    """Motion of the hand; a subclass overrides `pose` and `span`, a reactive one also `phase`, `see` and `feel`."""

    def pose(self, time: float) -> Pose:
        """Return the pose at `time` [s] after the start; calls may be out of order, by a second at most."""
        raise NotImplementedError

    @property
    def span(self) -> tuple[float, float]:
        """Start and end of the motion in program time [s]; an infinite end is unknown in advance."""
        raise NotImplementedError

    def phase(self, time: float) -> str:
        """Return the phase of the motion at `time` [s] after the start: "rest", "moving", "done", or a subclass's."""
        begin, end = self.span
        return REST if time < begin else MOVING if time < end else DONE

    def see(self, time: float, position: Vector) -> None:
        """Receive the position [m] of the robot's end effector at `time` [s]."""

    def feel(self, time: float, force: Vector) -> None:
        """Receive the force [N] on the hand at `time` [s]."""


class Hand:
    """Callable that returns the pose of a hand in the robot's base frame (z up) at a robot time.

    Args:
        program: program that moves the hand. Before `start` the hand rests at the program's first pose.
        begin: rest between the call of `start` and program time 0 [s].

    Attributes:
        feels: False if the program ignores forces.
    """

    def __init__(self, program: Program, begin: float = 0.0) -> None:
        self._program, self._begin, self._lock = program, begin, threading.RLock()
        self._zero, self.feels = math.inf, type(program).feel is not Program.feel

    def start(self, time: float) -> float:
        """Start the program `begin` seconds after `time` [s], and return the program's start time [s].

        Raises:
            HricError: the program has started already.
        """
        with self._lock:
            if self._zero < math.inf:
                raise HricError(f"the hand's program has already started at {self._zero:.3f} s; it runs only once")
            self._zero = time + self._begin
            return self._zero

    def since(self, time: float) -> float:
        """Convert robot time to program time [s]; negative before the program's start."""
        zero = self._zero  # read once: another thread may start the program
        return time - zero if zero < math.inf else BEFORE

    def __call__(self, time: float) -> Pose:
        """Return the pose of the hand at robot time `time` [s]."""
        with self._lock:
            return self._program.pose(self.since(time))

    def phase(self, time: float) -> str:
        """Return the phase of the program at robot time `time` [s]."""
        with self._lock:
            return self._program.phase(self.since(time))

    def see(self, time: float, position: Vector) -> None:
        """Pass the position [m] of the robot's end effector at `time` to the program."""
        with self._lock:
            if self._zero < math.inf:
                self._program.see(self.since(time), position)

    def feel(self, time: float, force: Vector) -> None:
        """Pass a force [N] on the hand at `time` to the program."""
        with self._lock:
            if self._zero < math.inf:
                self._program.feel(self.since(time), force)
