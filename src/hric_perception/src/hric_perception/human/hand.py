"""The hand: a program with a beginning, safe to ask from several threads. No ROS."""

from __future__ import annotations

import math
import threading

from hric_control.errors import HricError
from hric_perception.human.programs import Program
from hric_perception.section import Vector
from mocap_natnet.poses import Pose

BEFORE = -1.0
"""Any time before the program's start [s]."""


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

    def _since(self, time: float) -> float:
        return time - self._zero if self._zero < math.inf else BEFORE
