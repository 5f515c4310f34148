"""Parameters of a muscle's force-length-velocity curves (computed in `muscles.c`), and its activation dynamics.

The curves are those of De Groote, Kinney, Rao & Fregly, Evaluation of direct collocation optimal control problem
formulations for solving the muscle redundancy problem, Ann. Biomed. Eng. 44(10):2922-2936, 2016, with the numbers of
OpenSim's DeGrooteFregly2016Muscle; a test compares the forces.
"""

from dataclasses import dataclass

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

LENGTHS = np.linspace(0.2, 2.0, 91)
"""Fibre lengths of `SampledCurves`, per optimal length along the line of action [1]; as in `muscles.c`."""
SPEEDS = np.linspace(-1.0, 1.0, 201)
"""Speeds of `SampledCurves`, per maximum velocity [1]; positive: lengthening."""


@dataclass(frozen=True)
class SampledCurves:
    """Curves of one muscle, linear between samples and constant beyond them, along its line of action.

    force = max_force (a active(l) velocity(v speed(l) / max_velocity) + passive(l)), with activation a, fibre length l
    per optimal length and its rate v [1/s].

    Attributes:
        max_velocity: velocity at the end of SPEEDS, optimal lengths per second.
        active, passive: force per maximum isometric force at LENGTHS [1].
        speed: speed of the fibres relative to that along the line of action, at LENGTHS, 1 at optimal length [1].
        velocity: factor on the active force at SPEEDS [1].
    """

    max_velocity: float
    active: tuple[float, ...]
    passive: tuple[float, ...]
    speed: tuple[float, ...]
    velocity: tuple[float, ...]

    def __post_init__(self) -> None:
        """Check the numbers. Raises ValueError."""
        tables = self.active, self.passive, self.speed, self.velocity
        if [len(table) for table in tables] != [len(LENGTHS)] * 3 + [len(SPEEDS)]:
            raise ValueError(
                f"curves have {[len(table) for table in tables]} samples; valid: 3 times {len(LENGTHS)}, {len(SPEEDS)}"
            )
        if not (self.max_velocity > 0.0 and np.isfinite(self.numbers()).all()):
            raise ValueError(f"curves have max_velocity {self.max_velocity}, or a sample is not finite; valid: above 0")

    def numbers(self) -> FloatArray:
        """Return all numbers, in the order of the attributes."""
        return np.array([self.max_velocity, *self.active, *self.passive, *self.speed, *self.velocity])
