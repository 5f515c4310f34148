"""Controller of a person whose hand follows a target: that of a policy, or that of the reactions in hric_human.

The environment writes the policy's target to TARGETS; the controller `hric_gym/GuidedArm` reads it. The reference of
the hand moves towards the target at a limited speed, and stops where the person's arm cannot reach farther.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hric_core.geometry import FloatArray, Pose, Vector, compose
from hric_core.geometry.poses import inverse
from hric_core.parameters import number, numbers, text
from hric_human.control.controller import Person
from hric_human.control.impedance import ImpedanceArm, ImpedanceArmSettings
from hric_human.control.inverse_kinematics import HandSolver, OutOfReachError
from hric_human.control.references import KNOT, AngleRows, Joints, Reference
from hric_human.hand import Hand
from hric_human.hand.reactive import Reaction, Reactive

TARGETS: dict[str, FloatArray] = {}
"""Target of each guided hand in the world, shape (3,) [m], by the parameter `channel` of its controller."""


@dataclass(frozen=True)
class GuidedArmSettings(ImpedanceArmSettings):
    """Parameters of GuidedArm; the inherited parameter `reference` has no effect."""

    channel: str = text("", text="key of the hand's target in TARGETS; empty: the hand reacts to the robot")
    start: Vector = numbers(3, unit="m", text="position of the hand at the start, world")
    speed: float = number(
        1.0, above=0.0, maximum=5.0, unit="m/s", text="largest speed of the hand's reference (project default)"
    )


class GuidedReference(Reference):
    """Reference of the person's joints, so that the hand moves towards its target in TARGETS or reacts to the robot.

    Args:
        person: person whose hand moves.
        settings: channel, start position and speed.

    Raises:
        OutOfReachError: the hand cannot reach the start position.
    """

    def __init__(self, person: Person, settings: GuidedArmSettings) -> None:
        self._channel, self._step = settings.channel, settings.speed * KNOT
        self._solver = HandSolver(person.hand, person.lower, person.upper, person.rest)
        self._T_root_world, self._p = inverse(person.T_world_root), np.array(settings.start)
        TARGETS[self._channel] = self._p.copy()
        self._program, self._knots = Reactive(Reaction(rest=settings.start), np.random.default_rng(person.seed)), 0
        self._hand = Hand(self._program)
        self._last = self._solver.first(self._pose(self._p))
        self._rows = AngleRows(KNOT, [self._last], self._next)

    def start(self, time: float) -> None:
        """Start to follow the target at a robot time [s]."""
        self._rows.start(time)
        self._hand.start(time)

    def see(self, time: float, position: Vector) -> None:
        """Pass the position [m] of the robot's end effector to the reactions."""
        self._hand.see(time, position)

    def feel(self, time: float, force: Vector) -> None:
        """Pass the force [N] on the hand to the reactions."""
        self._hand.feel(time, force)

    def at(self, time: float) -> tuple[Joints, Joints]:
        """Return the joint positions [rad] and velocities [rad/s] at a robot time [s]."""
        return self._rows.at(time)

    def _pose(self, p: FloatArray) -> Pose:
        x, y, z = p.tolist()
        return compose(self._T_root_world, Pose((x, y, z)))

    def _next(self) -> Joints:
        self._knots += 1
        program, channel = self._program, self._channel
        offset = (TARGETS[channel] if channel else np.array(program.pose(self._knots * KNOT).position)) - self._p
        distance = float(np.linalg.norm(offset))
        if distance > 0.0:
            p = self._p + offset * min(1.0, self._step / distance)
            try:
                self._last = self._solver.next(self._pose(p), self._last)
            except OutOfReachError:
                return self._last
            self._p = p
        return self._last


class GuidedArm(ImpedanceArm):
    """Controller of the person's joints as `hric_human/ImpedanceArm`, with GuidedReference as reference."""

    settings = GuidedArmSettings

    def init(self, person: Person, settings: Any) -> None:
        """Read the impedance, and set the reference to the start position of the hand."""
        super().init(person, settings)
        self._reference = GuidedReference(person, settings)
        self.end = self._reference.end
