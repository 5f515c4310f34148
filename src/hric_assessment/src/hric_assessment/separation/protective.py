"""Protective separation distance, term by term: ISO/TS 15066:2016, with speeds and intrusion of ISO 13855:2010.

    S_p = S_h + S_r + S_s + C + Z_d + Z_r
    S_h = v_h (T_r + T_s),   S_r = v_r T_r,   S_s = v_r T_s / 2 (constant braking) or v_r T_s (nothing known)

v_h, v_r: speed of person and robot towards each other; T_r: reaction time, T_s: stopping time of the robot. All terms
are numbers or arrays of one shape. The constants are in config/tables/separation.yaml.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hric_assessment.tables import ValueTable, separation_table
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load

_compiled: Any = load("hric_separation")
approach: Callable[[FloatArray, FloatArray, FloatArray, FloatArray], None] = _compiled.approach
"""Function that writes direction and speeds with which each of a person's m capsules and an arm approach each other.

Arguments: nearest, arm, person, out, contiguous float64 arrays: result of `hric_dynamics.tree.nearest` for the capsules
of arm and person, shape (m, 8); velocities of the axis ends of the k capsules of the arm and the m of the person,
shapes (k, 2, 3) and (m, 2, 3) [m/s]; result, shape (m, 5): unit vector from the arm to the person; speeds of the faster
end of the arm's and of the person's capsule towards each other, at least 0 [m/s]. If the axes cross, there is no such
direction, and the full speeds of the faster ends count.
"""
fastest: Callable[[FloatArray], float] = _compiled.fastest
"""Function that returns the largest of n speeds [m/s] for velocities, a contiguous float64 array, shape (..., 3)."""
Values = FloatArray | float
_NAMES = (
    *("robot_speed", "person_speed", "intrusion", "person_uncertainty", "robot_uncertainty"),
    *("stop.reaction_time", "stop.time", "stop.distance"),
)
_GIVEN = (0.0, 0.0, 0.0)
"""Constants of ISO 13855 with which the given speed of the person counts."""


class Terms(NamedTuple):
    """Terms of the protective separation distance S_p [m].

    Attributes:
        person: S_h, approach of the person until the robot has stopped.
        reaction: S_r, approach of the robot until it starts to brake.
        stopping: S_s, approach of the robot while it brakes.
        intrusion: C, distance by which a body part can intrude before the sensor detects it.
        person_uncertainty: Z_d, uncertainty of the person's position.
        robot_uncertainty: Z_r, uncertainty of the robot's position.
    """

    person: Values
    reaction: Values
    stopping: Values
    intrusion: Values
    person_uncertainty: Values
    robot_uncertainty: Values

    @property
    def total(self) -> FloatArray:
        """Protective distance S_p [m]."""
        return np.asarray(sum(self[1:], np.asarray(self.person)))


class Stop(NamedTuple):
    """Stop of a robot: reaction time, stopping time and distance.

    Attributes:
        reaction_time: T_r, time from the person's motion until braking starts [s].
        time: T_s, duration of braking from the present speed [s].
        distance: braking distance [m]; None: not known, computed from the speed.
        constant: True if braking has constant deceleration; False: if the distance is not known, the robot is assumed
            to move at v_r until it has stopped.
    """

    reaction_time: Values
    time: Values
    distance: Values | None = None
    constant: bool = False

    def braked(self, speed: Values) -> Values:
        """Return the braking distance S_s [m] from a speed [m/s]."""
        return (
            np.multiply(speed, self.time) * (0.5 if self.constant else 1.0) if self.distance is None else self.distance
        )


def protective_distance(
    robot_speed: Values,
    person_speed: Values,
    stop: Stop,
    intrusion: float,
    person_uncertainty: float,
    robot_uncertainty: float,
) -> Terms:
    """Return the terms of the protective separation distance S_p.

    Args:
        robot_speed: speed v_r of the robot towards the person [m/s].
        person_speed: speed v_h of the person towards the robot [m/s]; if not measured, from the function
            `person_speed`.
        stop: stop of the robot from that speed.
        intrusion: intrusion distance C [m].
        person_uncertainty: uncertainty Z_d of the person's position [m].
        robot_uncertainty: uncertainty Z_r of the robot's position [m].

    Raises:
        HricError: a time, speed or distance is below 0, or not finite.
    """
    return _computed(_GIVEN, robot_speed, person_speed, stop, intrusion, person_uncertainty, robot_uncertainty)[1]


def person_speed(
    robot_speed: Values,
    stop: Stop,
    intrusion: float,
    person_uncertainty: float,
    robot_uncertainty: float,
    table: ValueTable | None = None,
) -> FloatArray:
    """Return the assumed speed v_h of a person whose speed is not measured [m/s].

    By ISO 13855 it is the hand speed as long as the resulting distance is not above the table's value `near`; otherwise
    it is the walking speed, with a distance of at least `near`. If neither fits, the result is the speed in between
    with which the distance equals `near`.

    Args:
        robot_speed: speed v_r of the robot towards the person [m/s].
        stop: stop of the robot from that speed.
        intrusion: intrusion distance C [m].
        person_uncertainty: uncertainty Z_d of the person's position [m].
        robot_uncertainty: uncertainty Z_r of the robot's position [m].
        table: values of the standard; None: config/tables/separation.yaml.
    """
    return at_least(0.0, robot_speed, stop, intrusion, person_uncertainty, robot_uncertainty, table)[0]


def at_least(
    person_speed: Values,
    robot_speed: Values,
    stop: Stop,
    intrusion: float,
    person_uncertainty: float,
    robot_uncertainty: float,
    table: ValueTable | None = None,
) -> tuple[FloatArray, Terms]:
    """Return the assumed speed v_h of a person [m/s], at least the measured `person_speed`, and the terms of S_p.

    Other arguments and exceptions: see the functions `person_speed` and `protective_distance`.
    """
    values = (table or separation_table()).values
    assumed = values["near"].value, values["walking_speed"].value, values["hand_speed"].value
    return _computed(assumed, robot_speed, person_speed, stop, intrusion, person_uncertainty, robot_uncertainty)


def _computed(
    assumed: tuple[float, float, float], robot_speed: Values, person_speed: Values, stop: Stop, *margins: float
) -> tuple[FloatArray, Terms]:
    """Return v_h and the terms of S_p; assumed: distance `near`, walking and hand speed of ISO 13855."""
    given = robot_speed, person_speed, *margins, stop.reaction_time, stop.time, stop.braked(robot_speed)
    out = np.empty((4, *next((value.shape for value in given if isinstance(value, np.ndarray)), ())))
    wrong = _compiled.protective(*given, assumed, out)
    if wrong < len(_NAMES):
        raise HricError(f"{_NAMES[wrong]} is {given[wrong]}; valid: finite numbers of 0 or more")
    return out[0], Terms(out[1], out[2], out[3], *margins)


def intrusion(resolution: float, table: ValueTable | None = None) -> float:
    """Return the intrusion distance C [m] of a sensor that detects bodies of size d or more.

    Args:
        resolution: detection capability d of the sensor [m].
        table: values of the standard; None: config/tables/separation.yaml.

    Raises:
        HricError: d is outside the range of the standard's formula.
    """
    table = table or separation_table()
    if not 0.0 <= resolution <= table["resolution_limit"]:
        raise HricError(f"resolution is {resolution} m; valid: 0 to {table['resolution_limit']:g} m")
    return max(0.0, table["intrusion_slope"] * (resolution - table["intrusion_offset"]))
