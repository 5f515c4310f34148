"""Common part of the robots of all engines: modes, brakes and stops of the joints, and their state after a step."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence

from hric_control.plant import FloatArray, Mode
from hric_control.plants.config import PlantConfig
from hric_control.plants.moving_joints import MovingJoints
from hric_control.plants.stops import StopMemory

_FAR = 1e9
"""Joint limit that no joint reaches [rad or m]."""


class EngineRobot(ABC):
    """One robot with a fixed base; vectors are in the order of its moving joints.

    Args:
        joints: moving joints.
        config: the plant's parameters.

    Attributes:
        joints: moving joints.
        losses: losses of all moving joints.
        stops: stops of all moving joints that wait for their joint.
        q, dq: the engine's state after the last step [rad or m, rad/s or m/s].
        at: positions at the measuring instant, which is that of the speeds [rad or m].
        motor_effort: efforts of the joints' motors in the last step [N m or N].
        effort: efforts behind the rotors, where an arm's torque sensors are [N m or N].
    """

    def __init__(self, joints: MovingJoints, config: PlantConfig) -> None:
        self.joints, self.losses = joints, joints.losses(config)
        self.stops = StopMemory([(joint.lower, joint.upper) for joint in joints.joints])
        self._divergence = joints.divergence(config.time_step)
        self._locked = config.passive_joints == "locked"
        self._actuated_modes = [Mode.EFFORT] * len(joints.actuated)
        self._brakes = [False] * len(joints.actuated)
        self.q = self.dq = self.at = self.effort = self.motor_effort = joints.zeros

    @abstractmethod
    def put(self, q: Sequence[float], dq: Sequence[float]) -> None:
        """Put the actuated joints at q, dq; the others keep their positions, at rest."""

    @abstractmethod
    def mass_matrix(self) -> FloatArray:
        """Return the engine's mass matrix of all moving joints without rotors, shape (m, m) [kg m^2]."""

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the meaning of the commands of the actuated joints."""
        self._actuated_modes = list(modes)
        self._send_modes()

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock or free the actuated joints."""
        self._brakes = [bool(b) for b in on]
        self._send_modes()

    def _modes(self) -> list[Mode]:
        """Return the modes of all moving joints, including brakes and passive joints."""
        return self.joints.modes(self._actuated_modes, self._brakes, locked=self._locked)

    @abstractmethod
    def _send_modes(self) -> None:
        """Apply the modes of all moving joints in the engine."""

    def _send_stops(self, joints: Iterable[int]) -> None:
        """Apply the stops of some moving joints in the engine."""
        for i in joints:
            low, high = self.stops.limits[i]
            below, above = self.stops.waiting.get(i, (False, False))
            self._send_stop(i, -_FAR if below else low, _FAR if above else high)

    def _send_stop(self, i: int, low: float, high: float) -> None:  # noqa: B027  (an engine may have no stops)
        """Apply the stops of one moving joint in the engine."""

    def _check_state(self, *, quiet: bool = False) -> None:
        """Check the state after a step, and activate the stops of joints that are inside their range again.

        Raises:
            DivergedError: a joint is not finite, or too fast; see `Divergence.check`.
        """
        self._divergence.check(self.q, self.dq, quiet=quiet)
        if self.stops.waiting:
            self._send_stops(self.stops.check(self.q))
