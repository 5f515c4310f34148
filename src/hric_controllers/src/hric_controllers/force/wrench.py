"""External wrench for controllers of force and admittance: the arm's estimate less its mean after the start. No ROS."""

import math

from hric_core.errors import FailureError


class TaredWrench:
    """Wrench that the arm exerts on its environment: the estimate less its mean after the start.

    Args:
        tare_time: duration of the tare [s]; its first half does not count, as arm and filter of the estimate settle.
    """

    def __init__(self, tare_time: float) -> None:
        self._tare_time = tare_time
        self.start()

    def start(self) -> None:
        """Begin the tare again."""
        self._mean, self._seconds = [0.0] * 6, 0.0

    def advance(self, estimate: list[float], period: float) -> list[float] | None:
        """Return the wrench after one more cycle of `period` [s], 6 floats [N], [N m]; None during the tare.

        Args:
            estimate: O_F_ext_hat_K, the wrench that the arm exerts, 6 floats [N], [N m].
            period: time since the last cycle [s].

        Raises:
            FailureError: a component is NaN or infinite, so that the force on the arm is not known.
        """
        if not math.isfinite(sum(estimate)):
            raise FailureError(
                f"the estimated external wrench (O_F_ext_hat_K) is not finite: {estimate}; the arm holds its pose, "
                "start the controller again when the estimate is finite"
            )
        if self._seconds >= self._tare_time:
            return [new - mean for new, mean in zip(estimate, self._mean, strict=True)]
        self._seconds += period
        counted = self._seconds - 0.5 * self._tare_time
        if counted > 0.0:
            share = min(1.0, period / counted)
            self._mean = [mean + share * (new - mean) for mean, new in zip(self._mean, estimate, strict=True)]
        return None
