"""Parameters of a muscle's force-length-velocity curves (computed in `muscles.c`), and its activation dynamics.

The curves are those of De Groote, Kinney, Rao & Fregly, Evaluation of direct collocation optimal control problem
formulations for solving the muscle redundancy problem, Ann. Biomed. Eng. 44(10):2922-2936, 2016, with the numbers of
OpenSim's DeGrooteFregly2016Muscle; a test compares the forces.
"""

import numpy as np

from hric_core.geometry import FloatArray

ACTIVE = (
    (0.8150671134243542, 1.055033428970575, 0.162384573599574, 0.063303448465465),
    (0.433004984392647, 0.716775413397760, -0.029947116970696, 0.200356847296188),
    (0.1, 1.0, 0.353553390593274, 0.0),
)
"""Rows (height, centre, a, b) of three bell curves of width a + b l; their sum is the active force-length curve.

l: fibre length per optimal length [1]; force per maximum isometric force [1].
"""
PASSIVE_SHAPE, PASSIVE_STRAIN, SHORTEST = 4.0, 0.6, 0.2
"""Passive force: shape exponent, strain at maximum isometric force, normalised fibre length at force 0 [1]."""
VELOCITY = (-0.3211346127989808, -8.149, -0.374, 0.8825327733249912)
"""Coefficients d1 to d4 of the force-velocity curve d1 asinh(d2 v + d3) + d4, v per maximum velocity [1]."""
MAX_VELOCITY = 10.0
"""Maximum shortening velocity, optimal lengths per second."""
RISE, FALL = 0.015, 0.060
"""Time constants of activation and deactivation [s]."""
SMOOTHING = 0.1
"""Factor b in tanh(b (excitation - activation)), which blends activation and deactivation [1]."""


def approach_speed(activation: FloatArray, excitation: FloatArray) -> FloatArray:
    """Return the rate of activation per difference between excitation and activation [1/s]; arrays of equal shape."""
    rising = 0.5 * np.tanh(SMOOTHING * (excitation - activation)) + 0.5
    slowed = 0.5 + 1.5 * activation
    return np.asarray(rising / (RISE * slowed) + (1.0 - rising) * slowed / FALL)
