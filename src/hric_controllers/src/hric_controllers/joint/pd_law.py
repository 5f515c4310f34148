"""Joint PD law with a ramp for the gains and a limit on the rate of torque; no ROS, plain floats.

tau = Kp (q_d - q) - Kd dq  [+ g(q), added by the caller's function]      thesis, eq. 3
"""

from collections.abc import Callable, Sequence

from hric_control.native.vectors import spring_damper

Gravity = Callable[[list[float]], list[float]]
"""q (n floats) [rad] -> gravity torque (n floats) [N m]."""


class PdLaw:
    """State of the law: gains in force, gains to come, last torque.

    Args:
        kp: n stiffnesses [N m/rad].
        kd: n dampings [N m s/rad].
        rotatum_limit: largest rate of the torque [N m/s]; 0 means no limit.
        ramp: time in which new gains take over [s].
    """

    def __init__(self, kp: Sequence[float], kd: Sequence[float], rotatum_limit: float, ramp: float) -> None:
        self.kp, self.kd = list(kp), list(kd)
        self._max_rate, self._ramp = rotatum_limit, ramp
        self._from: tuple[list[float], list[float]] = (self.kp, self.kd)
        self._to = self._from
        self._ramp_start: float | None = None
        self.last = [0.0] * len(self.kp)

    def start(self, torque: Sequence[float]) -> None:
        """Forget the past: the rate of torque is limited from `torque` (n floats) [N m] on, gains that were on their
        way are in force."""
        self.last = list(torque)
        (self.kp, self.kd), self._ramp_start = self._to, None

    def change_gains(self, time: float, kp: Sequence[float], kd: Sequence[float]) -> None:
        """Lead the gains linearly from those in force to these, beginning at `time` [s]."""
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
        """Torque to command, n floats [N m].

        Args:
            time: robot time [s].
            period: since the last torque [s].
            q: measured position, n floats [rad].
            dq: measured velocity, n floats [rad/s].
            q_d: desired position, n floats [rad].
            gravity: added if given.
        """
        if self._ramp_start is not None:
            self._advance(time, self._ramp_start)
        added = None if gravity is None else gravity(q)
        self.last = tau = spring_damper(self.kp, self.kd, q_d, q, dq, self.last, added, self._max_rate * period)
        return tau
