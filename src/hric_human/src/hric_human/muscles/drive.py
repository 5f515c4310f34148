"""From a desired joint torque to muscles and back: activations are decided a hundred times a second, and what the
muscles give with them holds over each step.

    drive = MuscleDrive(MuscleSet(body, find("delft", "anatomy")), cycle=1e-3)
    tau = drive.update(q, dq, control.update(time, q, dq))      # each cycle

A decision shares the desired torque among the muscles (static optimisation), and chooses the excitations by which their
activations are there at the next decision. Between two of them the short-range stiffness of muscles resists what was
not foreseen: 75/m times the force of each, and 0.05 s of it as damping (PMC2784227), about the motion at the last
decision as if it had gone on. Without it Hill's curves alone make an elbow unstable.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hric_control.geometry import FloatArray
from hric_control.native import load
from hric_control.parameters import refused
from hric_human.muscles import curves
from hric_human.muscles.muscle_set import DAMPING_TIME, MuscleSet, MuscleState
from hric_human.muscles.static_optimization import StaticOptimization

FULL = 1.0 - 1e-6
"""Activation from which on more is desired of a muscle than it can give [1]."""
_give: Callable[..., None]
_give = load("hric_muscle_drive").give


class MuscleDrive:
    """One body's. One thread calls it.

    Args:
        muscles: of the body, whose joints they move; those without muscles are driven by the torque itself.
        cycle: time between two updates [s].
        rate: of decisions [Hz].
        co_contraction: activation of all muscles beyond the minimum [1].
        where: prefix of the names of parameters, for messages.

    Attributes:
        muscles: as given, with actuators of the wrists behind the muscles of each side.
        state: of the last cycle; None before the first.
        excitation, activation: of each muscle and actuator, shape (k,) [1].
        force: of each muscle [N], torque of each actuator [N m], shape (k,).
        at_limit: whether more than it can give is desired of each, since the last decision; another list where that
            changes.
        limited: how often each came there; while it stays it counts once.
        shortfall: desired torque that the muscles cannot give, per joint of `muscles.joints`, shape (m,) [N m].

    Raises:
        ParameterError: a rate that is no whole part of the cycles.
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
            raise refused(f"{where}rate", rate, f"a whole part of the {1.0 / cycle:g} cycles of a second")
        self._period, self._cycle, self.muscles = round(period), cycle, muscles
        k, m = len(self.muscles.names), len(self.muscles.joints)
        self._size = 2 * k + m
        self._columns = np.array(self.muscles.joints, np.intc)
        self._constants = np.array([curves.RISE, curves.FALL, curves.SMOOTHING, DAMPING_TIME, cycle])
        self._law = StaticOptimization(k, m)
        self._raised = np.where(self.muscles.is_muscle, co_contraction, 0.0)
        self.restart()

    def restart(self) -> None:
        """As before the first cycle."""
        k, m = len(self.muscles.names), len(self.muscles.joints)
        self.state: MuscleState | None = None
        self.excitation = self.activation = self._next = np.zeros(k)
        self.force, self.shortfall = np.zeros(k), np.zeros(m)
        self.at_limit, self.limited = [False] * k, [0] * k
        self._decided, self._since = np.zeros(0), 0

    def update(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Joint torque until the next cycle, n floats [N m].

        Args:
            q, dq: as they are, n floats [rad], [rad/s].
            tau: desired, n floats [N m].
        """
        at_rest, state = self.state is None, self.muscles.at(q, dq)
        self.state, self.activation = state, self._next
        if at_rest or self._since == self._period:
            angles, speeds, desired = np.array((q, dq, tau))[:, self._columns]
            self._decide(state, angles, speeds, desired, at_rest)
        k, out = len(self.activation), np.empty(self._size)
        ahead = self._since * self._cycle
        _give(self._columns, self._constants, state.numbers, self.activation, self._decided, out, q, dq, ahead)
        self._since += 1
        self.force, self._next = out[:k], out[k : 2 * k]
        found = list(tau)
        for index, value in zip(self.muscles.joints, out[2 * k :].tolist(), strict=True):
            found[index] = value
        return found

    def _decide(self, state: MuscleState, q: FloatArray, dq: FloatArray, tau: FloatArray, at_rest: bool) -> None:
        """Activations that give the desired torque, and the excitations by which they are there at the next decision,
        as far as excitations from 0 to 1 reach."""
        solution = self._law.solve(state.arms, state.gain, tau - state.passive @ state.arms, self._raised)
        aim = solution.activation
        if at_rest:
            self.activation = aim
        reached = -np.expm1(-self._cycle * self._period * curves.approach_speed(self.activation, aim))
        self.excitation = np.clip(self.activation + (aim - self.activation) / reached, 0.0, 1.0)
        self.shortfall = solution.shortfall
        self._note_limits((aim >= FULL).tolist())
        stiffness = self.muscles.intrinsic(state, self.activation).stiffness
        self._decided, self._since = np.concatenate([self.excitation, q, dq, stiffness.ravel()]), 0

    def _note_limits(self, now: list[bool]) -> None:
        if now != self.at_limit:
            self.limited = [
                count + (there and not was) for count, there, was in zip(self.limited, now, self.at_limit, strict=True)
            ]
            self.at_limit = now
