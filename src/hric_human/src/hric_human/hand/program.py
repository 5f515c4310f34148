"""The hand of a human: what a program of its motion is, and the hand that runs one."""

import math
import threading

from hric_control.errors import HricError
from hric_control.geometry import Pose, Vector

REST, MOVING, DONE = "rest", "moving", "done"
BEFORE = -1.0
"""Any time before the program's start [s]."""


class Program:
    """A motion of the hand; a subclass overrides `pose` and `span`, one that reacts `phase`, `see` and `feel`."""

    def pose(self, time: float) -> Pose:
        """Where the hand is `time` seconds after the start; times may come out of order, by a second at most."""
        raise NotImplementedError

    @property
    def span(self) -> tuple[float, float]:
        """When the hand sets off and when it has come to rest, after the start [s]; infinite: not known before."""
        raise NotImplementedError

    def phase(self, time: float) -> str:
        """What it does then: a word."""
        begin, end = self.span
        return REST if time < begin else MOVING if time < end else DONE

    def see(self, time: float, position: Vector) -> None:
        """The robot's end effector was at `position` [m] at `time` [s]."""

    def feel(self, time: float, force: Vector) -> None:
        """The hand feels a force [N] at `time` [s]."""


class Hand:
    """A source of poses in the robot's base, z up: call it with a time.

    Args:
        program: what moves it. Before `start` the hand rests at the program's first pose.
        begin: rest between `start` and the program's time 0 [s].
    """

    def __init__(self, program: Program, begin: float = 0.0) -> None:
        self._program, self._begin, self._lock = program, begin, threading.Lock()
        self._zero = math.inf

    def start(self, time: float) -> float:
        """The program begins `begin` after `time` [s]; when that is.

        Raises:
            HricError: it has begun already.
        """
        with self._lock:
            if self._zero < math.inf:
                raise HricError(f"the hand has moved since {self._zero:.3f} s; a program runs once")
            self._zero = time + self._begin
            return self._zero

    def since(self, time: float) -> float:
        """Time of the program [s]; below 0: it has not begun."""
        with self._lock:
            return self._since(time)

    def __call__(self, time: float) -> Pose:
        """Where it is [m]."""
        with self._lock:
            return self._program.pose(self._since(time))

    def phase(self, time: float) -> str:
        """What it does."""
        with self._lock:
            return self._program.phase(self._since(time))

    def see(self, time: float, position: Vector) -> None:
        """The robot's end effector was at `position` [m] at `time`."""
        with self._lock:
            if self._zero < math.inf:
                self._program.see(self._since(time), position)

    def feel(self, time: float, force: Vector) -> None:
        """It feels a force [N] at `time`."""
        with self._lock:
            if self._zero < math.inf:
                self._program.feel(self._since(time), force)

    def _since(self, time: float) -> float:
        return time - self._zero if self._zero < math.inf else BEFORE
