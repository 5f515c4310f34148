"""Conversion between vectors of all moving joints, in the engine's order, and of the actuated ones, in the user's."""

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
        rotor: rotor inertia, seen at the joint [kg m^2].
        coulomb: Coulomb friction [N m].
        damping: viscous friction coefficient [N m s/rad].
        sigmoid: phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the sigmoid friction (`hric_control.plants.friction`).
        breakaway: breakaway torque of the friction bristle [N m].
    """

    rotor: float = 0.0
    coulomb: float = 0.0
    damping: float = 0.0
    sigmoid: Phi = (0.0, 0.0, 0.0)
    breakaway: float = 0.0

    def sigmoid_row(self) -> list[float]:
        """Return a, b, c, d of the sigmoid friction a (tanh(b (dq + c)) - d), a form that does not overflow."""
        phi1, phi2, phi3 = self.sigmoid
        return [0.5 * phi1, 0.5 * phi2, phi3, math.tanh(0.5 * phi2 * phi3)]

    def bristle_row(self) -> list[float]:
        """Return breakaway torque [N m], deflection at breakaway [rad], and speed above which there is none [rad/s]."""
        return [self.breakaway, GIVE, FADE]


Follower = tuple[int, int, float, float]
"""Mimic joint: its index, index of its leader, multiplier, offset [rad or m]; q = multiplier q_leader + offset.

The leader is the joint at the end of a chain of mimic joints; it mimics no other joint."""


class MovingJoints:
    """Moving joints of a robot or model; converts vectors of all of them to vectors of the actuated ones, and back.

    Vectors of all moving joints are in the engine's order, those of the actuated joints in the user's order.

    Args:
        joints: all moving joints, in the engine's order.
        actuated: names of the actuated joints, in the user's order.
        robot: name of the robot, for error messages.

    Attributes:
        names: names of all moving joints.
        user: indices of the actuated joints in `names`, in the user's order.
        followers: mimic joints.
        straight: True if all joints are actuated and both orders are the same.
        zeros: list with a zero for each moving joint.

    Raises:
        UnknownNameError: an actuated joint is not among the moving joints.
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
        """Return values of all moving joints, from values of the actuated ones; the others are taken from `rest`."""
        if len(values) != len(self.actuated):
            raise CommandError(f"got {len(values)} values for {len(self.actuated)} joints ({', '.join(self.actuated)})")
        full = list(rest)
        for i, value in zip(self.user, values, strict=True):
            full[i] = float(value)
        return full

    def command(self, values: Sequence[float] | FloatArray) -> list[float]:
        """Return commands of all moving joints as a new list, from those of the actuated ones; the others are zero."""
        floats: list[float] = values[:] if type(values) is list else np.asarray(values).tolist()
        return floats if len(floats) == self._straight_length else self.spread(floats, self.zeros)

    def pick(self, values: Sequence[T]) -> list[T]:
        """Return the values of the actuated joints, from values of all moving joints."""
        return [values[i] for i in self.user]

    def start(self, q: Sequence[float], dq: Sequence[float], now: Sequence[float]) -> tuple[list[float], list[float]]:
        """Return positions and velocities of all moving joints [rad or m, rad/s or m/s] for a given state.

        Mimic joints follow their laws; all other joints that are not actuated get their present position and velocity
        zero.

        Args:
            q: positions of the actuated joints [rad or m].
            dq: velocities of the actuated joints [rad/s or m/s].
            now: present positions of all moving joints [rad or m].

        Raises:
            CommandError: a value is not finite, or there is not one value per actuated joint.
        """
        full_q, full_dq = self.spread(q, now), self.spread(dq, self.zeros)
        if not all(map(math.isfinite, full_q + full_dq)):
            raise CommandError(f"q and dq must be finite; got {list(q)} and {list(dq)}")
        self.follow(full_q, full_dq)
        return full_q, full_dq

    def follow(self, q: list[float], dq: list[float]) -> None:
        """Set the positions and velocities of mimic joints by their laws, in vectors of all moving joints, in place."""
        for i, leader, multiplier, offset in self.followers:
            q[i], dq[i] = multiplier * q[leader] + offset, multiplier * dq[leader]

    def law_jacobian(self) -> FloatArray:
        """Return the Jacobian of the mimic laws, shape (n, n): velocities of all joints per velocity of each joint."""
        J = np.eye(len(self.joints))
        for i, leader, multiplier, _ in self.followers:
            J[i, i], J[i, leader] = 0.0, multiplier
        return J

    def modes(self, modes: Sequence[Mode], brakes: Sequence[bool], *, locked: bool) -> list[Mode]:
        """Return the command modes of all moving joints; a mimic joint never has the mode BRAKE.

        Args:
            modes: command modes of the actuated joints.
            brakes: True for each actuated joint whose brake is locked; this overrides its mode.
            locked: True if joints that are not actuated are locked.
        """
        full = [Mode.BRAKE if locked else Mode.EFFORT] * len(self.joints)
        for i, mode, braked in zip(self.user, modes, brakes, strict=True):
            full[i] = Mode.BRAKE if braked else mode
        for i, *_ in self.followers:
            full[i] = Mode.EFFORT
        return full

    def losses(self, config: PlantConfig) -> list[Losses]:
        """Return friction and rotor inertia of all moving joints, by the plant's parameters and the description."""
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
        """Return a divergence check for all moving joints, for a plant with this time step [s]."""
        limits, slides = (
            [joint.velocity for joint in self.joints],
            [joint.type == "prismatic" for joint in self.joints],
        )
        return Divergence(self.names, limits, slides, time_step)
