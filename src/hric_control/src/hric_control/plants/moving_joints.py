"""Moving joints of a robot in the engine's order, with the indices of the actuated ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from hric_control.plant import FloatArray, Mode
from hric_control.plants.config import PlantConfig
from hric_control.plants.divergence import Divergence
from hric_control.plants.friction import FADE, GIVE, Phi, breakaways, refuse_other_joints, sigmoid_parameters
from hric_core import urdf
from hric_core.errors import CommandError, UnknownNameError

T = TypeVar("T")


@dataclass(frozen=True)
class Losses:
    """Friction and rotor inertia of one joint.

    Attributes:
        rotor: inertia of the rotor at the joint [kg m^2].
        coulomb: Coulomb friction [N m].
        damping: viscous friction [N m s/rad].
        sigmoid: phi1 [N m], phi2 [s/rad], phi3 [rad/s] of `hric_control.plants.friction`.
        breakaway: breakaway torque of its bristle [N m].
    """

    rotor: float = 0.0
    coulomb: float = 0.0
    damping: float = 0.0
    sigmoid: Phi = (0.0, 0.0, 0.0)
    breakaway: float = 0.0

    def sigmoid_row(self) -> list[float]:
        """Return a, b, c, d of the sigmoid as a (tanh(b (dq + c)) - d), which does not overflow at high speed."""
        phi1, phi2, phi3 = self.sigmoid
        return [0.5 * phi1, 0.5 * phi2, phi3, math.tanh(0.5 * phi2 * phi3)]

    def bristle_row(self) -> list[float]:
        """Return breakaway [N m], deflection there [rad], and the speed above which the bristle is off [rad/s]."""
        return [self.breakaway, GIVE, FADE]


Follower = tuple[int, int, float, float]
"""Joint that mimics another: index, leader's index, multiplier, offset [rad or m]; q = multiplier q_leader + offset.

