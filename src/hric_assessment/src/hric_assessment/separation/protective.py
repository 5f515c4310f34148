"""Protective separation distance, term by term: ISO/TS 15066:2016, with speeds and intrusion of ISO 13855:2010.

    S_p = S_h + S_r + S_s + C + Z_d + Z_r
    S_h = v_h (T_r + T_s),   S_r = v_r T_r,   S_s = v_r T_s / 2 (constant braking) or v_r T_s (nothing known)

v_h, v_r: speed of person and robot towards each other; T_r: reaction time, T_s: stopping time of the robot. All terms
are numbers or arrays of one shape. The constants are in config/tables/separation.yaml.
"""

import math
from typing import NamedTuple

import numpy as np

from hric_assessment.tables import ValueTable, separation_table
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

Values = FloatArray | float
TINY = 1e-9
"""Replacement for a stopping time of zero, which would be a divisor [s]."""


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
        return np.asarray(sum(np.asarray(term) for term in self))


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
    arguments = {"robot_speed": robot_speed, "person_speed": person_speed, "intrusion": intrusion}
    arguments |= {"person_uncertainty": person_uncertainty, "robot_uncertainty": robot_uncertainty}
    arguments |= {f"stop.{name}": getattr(stop, name) for name in ("reaction_time", "time", "distance")}
    for name, value in arguments.items():
        if value is not None and not _possible(value):
            raise HricError(f"{name} is {value}; valid: finite numbers of 0 or more")
    return Terms(
        np.multiply(person_speed, np.add(stop.reaction_time, stop.time)),
        np.multiply(robot_speed, stop.reaction_time),
        stop.braked(robot_speed),
        intrusion,
        person_uncertainty,
        robot_uncertainty,
    )


def _possible(value: Values) -> bool:
    if isinstance(value, float):  # a call of numpy would take twenty times as long
        return 0.0 <= value < math.inf
    return bool(np.all(np.isfinite(value) & (np.asarray(value) >= 0.0)))


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
    table = table or separation_table()
    still = protective_distance(robot_speed, 0.0, stop, intrusion, person_uncertainty, robot_uncertainty).total
    time = np.add(stop.reaction_time, stop.time)
    at_near = (table["near"] - still) / np.maximum(time, TINY)
    return np.clip(at_near, table["walking_speed"], table["hand_speed"])


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
