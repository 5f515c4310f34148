"""Random states for the proof."""

from __future__ import annotations

import math

import numpy as np

from hric_control.plants.spatial import FloatArray
from urdf_to_osim.forces import stop_parameters
from urdf_to_osim.options import Options
from urdf_to_osim.urdf import NO_LIMIT, ONE_COORDINATE, Joint

# Away from +-pi/2, where body-fixed angles of a floating joint are singular [rad].
LARGEST_MIDDLE_ANGLE = 1.2
# How far inside a range the forces are compared [rad or m]: near its ends, since sums lose digits far from zero.
NEAR = 4.0


def coordinates(joint: Joint, random: np.random.Generator) -> list[float]:
    """Coordinates of a joint in OpenSim: angles anywhere, lengths within a metre [rad, m]."""
    if joint.type in ONE_COORDINATE:
        return [random.uniform(-1.0, 1.0) if joint.type == "prismatic" else random.uniform(-math.pi, math.pi)]
    angle, length = random.uniform(-math.pi, math.pi, 3), random.uniform(-1.0, 1.0, 3)
    if joint.type == "floating":
        middle = random.uniform(-LARGEST_MIDDLE_ANGLE, LARGEST_MIDDLE_ANGLE)
        return [float(angle[0]), float(middle), float(angle[2]), *map(float, length)]
    return [float(angle[0]), float(length[0]), float(length[1])]


def around_stops(joint: Joint, random: np.random.Generator, options: Options) -> float:
    """Coordinate of a joint inside its range, in the transition of a stop, or beyond [rad or m]."""
    if math.isinf(joint.lower):
        return float(random.uniform(-math.pi, math.pi))
    transition = stop_parameters(joint, options)[2]
    outside = transition * (random.uniform(0.0, 1.0) if random.random() < 0.5 else random.uniform(1.0, 10.0))
    ends = [end for end in (joint.lower - outside, joint.upper + outside) if abs(end) < NO_LIMIT]
    inside = (
        joint.upper - random.uniform(0.0, min(joint.upper - joint.lower, NEAR)) if joint.upper < NO_LIMIT else joint.lower + random.uniform(0.0, NEAR)
    )
    places = [inside, *ends]
    return places[int(random.random() * len(places))]


def speeds(count: int, random: np.random.Generator) -> FloatArray:
    """Speeds from creeping, where friction changes its sign, to fast, shape (count,) [rad/s or m/s]."""
    return np.asarray(random.choice([-1.0, 1.0], count) * 10.0 ** random.uniform(-4.0, 0.5, count))
