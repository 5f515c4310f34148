"""Model of muscle fatigue with three pools of motor units: resting, active, fatigued (3CC; with faster rest: 3CC-r).

    M_A' = C - F M_A,   M_F' = F M_A - R M_F,   M_R' = -C + R M_F,   M_R + M_A + M_F = 1

C moves the active pool M_A towards the load: 10/s times their difference, while the pool grows at most 10/s times M_R.
At zero load, R is multiplied by the factor `rest`.

Xia & Frey Law, J. Biomech. 41:3046, 2008; rates of Frey Law, Looft & Heitsman, J. Biomech. 45:1803, 2012 (PMC3397684);
factor of rest of Looft, Herkert & Frey Law, J. Biomech. 77:16, 2018.

NOT REPRODUCED: these rates do not give the endurance times of the paper (at the shoulder they differ from its curve by
7.9 s RMS over 20 to 90 % of strength, the paper states 2.7 s; at other joints by more), and the assignment of rates to
joints is from memory. Use the model only to compare runs of one person, never as an endurance in seconds.
"""

from typing import NamedTuple

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray

RISE = 10.0
"""Rate L_D = L_R at which the active pool follows the load [1/s]; Xia & Frey Law 2008; 10 in the paper of 2012."""
REST = 15.0
"""Factor by which recovery is faster at rest [1]; most joints in the paper of 2018, from memory, unconfirmed."""
STEP = 0.01
"""Maximum integration step [s]: a tenth of the fastest time constant."""


class Rates(NamedTuple):
    """Rates at which a joint's active muscle pool fatigues, and the fatigued one recovers [1/s]."""

    fatigue: float
    recovery: float


RATES = {
    "shoulder": Rates(0.0182, 0.00168),
    "elbow": Rates(0.00912, 0.00094),
    "grip": Rates(0.0098, 0.00064),
    "trunk": Rates(0.00755, 0.00075),
    "knee": Rates(0.015, 0.00149),
    "ankle": Rates(0.00589, 0.00058),
}
"""Rates by joint; Frey Law et al. 2012.

The extreme values are confirmed by its abstract; their assignment to joints is from memory, unconfirmed.
"""


class Fatigue:
    """Motor unit pools of k muscles over time.

    Args:
        joints: joint of each muscle, a key of RATES.
        rest: factor by which recovery is faster at rest [1]; 1: the 3CC model.

    Attributes:
        resting, active, fatigued: share of each muscle's motor units in the pool, shape (k,) [1].

    Raises:
        HricError: a joint has no rates, or the factor is below 1.
    """

    def __init__(self, joints: list[str], rest: float = REST) -> None:
        unknown = [joint for joint in joints if joint not in RATES]
        if unknown or not rest >= 1.0:
            raise HricError(
                f"fatigue of joint {unknown[0]!r}; valid: {', '.join(RATES)}"
                if unknown
                else f"the fatigue model's factor of rest is {rest}; valid: 1 or more"
            )
        self._fatigue, self._recovery = np.array([RATES[joint] for joint in joints]).reshape(-1, 2).T
        self._rest = rest
        self.resting = np.ones(len(joints))
        self.active, self.fatigued = np.zeros((2, len(joints)))

    @property
    def capacity(self) -> FloatArray:
        """Maximum load of each muscle, the share of its motor units that is not fatigued, shape (k,) [1]."""
        return np.asarray(1.0 - self.fatigued)

    def update(self, load: FloatArray, period: float) -> FloatArray:
        """Integrate the pools over a period of constant load.

        Args:
            load: load of each muscle, as share of its strength, shape (k,) [1].
            period: duration [s].

        Returns:
            part of the load that the active pool cannot bear after the period, shape (k,) [1].
        """
        steps = max(1, int(np.ceil(period / STEP - 1e-9)))
        for _ in range(steps):
            self._step(np.asarray(load, np.float64), period / steps)
        return np.maximum(load - self.active, 0.0)

    def _step(self, load: FloatArray, dt: float) -> None:
        """Integrate one step by the midpoint rule, which preserves the sum of the pools of motor units."""
        active, fatigued = self._rates(load, self.active, self.fatigued)
        active, fatigued = self._rates(load, self.active + 0.5 * dt * active, self.fatigued + 0.5 * dt * fatigued)
        self.active = self.active + dt * active
        self.fatigued = self.fatigued + dt * fatigued
        self.resting = 1.0 - self.active - self.fatigued

    def _rates(self, load: FloatArray, active: FloatArray, fatigued: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the rates of the active and the fatigued pool [1/s]."""
        resting = 1.0 - active - fatigued
        drive = RISE * np.minimum(load - active, np.where(load > active, resting, np.inf))
        recovery = self._recovery * np.where(load > 0.0, 1.0, self._rest)
        tiring = self._fatigue * active
        return drive - tiring, tiring - recovery * fatigued
