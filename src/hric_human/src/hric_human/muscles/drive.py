"""Muscle drive of a body: converts desired joint torques to muscle activations, and these to torques.

    drive = MuscleDrive(MuscleSet(body, find("delft", "anatomy")), cycle=1e-3)
    tau = drive.update(q, dq, control.update(time, q, dq))      # each cycle

Activations are decided a hundred times a second; the resulting torque is applied over each step. A decision shares the
desired torque among the muscles (static optimisation), and sets the excitations with which the activations are reached
at the next decision. Between two decisions the short-range stiffness of muscles resists disturbances: 75/m times the
force of each, and 0.05 s of it as damping (PMC2784227), about the continued motion of the last decision. Without it
Hill's curves alone make an elbow unstable.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hric_core.geometry import FloatArray
from hric_core.native import load
from hric_core.parameters import refused
from hric_human.muscles import curves
from hric_human.muscles.muscle_set import DAMPING_TIME, MuscleSet, MuscleState
from hric_human.muscles.static_optimization import StaticOptimization

FULL = 1.0 - 1e-6
"""Desired activation from which on a muscle counts as saturated [1]."""
_give: Callable[..., None]
_give = load("hric_muscle_drive").give


class MuscleDrive:
    """Muscle drive of one body; called from one thread.

    Args:
        muscles: muscles of the body; joints without muscles are driven by the torque itself.
        cycle: time between two updates [s].
        rate: rate of decisions [Hz].
        co_contraction: activation of all muscles beyond the minimum [1].
        where: prefix of the names of parameters, for messages.

    Attributes:
        muscles: muscles of the body, with actuators of the wrists behind the muscles of each side.
        state: state of the last cycle; None before the first.
        excitation, activation: values of each muscle and actuator, shape (k,) [1].
        force: force of each muscle [N], torque of each actuator [N m], shape (k,).
        at_limit: True for each that has been saturated since the last decision; a new list on each change.
        limited: how often each became saturated; one stay at the limit counts once.
        shortfall: desired torque that the muscles cannot produce, per joint of `muscles.joints`, shape (m,) [N m].

    Raises:
        ParameterError: a rate whose period is not a multiple of the cycle.
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
        """Return to the state before the first cycle."""
        k, m = len(self.muscles.names), len(self.muscles.joints)
        self.state: MuscleState | None = None
        self.excitation = self.activation = self._next = np.zeros(k)
        self.force, self.shortfall = np.zeros(k), np.zeros(m)
        self.at_limit, self.limited = [False] * k, [0] * k
        self._decided, self._since = np.zeros(0), 0

    def update(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> list[float]:
        """Return the joint torque until the next cycle, n floats [N m].

        Args:
            q: current joint positions, n floats [rad].
            dq: current joint velocities, n floats [rad/s].
            tau: desired torque, n floats [N m].
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
        torque = list(tau)
        for index, value in zip(self.muscles.joints, out[2 * k :].tolist(), strict=True):
            torque[index] = value
        return torque

    def _decide(self, state: MuscleState, q: FloatArray, dq: FloatArray, tau: FloatArray, at_rest: bool) -> None:
        """Decide activations for the desired torque, and the excitations (0 to 1) that reach them by the next."""
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
