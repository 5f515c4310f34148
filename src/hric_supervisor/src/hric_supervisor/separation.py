"""Distance of each body part from the arm, and the speed scale of the arm that this distance permits."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hric_assessment.separation.protective import Stop, Terms, approach, at_least
from hric_assessment.separation.stopping import load
from hric_assessment.tables import separation_table
from hric_control.speed_scale import stopping_time
from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_dynamics.tree import nearest
from hric_supervisor.arm import InForce, PlacedCapsules
from hric_supervisor.person import Observation
from hric_supervisor.settings import SupervisorSettings

STANDING = 0.01
"""Speed below which an arm counts as at rest [m/s] (project default, unconfirmed)."""
SCALES = np.linspace(0.0, 1.0, 21)[1:]
"""Speed scales at which the protective distance is computed; a distance below that of the first permits no motion."""
_SLOWEST = 1e-6
"""Replacement for a speed of zero, which would be a divisor [m/s]."""


class CapsuleNearness(NamedTuple):
    """Distance and approach speeds of each of the person's m capsules and the nearest capsule of the arm.

    Attributes:
        distance: distance from the nearest capsule of the arm, shape (m,) [m].
        arm: index of the arm's nearest capsule as a floating-point number, shape (m,).
        robot_point, person_point: nearest points on the capsules' axes, shape (m, 3) [m].
        direction: unit vectors from the arm to the person, shape (m, 3).
        robot_speed: speed of the arm's capsule towards the person, at least 0, shape (m,) [m/s].
        person_speed: speed of the person's capsule towards the arm, at least 0, shape (m,) [m/s].
    """

    distance: FloatArray
    arm: FloatArray
    robot_point: FloatArray
    person_point: FloatArray
    direction: FloatArray
    robot_speed: FloatArray
    person_speed: FloatArray


def nearest_capsules(arm: PlacedCapsules, person: Observation) -> FloatArray:
    """Return the nearest capsule of the arm for each of the person's m, shape (m, 8), see `hric_dynamics.tree`."""
    rows = np.empty((len(person.radii), 8))
    nearest(arm.ends, arm.radii, np.ascontiguousarray(person.ends), person.radii, rows)
    return rows


def nearness(arm: PlacedCapsules, velocities: FloatArray, rows: FloatArray) -> CapsuleNearness:
    """Return distances and approach speeds between arm and person.

    Args:
        arm: capsules of the arm in the world.
        velocities: velocities of the axis ends of the person's capsules, shape (m, 2, 3) [m/s].
        rows: result of `nearest_capsules`, shape (m, 8).
    """
    towards = np.empty((len(rows), 5))
    approach(rows, arm.velocities, velocities, towards)
    columns = towards[:, :3], towards[:, 3], towards[:, 4]
    return CapsuleNearness(rows[:, 0], rows[:, 1], rows[:, 2:5], rows[:, 5:], *columns)


class RemainingStop(NamedTuple):
    """Remaining part of a stop that is requested now or in progress; numbers, or arrays of one shape.

    Attributes:
        reaction: time until the arm starts to brake [s].
        time: braking time from its start until rest [s].
        lead: braking distance divided by the speed at the start of braking [s].
    """

    reaction: float
    time: FloatArray | float
    lead: FloatArray | float


