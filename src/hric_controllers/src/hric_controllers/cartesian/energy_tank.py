"""Energy tank that keeps the port of the Cartesian impedance law passive. No ROS.

With tau_k the torque commanded in cycle k, q_k the measured position and V the energy that springs store, the energy T
of the tank obeys

    T_0 = initial energy,    T_k+1 = min(T_max, T_k - tau_k (q_k+1 - q_k) - (V_k+1 - V_k))

so that tau_0 (q_1 - q_0) + tau_1 (q_2 - q_1) + ... <= T_0 + V_0 - V - T at any time: what the damper dissipates flows
into the tank, and the work of changes of stiffness and equilibrium, of a wrench feed-forward and of a null-space torque
is taken from it. Such work is scaled down when the tank is nearly empty. The idea is that of F. Ferraguti, C. Secchi
and C. Fantuzzi, "A tank-based approach to impedance control with variable stiffness", ICRA 2013
(doi:10.1109/ICRA.2013.6631284); here the energy is counted per cycle, as what the held torque does between two samples.

Not scaled is what spring and damper do themselves. A spring whose torque is held for a cycle of dt adds energy unless
the damping D is at least K dt / 2, which a damping ratio of dt sqrt(K) / 4 gives: 0.014 at 3000 N/m and 1 ms.
"""

from collections.abc import Callable, Sequence

import numpy as np

from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw, LawSetting
from hric_core.geometry import Pose, poses

RESERVE = 0.05
"""Fraction of the initial energy below which the tank gives nothing (project default, unconfirmed).

It covers what is not scaled: the error of torques that are held for a cycle, and their limited rate."""


class EnergyTank:
    """Account of the energy that a Cartesian impedance law may still give to the arm.

    Args:
        initial: energy at the start [J].
        largest: energy above which the tank takes no more [J].

    Attributes:
        energy: present energy T [J].
    """

    def __init__(self, initial: float, largest: float) -> None:
        self._initial, self._largest = initial, largest
        self.energy = initial

    @property
    def available(self) -> float:
        """Energy that may be spent now [J]."""
        return max(0.0, self.energy - RESERVE * self._initial)

    def start(self, law: CartesianLaw, stored: float, q: Sequence[float]) -> None:
        """Fill the tank to its initial energy; `stored`: energy of the springs [J], `q`: joint positions [rad]."""
        self.energy, self._stored, self._setting = self._initial, stored, law.setting
        self._q = list(q)
        self._tau: Sequence[float] = [0.0] * len(q)

    def hold(self, tau: Sequence[float]) -> None:
        """Record the torques that act until the next cycle, without gravity compensation, n floats [N m]."""
        self._tau = tau

    def advance(self, law: CartesianLaw, measured: Pose, q: Sequence[float], elsewhere: float) -> None:
        """Count the energy of the last cycle, then reduce the change of the law's setting to what the tank can pay for.

        Args:
            law: law with its new setting.
            measured: pose of the end effector.
            q: joint positions, n floats [rad].
            elsewhere: energy of springs that are not part of the law, such as those at joint limits [J].
        """
        requested, law.setting = law.setting, self._setting
        stored = law.energy(measured) + elsewhere
        self._pay(stored - self._stored + sum(t * (b - a) for t, a, b in zip(self._tau, self._q, q, strict=True)))
        self._q = list(q)
        pose, gains, _ = self._setting
        self._take(law, measured, lambda share: law.setting._replace(force_limit=requested.force_limit))
        self._take(
            law, measured, lambda share: law.setting._replace(compliance=gains.towards(requested.compliance, share))
        )
        share = self._take(
            law,
            measured,
            lambda share: law.setting._replace(
                pose=requested.pose if share >= 1.0 else poses.interpolated(pose, requested.pose, share)
            ),
        )
        law.twist = [share * v if self.available else 0.0 for v in law.twist]
        self._stored, self._setting = law.energy(measured) + elsewhere, law.setting

    def _pay(self, energy: float) -> None:
        self.energy = min(self._largest, self.energy - energy)

    def _take(self, law: CartesianLaw, measured: Pose, changed: Callable[[float], LawSetting]) -> float:
        """Change the law's setting by the largest fraction, 0 to 1, that the tank can pay for, and return it."""
        setting, stored, budget = law.setting, law.energy(measured), self.available
        law.setting = changed(1.0)
        cost = law.energy(measured) - stored
        if cost <= budget:
            self._pay(cost)
            return 1.0
        # The energy is convex in the pose and in the stiffness, so that a fraction of the change costs at most the
        # same fraction of the energy; with a limited force it may cost more.
        share = budget / cost
        law.setting = changed(share)
        cost = law.energy(measured) - stored
        if cost <= budget:
            self._pay(cost)
            return share
        law.setting = setting
        return 0.0

    def admitted(self, law: CartesianLaw, arm: CartesianArmState, tau: list[float], period: float) -> list[float]:
        """Return the torques, with the part beyond spring and damper reduced to the work that the tank can pay for.

        Args:
            law: law after the calculation of its torques.
            arm: measured state of the arm.
            tau: torques of the law with those of the feed-forward wrench, n floats [N m].
            period: duration of a cycle [s].
        """
        passive = arm.jacobian.T @ np.array(law.wrench)
        active = np.array(tau) - passive
        work = float(active @ np.array(arm.dq)) * period
        if work <= self.available:
            return tau
        result: list[float] = (passive + self.available / work * active).tolist()
        return result
