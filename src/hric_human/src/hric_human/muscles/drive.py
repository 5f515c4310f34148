"""Muscle drive of a body: converts desired joint torques to muscle activations, and these to torques.

    drive = MuscleDrive(MuscleSet(body, find("delft", "anatomy")), cycle=1e-3)
    tau = drive.update(q, dq, control.update(time, q, dq))      # each cycle

Excitations are decided 100 times a second, torques are computed each cycle. A decision shares the desired torque among
the muscles (static optimisation), and sets the excitations with which these activations are reached at the next
decision. In between, the short-range stiffness of the muscles resists deviations from the motion at the last decision,
continued at constant velocity: 75/m times each muscle's force, with 0.05 s times the stiffness as damping (PMC2784227).
Without it, Hill's curves alone make an elbow unstable.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.native import load
from hric_core.parameters import refused
from hric_human.muscles import curves
from hric_human.muscles.muscle_set import DAMPING_TIME, STIFFNESS, MuscleSet, MuscleState
from hric_human.muscles.static_optimization import StaticOptimization

FULL = 1.0 - 1e-6
"""Desired activation at and above which a muscle counts as saturated [1]."""
_Drive = load("hric_muscle_drive").Drive


class MuscleDrive:
    """Muscle drive of one body; called from one thread.

    Args:
        muscles: muscles of the body; joints without muscles receive the desired torque itself.
        cycle: time between two updates [s].
        rate: rate of decisions [Hz].
        co_contraction: activation of all muscles beyond the minimum [1].
        where: prefix of the parameters' names, for error messages.

    Attributes:
        muscles: muscles of the body; on each side the ideal actuators of the wrist follow the muscles.
        state: muscle state of the last cycle; None before the first.
        excitation, activation: values of each muscle and actuator, shape (k,) [1].
        force: force of each muscle [N], torque of each actuator [N m], shape (k,).
        at_limit: True for each muscle or actuator that is saturated since the last decision; a new list if any changes.
        limited: number of times that each muscle or actuator became saturated.
        approach_speed: function (activation, excitation) of a muscle that returns the rate of its activation per
            difference of both [1/s].
        shortfall: desired torque that the muscles cannot produce, per joint of `muscles.joints`, shape (m,) [N m].

    Raises:
        ParameterError: the rate's period is not a multiple of the cycle.
    """

    def __init__(
        self,
        muscles: MuscleSet,
        cycle: float,
        rate: float = 100.0,
        co_contraction: float = 0.0,
        where: str = "human.muscles.",
    ) -> None:
        period = 1.0 / (rate * cycle)
        if abs(period - round(period)) > 1e-6:
            raise refused(f"{where}rate", rate, f"a divisor of the cycle rate, {1.0 / cycle:g} Hz")
        self._period, self._cycle, self.muscles = round(period), cycle, muscles
        k, m = len(muscles.names), len(muscles.joints)
        minimum = StaticOptimization(k, m).raised(np.where(muscles.is_muscle, co_contraction, 0.0)).tolist()
        self._stiffness = np.zeros((m, m))
        constants = curves.RISE, curves.FALL, curves.SMOOTHING, DAMPING_TIME, cycle, FULL
        self._compiled = _Drive(muscles.joints, minimum, self._stiffness, constants)
        self.approach_speed: Callable[[float, float], float] = self._compiled.approach_speed
        self.restart()

    def restart(self) -> None:
        """Reset the drive to its state before the first cycle."""
        k, m = len(self.muscles.names), len(self.muscles.joints)
        self._values, self._started, self._outside = np.zeros(self.muscles.size + 3 * k), False, False
        self.excitation, self.shortfall = np.zeros(k), np.zeros(m)
        self.at_limit, self.limited = [False] * k, [0] * k
        self._since = self._period

    def _row(self, row: int) -> FloatArray:
        """Return values of all muscles that follow the state: activation, force, activation in the next cycle."""
        k = len(self.limited)
        return self._values[self.muscles.size + row * k :][:k]

    @property
    def state(self) -> MuscleState | None:  # noqa: D102  (see Attributes)
        numbers = self._values[: self.muscles.size]
        return MuscleState(numbers, len(self.limited), self._outside) if self._started else None

    @property
    def activation(self) -> FloatArray:  # noqa: D102
        return self._row(0)

    @property
    def force(self) -> FloatArray:  # noqa: D102
        return self._row(1)

    def update(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Return the joint torque until the next cycle, n floats [N m].

        Args:
            q: current joint positions, n floats [rad].
            dq: current joint velocities, n floats [rad/s].
            tau: desired torque, n floats [N m].
        """
        before, now = self._values, np.empty(self._values.size)
        self._outside = self.muscles.compiled.at(q, dq, now)
        if self._since == self._period:
            self._decide(now, q, dq, tau)
        self._values = now
        torque: list[float] = self._compiled.give(before, now, q, dq, tau, self._since * self._cycle)
        self._since += 1
        return torque

    def _decide(self, now: FloatArray, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> None:
        """Set the excitations (0 to 1) with which the muscles reach the desired torque at the next decision."""
        k, decided = len(self.limited), np.empty(2 * len(self.limited) + len(self._stiffness))
        time, at_rest = self._period * self._cycle, not self._started
        try:
            full = self._compiled.decide(self._values, now, decided, q, dq, tau, time, at_rest)
        except ValueError as error:
            raise HricError(f"static optimisation: {error}") from error
        self.muscles.compiled.stiffness(now[: self.muscles.size], self._row(2), self._stiffness, STIFFNESS)
        self.excitation, self.shortfall = decided[k : 2 * k], decided[2 * k :]
        self._started, self._since = True, 0
        self._note_limits(full)

    def _note_limits(self, now: list[bool]) -> None:
        if now != self.at_limit:
            self.limited = [
                count + (there and not was) for count, there, was in zip(self.limited, now, self.at_limit, strict=True)
            ]
            self.at_limit = now
