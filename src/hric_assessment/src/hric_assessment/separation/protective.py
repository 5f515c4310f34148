"""The protective separation distance, term by term: ISO/TS 15066:2016, with speeds and intrusion of ISO 13855.

    S_p = S_h + S_r + S_s + C + Z_d + Z_r
    S_h = v_h (T_r + T_s),   S_r = v_r T_r,   S_s = v_r T_s / 2 (constant braking) or v_r T_s (nothing known)

All terms are numbers or arrays of one shape. The values that are not given are in config/tables/separation.yaml.
"""

from typing import NamedTuple

import numpy as np

from hric_assessment.tables import SeparationTable, separation_table
from hric_control.errors import HricError
from hric_control.geometry import FloatArray

Values = FloatArray | float
TINY = 1e-9
"""In place of a time of zero, in which nobody comes nearer [s]."""


class Terms(NamedTuple):
    """Of the distance [m].

    Attributes:
        person: S_h, by which the person comes nearer until the robot has stopped.
        reaction: S_r, by which the robot does until it begins to brake.
        stopping: S_s, while it brakes.
        intrusion: C, by which a part of a body may be nearer than the sensor sees.
        person_uncertainty: Z_d, of the person's position.
        robot_uncertainty: Z_r, of the robot's.
    """

    person: Values
    reaction: Values
    stopping: Values
    intrusion: Values
    person_uncertainty: Values
    robot_uncertainty: Values

    @property
    def total(self) -> FloatArray:
        """S_p [m]."""
        return np.asarray(sum(np.asarray(term) for term in self))


class Stop(NamedTuple):
    """How a robot stops.

    Attributes:
        reaction_time: T_r, from the person's motion until braking begins [s].
        time: T_s, of the braking from the present speed [s].
        distance: of that braking [m]; None: not known.
        constant: it brakes evenly; otherwise, without a distance, it is taken as moving on at v_r until it has stopped.
    """

    reaction_time: Values
    time: Values
    distance: Values | None = None
    constant: bool = False

    def braked(self, speed: Values) -> Values:
        """S_s from a speed [m/s]."""
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
    """The terms of S_p.

    Args:
        robot_speed: v_r, towards the person [m/s].
        person_speed: v_h, towards the robot [m/s]; `person_speed` of this module where it is not measured.
        stop: of the robot from that speed.
        intrusion, person_uncertainty, robot_uncertainty: C, Z_d, Z_r [m].

    Raises:
        HricError: a time, speed or distance below 0, or not finite.
    """
    given = {"robot_speed": robot_speed, "person_speed": person_speed, "intrusion": intrusion}
    given |= {"person_uncertainty": person_uncertainty, "robot_uncertainty": robot_uncertainty}
    given |= {f"stop.{name}": getattr(stop, name) for name in ("reaction_time", "time", "distance")}
    for name, value in given.items():
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
    table: SeparationTable | None = None,
) -> FloatArray:
    """v_h of a person whose speed is not measured [m/s].

    By ISO 13855 it is the hands' where the distance that follows from it is not above `near`; otherwise it is that of
    walking, and the distance not below `near`. The speed in between which gives `near` does the same.

    Args:
        robot_speed, stop, intrusion, person_uncertainty, robot_uncertainty: those of `protective_distance`.
        table: by default the one that comes with the package.
    """
    table = table or separation_table()
    still = protective_distance(robot_speed, 0.0, stop, intrusion, person_uncertainty, robot_uncertainty).total
    time = np.add(stop.reaction_time, stop.time)
    at_near = (table["near"] - still) / np.maximum(time, TINY)
    return np.clip(at_near, table["walking_speed"], table["hand_speed"])


def intrusion(resolution: float, table: SeparationTable | None = None) -> float:
    """C of a sensor that sees bodies of d or more [m].

    Args:
        resolution: d [m].
        table: by default the one that comes with the package.

    Raises:
        HricError: d is beyond where the formula holds.
    """
    table = table or separation_table()
    if not 0.0 <= resolution <= table["resolution_limit"]:
        raise HricError(f"resolution is {resolution} m; valid: 0 to {table['resolution_limit']:g} m")
    return max(0.0, table["intrusion_slope"] * (resolution - table["intrusion_offset"]))
