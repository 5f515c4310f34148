"""Equations of friction and joint stops, and random states, with which the proof checks the OpenSim model."""

import math

import numpy as np

from hric_control.plants import sigmoid_parameters
from hric_core.geometry import FloatArray
from hric_core.urdf import NO_LIMIT, ONE_COORDINATE, Joint
from urdf_to_osim.forces import stop_parameters
from urdf_to_osim.options import Options

LARGEST_MIDDLE_ANGLE = 1.2
"""Maximum middle angle of a floating joint [rad], away from the singularity of body-fixed angles at +-pi/2."""
NEAR = 4.0
"""Maximum distance of random states from an end of the joint's range [rad or m]: far from zero, digits get lost."""


def friction(joint: Joint, dq: float, options: Options, velocity: float) -> float:
    """Return the friction effort of a joint at the velocity dq [rad/s or m/s] as an equation [N m or N].

    Coulomb: -f tanh(dq/v) with v = `velocity`.
    Sigmoid: -(phi1 / (1 + exp(-phi2 (dq + phi3))) - phi1 / (1 + exp(-phi2 phi3))).
    """
    if options.friction == "coulomb":
        return -joint.friction * math.tanh(dq / velocity)
    if joint.name not in options.friction_parameters:
        return 0.0
    phi1, phi2, phi3 = sigmoid_parameters(options.friction_parameters, [joint.name])[0]
    return -(phi1 / (1.0 + math.exp(-phi2 * (dq + phi3))) - phi1 / (1.0 + math.exp(-phi2 * phi3)))


def stop(joint: Joint, q: float, dq: float, options: Options) -> float:
    """Return the effort of a joint's stop [N m or N] at q [rad or m], dq [rad/s or m/s] as an equation.

    At a distance d beyond a limit the effort is -s (k d + c dq), with stiffness k and damping c. The factor
    s = 10 y^3 - 15 y^4 + 6 y^5 grows from 0 to 1 with y = d / transition (CoordinateLimitForce, OpenSim API reference).
    """
    if math.isinf(joint.lower):
        return 0.0
    stiffness, loss, transition = stop_parameters(joint, options)
    above, below = _share((q - joint.upper) / transition), _share((joint.lower - q) / transition)
    return above * stiffness * (joint.upper - q) + below * stiffness * (joint.lower - q) - (above + below) * loss * dq


def _share(y: float) -> float:
    y = min(max(y, 0.0), 1.0)
    return y**3 * (10.0 - 15.0 * y + 6.0 * y**2)


def coordinates(joint: Joint, random: np.random.Generator) -> list[float]:
    """Return random values of a joint's coordinates in OpenSim: any angle [rad], lengths within +-1 m."""
    if joint.type in ONE_COORDINATE:
        return [random.uniform(-1.0, 1.0) if joint.type == "prismatic" else random.uniform(-math.pi, math.pi)]
    angle, length = random.uniform(-math.pi, math.pi, 3), random.uniform(-1.0, 1.0, 3)
    if joint.type == "floating":
        middle = random.uniform(-LARGEST_MIDDLE_ANGLE, LARGEST_MIDDLE_ANGLE)
        return [float(angle[0]), float(middle), float(angle[2]), *map(float, length)]
    return [float(angle[0]), float(length[0]), float(length[1])]


def around_stops(joint: Joint, random: np.random.Generator, options: Options) -> float:
    """Return a random coordinate of a joint inside its range, in the transition of a stop, or beyond [rad or m]."""
    if math.isinf(joint.lower):
        return float(random.uniform(-math.pi, math.pi))
    transition = stop_parameters(joint, options)[2]
    outside = transition * (random.uniform(0.0, 1.0) if random.random() < 0.5 else random.uniform(1.0, 10.0))
    ends = [end for end in (joint.lower - outside, joint.upper + outside) if abs(end) < NO_LIMIT]
    inside = (
        joint.upper - random.uniform(0.0, min(joint.upper - joint.lower, NEAR))
        if joint.upper < NO_LIMIT
        else joint.lower + random.uniform(0.0, NEAR)
    )
    choices = [inside, *ends]
    return choices[int(random.random() * len(choices))]


def speeds(count: int, random: np.random.Generator) -> FloatArray:
    """Return random speeds from very slow, where friction changes its sign, to fast, shape (count,) [rad/s or m/s]."""
    return np.asarray(random.choice([-1.0, 1.0], count) * 10.0 ** random.uniform(-4.0, 0.5, count))
