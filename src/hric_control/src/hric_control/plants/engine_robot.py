"""Base class of the simulated robots of all engines: modes, brakes, stops and state of the joints."""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence

import numpy as np

from hric_control.plant import FloatArray, Mode
from hric_control.plants.config import PlantConfig
from hric_control.plants.moving_joints import MovingJoints
from hric_control.plants.stops import StopMemory
from hric_core.errors import DescriptionError

_FAR = 1e9
"""Position of a joint stop that no joint reaches, which disables the stop [rad or m]."""
_MIN_INERTIA = 1e-11
"""Inertia up to which a motion of the joints is resisted by nothing [kg m^2 or kg]; project default, unconfirmed."""


class EngineRobot(ABC):
    """Robot with a fixed base in a physics engine; vectors are in the order of its moving joints.

    Args:
        joints: moving joints of the robot.
        config: the plant's parameters.

    Attributes:
        joints: moving joints of the robot.
        losses: friction of all moving joints.
        stops: stops of all moving joints; the stop of a joint outside its range is disabled until the joint is inside.
        q, dq: the engine's joint positions and velocities after the last step [rad or m, rad/s or m/s].
        at: joint positions at the measuring instant, which is that of `dq` [rad or m].
        motor_effort: efforts of the joints' motors in the last step [N m or N].
        effort: efforts on the link's side of the rotors, as an arm's torque sensors measure them [N m or N].
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
        """Set positions q and velocities dq of the actuated joints; other joints keep their position, at zero speed."""

    @abstractmethod
    def mass_matrix(self) -> FloatArray:
        """Return the engine's mass matrix of all m moving joints, without rotor inertia, shape (m, m) [kg m^2]."""

    def check_inertia(self) -> None:
        """Raise DescriptionError if no inertia resists a motion of the joints at the present positions."""
        self._check_positive(self.mass_matrix())

    def _check_positive(self, M: FloatArray, rotors: bool = True) -> None:
        if own := sorted({*range(len(M))} - {follower for follower, *_ in self.joints.followers}):
            J = self.joints.law_jacobian()[:, own]
            M = M + rotors * np.diag([loss.rotor for loss in self.losses])
            values, motions = np.linalg.eigh(J.T @ M @ J) if np.isfinite(M).all() else ([math.nan], np.eye(len(own)))
            if not values[0] > rotors * _MIN_INERTIA:
                joint = self.joints.joints[own[int(np.abs(motions[:, 0]).argmax())]]
                raise DescriptionError(
                    f"joint {joint.name}: the inertia about it is {values[0]:.3g} kg m^2 at these positions, so that "
                    f"nothing resists its motion; correct <inertial> of link {joint.child} and of the links beyond it"
                )

    def set_modes(self, modes: Sequence[Mode]) -> None:
        """Set the command modes of the actuated joints."""
        self._actuated_modes = list(modes)
        self._send_modes()

    def set_brakes(self, on: Sequence[bool]) -> None:
        """Lock (True) or release (False) the brakes of the actuated joints."""
        self._brakes = [bool(b) for b in on]
        self._send_modes()

    def _modes(self) -> list[Mode]:
        """Return the modes of all moving joints, including passive ones; a locked joint has the mode BRAKE."""
        return self.joints.modes(self._actuated_modes, self._brakes, locked=self._locked)

    @abstractmethod
    def _send_modes(self) -> None:
        """Set the modes of all moving joints in the engine."""

    def _send_stops(self, joints: Iterable[int]) -> None:
        """Set the stops of some moving joints in the engine; `joints`: their indices."""
        for i in joints:
            low, high = self.stops.limits[i]
            below, above = self.stops.waiting.get(i, (False, False))
            self._send_stop(i, -_FAR if below else low, _FAR if above else high)

    def _send_stop(self, i: int, low: float, high: float) -> None:  # noqa: B027  (an engine may have no stops)
        """Set the stops of moving joint `i` in the engine, at the positions low and high [rad or m]."""

    def _check_state(self, *, quiet: bool = False) -> None:
        """Check the state after a step, and enable the stops of joints that are inside their range again.

        Raises:
            DivergedError: a joint's state is not finite, or its speed is beyond its bound.
        """
        if quiet:
            self._divergence.steps += 1
        else:
            self._divergence.check(self.q, self.dq)
        if self.stops.waiting:
            self._send_stops(self.stops.check(self.q))
