"""How near a person is to an arm, part by part, and how fast the arm may be for it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.capsules import distances, nearest_points
from hric_assessment.separation.protective import Stop, Terms, person_speed, protective_distance
from hric_assessment.supervisor.arm import InForce, Placed
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


class Braking(NamedTuple):
    """What is still to come of a stop that is requested now, or was before.

    Attributes:
        reaction: until the arm begins to brake [s].
        ramp: until its speed scale is 0 [s].
        settling: from then on until it is at rest [s].
    """

    reaction: float
    ramp: float
    settling: float


class Stopping:
    """Follows the robot's speed scale from decision to decision: of a stop that has begun less is still to come.

    Args:
        settings: of the supervisor.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self._settings = settings
        self._stands_since, self._before, self._brakes = math.inf, InForce(), False

    def left(self, now: float, known: float, in_force: InForce, at_rest: bool) -> Braking:
        """At robot time `now` [s].

        Args:
            now: robot time [s].
            known: stamp of the older of what is known of person and arm [s].
            in_force: the robot's speed scale.
            at_rest: whether the arm is.
        """
        own = self._settings
        # An arm that brakes has reacted; of that time is left by how much the person was seen before now.
        if in_force.stamp != self._before.stamp:
            falls = in_force.scale < self._before.scale
            slows = in_force.requested < in_force.scale and (falls or self._brakes)
            self._brakes = slows or in_force.requested == 0.0
            self._before = in_force
        age = max(now - known, 0.0)  # a stamp may be a little ahead of the clock
        reaction = min(age, own.reaction_time) if self._brakes else own.reaction_time
        self._stands_since = min(self._stands_since, in_force.stamp) if in_force.scale == 0.0 else math.inf
        if at_rest:
            return Braking(reaction, 0.0, 0.0)
        settling = own.settling_time - max(now - self._stands_since, 0.0)
        # An arm that is not at rest when it should be has a stop of which nothing is known.
        return Braking(reaction, stopping_time(in_force.scale), settling if settling > 0.0 else own.settling_time)


class Protective:
    """The protective separation distance of this arm.

    Args:
        settings: of the supervisor.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self._settings, self._table = settings, separation_table()

    def _terms(
        self, robot: FloatArray, person: FloatArray, ramp: FloatArray | float, braking: Braking
    ) -> tuple[FloatArray, Terms]:
        """(v_h, terms) from a speed of the arm towards him, and his measured one, which counts where he is faster than
        the table has it [m/s]."""
        # Half of the ramp at the full speed, as at any even deceleration, and all of what the controller lags behind.
        settling = braking.settling
        stop = Stop(braking.reaction, ramp + settling, robot * (0.5 * ramp + settling))
        own = self._settings.intrusion, self._settings.person_uncertainty, self._settings.robot_uncertainty
        human = np.maximum(person_speed(robot, stop, *own, self._table), person)
        return human, protective_distance(robot, human, stop, *own)

    def measured(self, near: Nearness, braking: Braking) -> tuple[FloatArray, Terms]:
        """v_h [m/s] and the terms of each capsule at the measured speeds, shape (m,)."""
        return self._terms(near.robot_speed, near.person_speed, braking.ramp, braking)

    def permitted(self, distance: FloatArray, person: FloatArray, speed: float) -> FloatArray:
        """Largest scale at which each capsule is as far as it must be, shape (m,); 0: the arm must stand.

        Args:
            distance, person: of the capsules [m], and their measured speed towards the arm [m/s].
            speed: of the arm at full speed [m/s], as if all of it were towards him.
        """
        braking = Braking(self._settings.reaction_time, 0.0, self._settings.settling_time)
        _, terms = self._terms(speed * SCALES[:, None], person, _RAMPS[:, None], braking)
        found = [np.interp(d, row, SCALES, left=0.0) for d, row in zip(distance, terms.total.T, strict=True)]
        return np.array(found)