The leader is the joint at the end of the chain of mimic joints."""


class MovingJoints:
    """Vectors of all moving joints, in the engine's order, and of the actuated ones, in the user's order.

    Args:
        joints: all moving joints, in the engine's order.
        actuated: names in the user's order.
        robot: name of the robot, for messages.

    Attributes:
        names: names of all moving joints.
        user: indices of the actuated joints among them, in the user's order.
        followers: joints that mimic others.
        straight: True if both orders are the same and all joints are actuated.
        zeros: one zero per moving joint.

    Raises:
        UnknownNameError: an actuated joint is not among them.
    """

    def __init__(self, joints: Sequence[urdf.Joint], actuated: Sequence[str], robot: str) -> None:
        self.joints, self.actuated = list(joints), tuple(actuated)
        self.names = [joint.name for joint in joints]
        for name in actuated:
            if name not in self.names:
                raise UnknownNameError("moving joint", name, self.names, f"robot {robot}")
        self.user = [self.names.index(name) for name in actuated]
        laws = urdf.mimic_laws({joint.name: joint for joint in joints})
        self.followers: list[Follower] = [
            (self.names.index(name), self.names.index(law.joint), law.multiplier, law.offset)
            for name, law in laws.items()
        ]
        self.straight = self.user == list(range(len(joints)))
        self.zeros = [0.0] * len(joints)
        self._straight_length = len(joints) if self.straight else -1

    def spread(self, values: Sequence[float], rest: Sequence[float]) -> list[float]:
        """Return values of all moving joints from those of the actuated ones; `rest` fills the others."""
        if len(values) != len(self.actuated):
            raise CommandError(f"got {len(values)} values for {len(self.actuated)} joints ({', '.join(self.actuated)})")
        full = list(rest)
        for i, value in zip(self.user, values, strict=True):
            full[i] = float(value)
        return full

    def command(self, values: Sequence[float] | FloatArray) -> list[float]:
        """Return commands of all moving joints from those of the actuated ones, the others zero, as a new list."""
        floats: list[float] = values.tolist() if isinstance(values, np.ndarray) else list(values)
        return floats if len(floats) == self._straight_length else self.spread(floats, self.zeros)

    def pick(self, values: Sequence[T]) -> list[T]:
        """Return the actuated joints' values from those of all moving joints."""
        return [values[i] for i in self.user]

    def read(
        self,
        state: tuple[Sequence[float], Sequence[float], Sequence[float]],
        q: list[float],
        dq: list[float],
        tau: list[float],
    ) -> None:
        """Write position, velocity and effort of the actuated joints to q, dq and tau.

        Args:
            state: position, velocity and effort of all moving joints.
            q: positions of the actuated joints, written in place [rad or m].
            dq: their velocities [rad/s or m/s].
            tau: their efforts [N m or N].
        """
        if self.straight:
            q[:], dq[:], tau[:] = state
        else:
            q[:], dq[:], tau[:] = map(self.pick, state)

    def start(self, q: Sequence[float], dq: Sequence[float], now: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return positions and speeds of all moving joints [rad or m, rad/s or m/s] from those of the actuated ones.

        Mimic joints follow their laws; the rest stays at the present position, at rest.

        Raises:
            CommandError: a value is not finite, or there are not as many as joints.
        """
        full_q, full_dq = self.spread(q, now), self.spread(dq, self.zeros)
        if not all(map(math.isfinite, full_q + full_dq)):
            raise CommandError(f"q and dq must be finite; got {list(q)} and {list(dq)}")
        self.follow(full_q, full_dq)
        return full_q, full_dq

    def follow(self, q: list[float], dq: list[float]) -> None:
        """Apply the laws of mimic joints to positions and speeds of all moving joints, in place."""
        for i, leader, multiplier, offset in self.followers:
            q[i], dq[i] = multiplier * q[leader] + offset, multiplier * dq[leader]

    def law_jacobian(self) -> FloatArray:
        """Return the change of all speeds per speed of each joint, mimic joints included, shape (n, n)."""
        J = np.eye(len(self.joints))
        for i, leader, multiplier, _ in self.followers:
            J[i, i], J[i, leader] = 0.0, multiplier
        return J

    def modes(self, modes: Sequence[Mode], brakes: Sequence[bool], *, locked: bool) -> list[Mode]:
        """Return the modes of all moving joints; a mimic joint is never braked.

        Args:
            modes: modes of the actuated joints.
            brakes: brakes of the actuated joints; a brake overrides the mode.
            locked: True if the other joints are braked.
        """
        full = [Mode.BRAKE if locked else Mode.EFFORT] * len(self.joints)
        for i, mode, braked in zip(self.user, modes, brakes, strict=True):
            full[i] = Mode.BRAKE if braked else mode
        for i, *_ in self.followers:
            full[i] = Mode.EFFORT
        return full

    def losses(self, config: PlantConfig) -> list[Losses]:
        """Return the friction and rotor inertia of all moving joints."""
        coulomb = config.friction == "coulomb"
        losses = [
            Losses(rotor, joint.friction if coulomb else 0.0, joint.damping)
            for rotor, joint in zip(self.spread(config.rotor_inertia, self.zeros), self.joints, strict=True)
        ]
        if config.friction == "identified":
            refuse_other_joints(config.friction_parameters, self.actuated)
            phis = sigmoid_parameters(config.friction_parameters, self.actuated)
            held = breakaways(config.friction_parameters, self.actuated)
            for i, phi, breakaway in zip(self.user, phis, held, strict=True):
                losses[i] = replace(losses[i], sigmoid=phi, breakaway=breakaway)
        return losses

    def divergence(self, time_step: float) -> Divergence:
        """Return the divergence check of these joints after each step of `time_step` [s]."""
        limits, slides = (
            [joint.velocity for joint in self.joints],
            [joint.type == "prismatic" for joint in self.joints],
        )
        return Divergence(self.names, limits, slides, time_step)
