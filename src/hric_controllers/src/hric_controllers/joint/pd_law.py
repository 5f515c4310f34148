"""Joint PD law with ramped gains and a limited torque rate; no ROS, plain floats.

tau = Kp (q_d - q) - Kd dq  [+ g(q), added by the caller's function]      thesis, eq. 3
"""

from collections.abc import Callable, Sequence

from hric_core.native.vectors import spring_damper

Gravity = Callable[[list[float]], list[float]]
"""Function that maps joint positions q (n floats [rad]) to gravity torques (n floats [N m])."""


class PdLaw:
    """PD law of n joints with its state: present gains, target gains, last torque.

    Args:
        kp: stiffness of each joint [N m/rad].
        kd: damping of each joint [N m s/rad].
        rotatum_limit: maximum torque rate [N m/s]; 0 means no limit.
        ramp: duration of the linear transition to new gains [s].
    """

    def __init__(self, kp: Sequence[float], kd: Sequence[float], rotatum_limit: float, ramp: float) -> None:
        self.kp, self.kd = list(kp), list(kd)
        self._max_rate, self._ramp = rotatum_limit, ramp
        self._from: tuple[list[float], list[float]] = (self.kp, self.kd)
        self._to = self._from
        self._ramp_start: float | None = None
        self.last = [0.0] * len(self.kp)

    def start(self, torque: Sequence[float]) -> None:
        """Reset the law: the torque rate is limited from `torque` (n floats [N m]) on, and pending gains apply now."""
        self.last = list(torque)
        (self.kp, self.kd), self._ramp_start = self._to, None

    def change_gains(self, time: float, kp: Sequence[float], kd: Sequence[float]) -> None:
        """Change the gains linearly from the present ones to `kp` [N m/rad], `kd` [N m s/rad], from `time` [s] on."""
        self._from, self._to = (self.kp, self.kd), (list(kp), list(kd))
        self._ramp_start = time

    def _advance(self, time: float, start: float) -> None:
        share = (time - start) / self._ramp if self._ramp > 0.0 else 1.0
        if share >= 1.0:
            (self.kp, self.kd), self._ramp_start = self._to, None
            return
        self.kp, self.kd = (
            [a + share * (b - a) for a, b in zip(*pair, strict=True)] for pair in zip(self._from, self._to, strict=True)
        )

    def torque(
        self, time: float, period: float, q: list[float], dq: list[float], q_d: list[float], gravity: Gravity | None
    ) -> list[float]:
        """Return the torques to command, n floats [N m].

        Args:
            time: robot time [s].
            period: time since the last call [s].
            q: measured positions, n floats [rad].
            dq: measured velocities, n floats [rad/s].
            q_d: desired positions, n floats [rad].
            gravity: function that returns the gravity torque to add; None: none is added.
        """
        if self._ramp_start is not None:
            self._advance(time, self._ramp_start)
        added = None if gravity is None else gravity(q)
        self.last = tau = spring_damper(self.kp, self.kd, q_d, q, dq, self.last, added, self._max_rate * period)
        return tau
