"""Protective separation distance, term by term: ISO/TS 15066:2016, with speeds and intrusion of ISO 13855.

    S_p = S_h + S_r + S_s + C + Z_d + Z_r
    S_h = v_h (T_r + T_s),   S_r = v_r T_r,   S_s = v_r T_s / 2 (constant braking) or v_r T_s (nothing known)

All terms are numbers or arrays of one shape. The constants are in config/tables/separation.yaml.
"""

from typing import NamedTuple

import numpy as np

from hric_assessment.tables import ValueTable, separation_table
from hric_core.errors import HricError
from hric_core.geometry import FloatArray

Values = FloatArray | float
TINY = 1e-9
"""Replacement for a time of zero, in which the person does not approach [s]."""


class Terms(NamedTuple):
    """Terms of the protective distance [m].

    Attributes:
        person: S_h, approach of the person until the robot has stopped.
        reaction: S_r, approach of the robot until it starts to brake.
        stopping: S_s, approach of the robot while it brakes.
        intrusion: C, distance by which a body part may be nearer than the sensor detects.
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
    """Stop of a robot.

    Attributes:
        reaction_time: T_r, from the person's motion until braking starts [s].
        time: T_s, duration of braking from the present speed [s].
        distance: braking distance [m]; None: not known.
        constant: True: constant deceleration; otherwise, without a distance, the robot is assumed to move at v_r until
            it has stopped.
    """

    reaction_time: Values
    time: Values
    distance: Values | None = None
    constant: bool = False

    def braked(self, speed: Values) -> Values:
        """Return the braking distance S_s from a speed [m/s]."""
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
    """Return the terms of S_p.

    Args:
        robot_speed: v_r, towards the person [m/s].
        person_speed: v_h, towards the robot [m/s]; `person_speed` of this module if it is not measured.
        stop: stop of the robot from that speed.
        intrusion: C [m].
        person_uncertainty: Z_d [m].
        robot_uncertainty: Z_r [m].

    Raises:
        HricError: a time, speed or distance below 0, or not finite.
    """
    arguments = {"robot_speed": robot_speed, "person_speed": person_speed, "intrusion": intrusion}
    arguments |= {"person_uncertainty": person_uncertainty, "robot_uncertainty": robot_uncertainty}
    arguments |= {f"stop.{name}": getattr(stop, name) for name in ("reaction_time", "time", "distance")}
    for name, value in arguments.items():
        if value is not None and not np.all(np.isfinite(value) & (np.asarray(value) >= 0.0)):
            raise HricError(f"{name} is {value}; valid: finite numbers of 0 or more")
    return Terms(
        np.multiply(person_speed, np.add(stop.reaction_time, stop.time)),
        np.multiply(robot_speed, stop.reaction_time),
        stop.braked(robot_speed),
        intrusion,
        person_uncertainty,
        robot_uncertainty,
    )


def person_speed(
    robot_speed: Values,
    stop: Stop,
    intrusion: float,
    person_uncertainty: float,
    robot_uncertainty: float,
    table: ValueTable | None = None,
) -> FloatArray:
    """Return the assumed speed v_h of a person whose speed is not measured [m/s].

    By ISO 13855 it is the hand speed if the resulting distance is not above `near`; otherwise it is the walking speed,
    and the distance is not below `near`. The speed in between that gives `near` is equivalent.

    Args:
        robot_speed: v_r, as in `protective_distance` [m/s].
        stop: stop of the robot from that speed.
        intrusion: C [m].
        person_uncertainty: Z_d [m].
        robot_uncertainty: Z_r [m].
        table: values of the standard; by default those of the package.
    """
    table = table or separation_table()
    still = protective_distance(robot_speed, 0.0, stop, intrusion, person_uncertainty, robot_uncertainty).total
    time = np.add(stop.reaction_time, stop.time)
    at_near = (table["near"] - still) / np.maximum(time, TINY)
    return np.clip(at_near, table["walking_speed"], table["hand_speed"])


def intrusion(resolution: float, table: ValueTable | None = None) -> float:
    """Return the intrusion distance C of a sensor that detects bodies of size d or more [m].

    Args:
        resolution: d [m].
        table: values of the standard; by default those of the package.

    Raises:
        HricError: d is outside the range of the formula.
    """
    table = table or separation_table()
    if not 0.0 <= resolution <= table["resolution_limit"]:
        raise HricError(f"resolution is {resolution} m; valid: 0 to {table['resolution_limit']:g} m")
    return max(0.0, table["intrusion_slope"] * (resolution - table["intrusion_offset"]))
