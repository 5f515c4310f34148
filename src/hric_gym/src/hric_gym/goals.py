"""Goals of the tasks: the desired position of the end effector, or of the person's hand, over time."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from franka_hw_interface.model import FrankaFrame
from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.separation.capsules import distances
from hric_controllers.policy.contract import moved
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.hand import read_program
from hric_run.observation import SimulationState
from hric_supervisor.arm import ArmShape

BOX = np.array([0.35, -0.35, 0.2]), np.array([0.6, 0.35, 0.6])
"""Corners of the box from which goals are drawn, world [m] (project default)."""
NEAR = 0.03
"""Distance from a drawn goal at which it is reached [m] (project default)."""
DRAWS = 100
"""Largest number of draws of a goal (project default). In the task Reach, a quarter of the points is refused."""
STRIDES, PERIOD = 8, 0.5
"""Number of steps in which the motion to a drawn goal is computed, and the time of each [s]."""


class Goal(ABC):
    """Goal of a task over time."""

    near = 0.0
    """Distance from the goal at which the episode is a success and ends [m]; 0: never."""

    @abstractmethod
    def restart(self, random: np.random.Generator, seed: int, observation: SimulationState) -> None:
        """Choose the goal of a new episode.

        Args:
            random: random generator of the environment.
            seed: seed of the simulation in this episode.
            observation: state at the start of the episode.

        Raises:
            HricError: there is no possible goal.
        """

    @abstractmethod
    def at(self, time: float) -> FloatArray:
        """Return the goal in the world at a robot time [s], shape (3,) [m]."""

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the end effector from the goal [m]."""
        assert observation.arm.T_base_ee is not None
        return math.dist(observation.arm.T_base_ee[:3, 3].tolist(), self.at(observation.time).tolist())


class DrawnGoal(Goal):
    """Random point of BOX, drawn in each episode, at which the arm does not touch the person in their first posture.

    The arm that moves straight to the point has a distance of at least NEAR from the person there, since the end
    effector may stop at this distance from the point. At nearer points the arm cannot end without contact.

    Args:
        hw: the simulated arm.
    """

    near = NEAR

    def __init__(self, hw: FrankaHWSim) -> None:
        self._model, self._q_start = hw.model, np.array(hw.q_start)
        self._shape = ArmShape(hw.description, hw.states.names)

    def restart(self, random: np.random.Generator, seed: int, observation: SimulationState) -> None:
        """Draw the point from BOX, again until it is far enough from the person."""
        for _ in range(DRAWS):
            self._point = random.uniform(*BOX)
            if self.clearance(observation) >= NEAR:
                return
        raise HricError(
            f"the person is at all of {DRAWS} drawn goals; valid: a person farther from the arm (argument changes)"
        )

    def clearance(self, observation: SimulationState) -> float:
        """Return the distance between the person in a state and the arm at the goal [m]; negative: overlap."""
        if observation.person is None:
            return np.inf
        q = self._q_start
        for left in range(STRIDES, 0, -1):
            offset = self._point - self._model.pose(FrankaFrame.END_EFFECTOR, q.tolist())[:3, 3]
            q = moved(self._model, q, offset / left, PERIOD)
        person = observation.person.capsules
        apart = distances(self._shape.ends(q[None]), self._shape.capsules.radii, person.ends[None], person.radii)
        return float(apart.min())

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

    def restart(self, random: np.random.Generator, seed: int, observation: SimulationState) -> None:
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

    def restart(self, random: np.random.Generator, seed: int, observation: SimulationState) -> None:
        """Read the motion program with the variation that the person has with this seed."""
        self._program = read_program(dict(self._intention), seed)

    def at(self, time: float) -> FloatArray:
        """Return the position of the hand in its motion program, world, shape (3,) [m]."""
        return np.array(self._program.pose(time - self._zero).position)

    def distance(self, observation: SimulationState) -> float:
        """Return the distance of the person's hand from the goal [m]."""
        assert observation.person is not None
        return float(np.linalg.norm(observation.person.T_world_hand[:3, 3] - self.at(observation.time)))
