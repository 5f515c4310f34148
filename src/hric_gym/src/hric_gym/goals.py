"""Goals of the tasks: the desired position of the end effector, or of the person's hand, over time."""

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
        """Choose the goal of a new episode.

        Args:
            random: random generator of the environment.
            seed: seed of the simulation in this episode.
        """

    @abstractmethod
    def at(self, time: float) -> FloatArray:
        """Return the goal in the world at a robot time [s], shape (3,) [m]."""

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the end effector from the goal [m]."""
        assert observation.arm.T_base_ee is not None
        return float(np.linalg.norm(observation.arm.T_base_ee[:3, 3] - self.at(observation.time)))


class DrawnGoal(Goal):
    """Random point of BOX in each episode."""

    near = NEAR

    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Draw the point from BOX."""
        self._point = random.uniform(*BOX)

    def at(self, time: float) -> FloatArray:
        """Return the drawn point in the world, shape (3,) [m], which is the same at all times."""
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
        """Return the end effector's position at the newest setpoint, shape (3,) [m]; before any, at the first one."""
        sent = [point for begin, point in self._points if begin <= time]
        return sent[-1] if sent else self._points[0][1]


class HandGoal(Goal):
    """Position at which the person wants their hand to be.

    Args:
        intention: motion program of the hand, as `human.control.parameters.reference` has it.
        start: robot time at which the motion starts [s].
    """

    def __init__(self, intention: Mapping[str, Any], start: float) -> None:
        self._intention, self._zero = intention, start + float(intention.get("begin", 0.0))

    def restart(self, random: np.random.Generator, seed: int) -> None:
        """Read the motion program with the variation that the person has with this seed."""
        self._program = read_program(dict(self._intention), seed)

    def at(self, time: float) -> FloatArray:
        """Return the position of the hand in its motion program, world, shape (3,) [m]."""
        return np.array(self._program.pose(time - self._zero).position)

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the person's hand from the goal [m]."""
        assert observation.person is not None
        return float(np.linalg.norm(observation.person.T_world_hand[:3, 3] - self.at(observation.time)))