class StoppingModel:
    """Stopping model of the arm: from the ramp of its speed scale and the lag of its controller, or a table of stops.

    The model tracks the scale from decision to decision, so that a stop in progress has less time and distance left.

    Args:
        settings: parameters of the supervisor.

    Attributes:
        fastest: speed up to which stops are known [m/s].

    Raises:
        HricError: the file of stops is invalid.
    """

    def __init__(self, settings: SupervisorSettings) -> None:
        self._settings, self._table = settings, load(Path(settings.stops)) if settings.stops else None
        self._standing_since, self._before, self._brakes = math.inf, InForce(), False
        self.fastest = math.inf
        if self._table is not None:
            table = self._table
            self.fastest = max(row.speed for row in table.stops if row.load == table.max_load)

    def check_robot(self, name: str, franka: bool) -> None:
        """Raise ParameterError if the table of stops is that of another robot.

        Args:
            name: name of the robot in its description.
            franka: True if it is a Franka arm, as a table without a name is for one.
        """
        of = None if self._table is None else self._table.robot
        if self._table is not None and (of != name if of else not franka):
            raise ParameterError(
                f"stops of {of or 'a Franka arm'} in {self._settings.stops}, but the robot is {name}; valid: a file of "
                f"its stops, with robot: {name}"
            )

    @property
    def _reaction(self) -> float:
        return self._settings.reaction_time + (0.0 if self._table is None else self._table.reaction_time)

    def _braking(
        self, reaction: float, speed: FloatArray | float, ramp: FloatArray | float, settling: float
    ) -> RemainingStop:
        """Return the stop from a speed of the arm's fastest point.

        Args:
            reaction: time until the arm starts to brake [s].
            speed: speed of the fastest point [m/s].
            ramp: time that the speed scale needs to fall to 0 [s].
            settling: time from scale 0 until the arm is at rest [s].
        """
        if self._table is None:
            # With constant deceleration the distance is full speed times half of the ramp; the lag counts in full.
            return RemainingStop(reaction, ramp + settling, 0.5 * ramp + settling)
        stop = self._table.stop(speed, self._table.max_load)
        assert stop.distance is not None, "a table of stops always has distances"
        lead = stop.distance / np.maximum(speed, _SLOWEST)
        return RemainingStop(reaction, np.maximum(stop.time, ramp), np.maximum(lead, 0.5 * np.asarray(ramp)))

    def from_scales(self, scales: FloatArray, speed: float) -> RemainingStop:
        """Return the stops from speed scales, shape (k,), of a speed at full scale [m/s]."""
        ramps = np.array([stopping_time(scale) for scale in scales])
        return self._braking(self._reaction, speed * scales, ramps, self._settings.settling_time)

    def left(self, now: float, known: float, in_force: InForce, speed: float) -> RemainingStop:
        """Return the remaining part of the stop in progress, or of one that would be requested now.

        Args:
            now: robot time [s].
            known: older one of the stamps of person and arm [s].
            in_force: speed scale that the robot obeys.
            speed: speed of the arm's fastest point, at most `fastest` [m/s].
        """
        settings = self._settings
        # A braking arm has already reacted: of its reaction time only the age of the data counts.
        if in_force.stamp != self._before.stamp:
            falls = in_force.scale < self._before.scale
            slows = in_force.requested < in_force.scale and (falls or self._brakes)
            self._brakes = slows or in_force.requested == 0.0
            self._before = in_force
        age = max(now - known, 0.0)  # a stamp may be a little ahead of the clock
        reaction = min(age, self._reaction) if self._brakes else self._reaction
        self._standing_since = min(self._standing_since, in_force.stamp) if in_force.scale == 0.0 else math.inf
        if speed < STANDING:
            return RemainingStop(reaction, 0.0, 0.0)
        settling = settings.settling_time - max(now - self._standing_since, 0.0)
        # If the arm is not yet at rest when it should be, the end of its stop is unknown: the full time counts again.
        left = settling if settling > 0.0 else settings.settling_time
        return self._braking(reaction, speed, stopping_time(in_force.scale), left)


class Protective:
    """Protective separation distance for the supervised arm, and the speed scale that a distance permits.

    Args:
        settings: parameters of the supervisor.
        stopping: stopping model of the arm.
    """

    def __init__(self, settings: SupervisorSettings, stopping: StoppingModel) -> None:
        self._settings, self._stopping, self._table = settings, stopping, separation_table()

    def _terms(self, robot: FloatArray, person: FloatArray, braking: RemainingStop) -> tuple[FloatArray, Terms]:
        """Return the person's speed v_h [m/s] and the terms of the protective distance.

        Args:
            robot: speed of the arm towards the person [m/s].
            person: measured speed of the person [m/s]; it counts if it is higher than the one assumed by ISO 13855.
            braking: stop of the arm.
        """
        stop = Stop(braking.reaction, braking.time, robot * braking.lead)
        distances = self._settings.intrusion, self._settings.person_uncertainty, self._settings.robot_uncertainty
        return at_least(person, robot, stop, *distances, self._table)

    def measured(self, near: CapsuleNearness, braking: RemainingStop) -> tuple[FloatArray, Terms]:
        """Return the person's speed v_h [m/s] and the terms for each capsule at the measured speeds, shape (m,)."""
        return self._terms(near.robot_speed, near.person_speed, braking)

    def permitted(self, distance: FloatArray, person: FloatArray, speed: float) -> FloatArray:
        """Return the largest speed scale for which each capsule is far enough away, shape (m,); 0: the arm must stop.

        Args:
            distance: distances of the capsules [m].
            person: measured speeds of the capsules towards the arm [m/s].
            speed: speed of the arm at full scale [m/s], assumed to be directed towards the person.
        """
        scales = SCALES[speed * SCALES <= self._stopping.fastest]
        if not len(scales):
            return np.zeros(len(distance))
        reaction, time, lead = self._stopping.from_scales(scales, speed)
        columns = speed * scales[:, None], person, np.asarray(time)[:, None], np.asarray(lead)[:, None]
        robot, speeds, times, leads = (np.array(values, order="C") for values in np.broadcast_arrays(*columns))
        _, terms = self._terms(robot, speeds, RemainingStop(reaction, times, leads))
        permitted_scales = [np.interp(d, row, scales, left=0.0) for d, row in zip(distance, terms.total.T, strict=True)]
        return np.array(permitted_scales)
