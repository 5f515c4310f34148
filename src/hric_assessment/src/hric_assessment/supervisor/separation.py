"""How near a person is to an arm, part by part, and how fast the arm may be for it."""

from dataclasses import dataclass

import numpy as np

from hric_assessment.separation.capsules import distances, nearest_points
from hric_assessment.separation.protective import Stop, Terms, person_speed, protective_distance
from hric_assessment.supervisor.arm import Placed
from hric_assessment.supervisor.person import Observation
from hric_assessment.supervisor.settings import SupervisorSettings
from hric_assessment.tables import separation_table
from hric_control.geometry import FloatArray
from hric_control.speed_scale import stopping_time

STANDING = 0.01
"""Speed below which an arm is at rest [m/s]: 10 mm/s, chosen here."""
SCALES = np.linspace(0.0, 1.0, 21)[1:]
"""At which the protective distance is computed; between them it is interpolated. Below the first it is 0."""
_RAMPS = np.array([stopping_time(scale) for scale in SCALES])


@dataclass(frozen=True)
class Nearness:
    """Of each of the person's m capsules.

    Attributes:
        distance: from the arm's nearest one, shape (m,) [m].
        arm: index of that, shape (m,).
        robot_point, person_point: nearest places on the axes, shape (m, 3) [m].
        direction: unit vectors from the arm to the person, shape (m, 3).
        robot_speed: of the arm's capsule towards him, at least 0, shape (m,) [m/s].
        person_speed: of his towards the arm, at least 0, shape (m,) [m/s].
    """

    distance: FloatArray
    arm: FloatArray
    robot_point: FloatArray
    person_point: FloatArray
    direction: FloatArray
    robot_speed: FloatArray
    person_speed: FloatArray


def nearness(arm: Placed, person: Observation, velocities: FloatArray) -> Nearness:
    """Of an arm and a person; velocities: of the ends of his capsules, shape (m, 2, 3) [m/s]."""
    apart = distances(arm.ends[None], arm.radii, person.ends[None], person.radii)[0]
    nearest = np.argmin(apart, axis=0)
    own = arm.ends[nearest]
    robot_point, person_point = nearest_points(own, person.ends)
    offset = person_point - robot_point
    length = np.linalg.norm(offset, axis=1)
    # Where the axes cross there is no direction: then each speed counts in full, see below.
    direction = offset / np.maximum(length, 1e-9)[:, None]
    crossing = length < 1e-6
    robot = _towards(arm.velocities[nearest], direction, crossing)
    human = _towards(velocities, -direction, crossing)
    distance = apart[nearest, np.arange(len(nearest))]
    return Nearness(distance, nearest, robot_point, person_point, direction, robot, human)


def _towards(velocities: FloatArray, direction: FloatArray, crossing: FloatArray) -> FloatArray:
    """The faster end of each capsule along a direction, at least 0, shape (m,) [m/s]."""
    along = np.einsum("mei,mi->me", velocities, direction).max(axis=1)
    full = np.linalg.norm(velocities, axis=2).max(axis=1)
    return np.asarray(np.maximum(np.where(crossing, full, along), 0.0))


class Protective:
    """The protective separation distance of this arm.

    Args:
        settings: of the supervisor.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self._settings, self._table = settings, separation_table()

    def approach(self, near: Nearness) -> FloatArray:
        """v_h of each capsule: the table's, or the measured one where he is faster, shape (m,) [m/s]."""
        return np.maximum(person_speed(near.distance, self._table), near.person_speed)

    def _terms(self, robot: FloatArray, human: FloatArray, ramp: FloatArray | float, settling: float) -> Terms:
        """From a speed of the arm towards him [m/s], which its scale needs `ramp` to end, and it `settling` more."""
        own = self._settings
        # Half of the ramp at the full speed, as at any even deceleration, and all of what the controller lags behind.
        stop = Stop(own.reaction_time, ramp + settling, robot * (0.5 * ramp + settling))
        return protective_distance(robot, human, stop, own.intrusion, own.person_uncertainty, own.robot_uncertainty)

    def measured(self, near: Nearness, human: FloatArray, scale: float, at_rest: bool) -> Terms:
        """Of each capsule at the measured speeds, shape (m,).

        Args:
            near, human: of the capsules, and their v_h [m/s].
            scale: that the robot was requested to have.
            at_rest: whether the arm does.
        """
        if at_rest:
            return self._terms(near.robot_speed, human, 0.0, 0.0)
        return self._terms(near.robot_speed, human, stopping_time(scale), self._settings.settling_time)

    def permitted(self, distance: FloatArray, human: FloatArray, speed: float) -> FloatArray:
        """Largest scale at which each capsule is as far as it must be, shape (m,); 0: the arm must stand.

        Args:
            distance, human: of the capsules [m], and their v_h [m/s].
            speed: of the arm at full speed [m/s], as if all of it were towards him.
        """
        terms = self._terms(speed * SCALES[:, None], human, _RAMPS[:, None], self._settings.settling_time)
        found = [np.interp(d, row, SCALES, left=0.0) for d, row in zip(distance, terms.total.T, strict=True)]
        return np.array(found)
