"""Goals of the tasks: where the end effector, or the person's hand, is to be at each time."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.hand import read_program
from hric_run.observation import SimulationState

BOX = np.array([0.35, -0.35, 0.2]), np.array([0.6, 0.35, 0.6])
"""Corners of the box from which goals are drawn, world [m] (project default)."""
NEAR = 0.03
"""Distance from a drawn goal at which it is reached [m] (project default)."""


class Goal(ABC):
    """Goal of a task over time."""

    near = 0.0
    """Distance from the goal at which the episode is a success and ends [m]; 0: never."""

    @abstractmethod
    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Begin an episode; random: generator of the environment, seed: seed of its simulation."""

    @abstractmethod
    def at(self, time: float) -> FloatArray:
        """Return the goal at a robot time [s], world, shape (3,) [m]."""

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the end effector from the goal [m]."""
        assert observation.arm.T_base_ee is not None
        return float(np.linalg.norm(observation.arm.T_base_ee[:3, 3] - self.at(observation.time)))


class DrawnGoal(Goal):
    """Random point of BOX in each episode."""

    near = NEAR

    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Draw a point."""
        self._point = random.uniform(*BOX)

    def at(self, time: float) -> FloatArray:
        """Return the point."""
        return self._point


class SetpointGoal(Goal):
    """Position of the end effector at the experiment's newest setpoint.

    Args:
        setpoints: (time [s], joint positions [rad]) in order of time.
        position: function, joint positions [rad] -> position of the end effector, shape (3,) [m].
    """

    def __init__(
        self, setpoints: Sequence[tuple[float, Sequence[float]]], position: Callable[[Sequence[float]], FloatArray]
    ) -> None:
        self._points = [(time, position(q)) for time, q in setpoints]

    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Do nothing: the setpoints are those of the experiment."""

    def at(self, time: float) -> FloatArray:
        """Return the position at the newest setpoint; before the first one that of the first."""
        sent = [point for begin, point in self._points if begin <= time]
        return sent[-1] if sent else self._points[0][1]


class HandGoal(Goal):
    """Position at which the person wants their hand to be.

    Args:
        intention: content of the motion program of the hand.
        start: robot time at which the motion starts [s].
    """

    def __init__(self, intention: Mapping[str, Any], start: float) -> None:
        self._intention, self._zero = intention, start + float(intention.get("begin", 0.0))

    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Vary the motion as the person with this seed does."""
        self._program = read_program(dict(self._intention), seed)

    def at(self, time: float) -> FloatArray:
        """Return the position of the program."""
        return np.array(self._program.pose(time - self._zero).position)

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the person's hand from the goal [m]."""
        assert observation.person is not None
        return float(np.linalg.norm(observation.person.T_world_hand[:3, 3] - self.at(observation.time)))
