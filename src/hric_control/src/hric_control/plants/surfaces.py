"""How surfaces answer when they meet: rigid, or by a spring with damping and friction (penalty contact)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hric_control.plant import FloatArray

SLIP_VELOCITY = 1e-3
"""Friction of a penalty contact grows linearly up to this sliding speed [m/s] (our choice); a spring has no memory to stick with."""


@dataclass(frozen=True)
class Surface:
    """How a body's surface answers.

    Attributes:
        stiffness: of penalty contact [N/m]; None for the engine's rigid contact.
        damping: of penalty contact [N s/m].
        friction: coefficient; a pair has the product of both.
    """

    stiffness: float | None = None
    damping: float = 0.0
    friction: float = 0.5


def combine(first: Surface, second: Surface) -> tuple[float, float, float] | None:
    """(stiffness [N/m], damping [N s/m], friction) of a pair, None when both are rigid: two springs act in series, a rigid partner adds nothing."""
    stiffnesses = [s.stiffness for s in (first, second) if s.stiffness is not None]
    if not stiffnesses:
        return None
    return 1.0 / sum(1.0 / k for k in stiffnesses), max(first.damping, second.damping), first.friction * second.friction


def friction_force(load: float, friction: float, normal: FloatArray, relative: FloatArray) -> FloatArray:
    """What friction takes from the force on a, shape (3,) [N].

    Args:
        load: normal force [N].
        friction: coefficient.
        normal: from b to a, unit vector, shape (3,).
        relative: velocity of a seen from b at the contact, shape (3,) [m/s].
    """
    sliding = relative - (relative @ normal) * normal
    speed = math.sqrt(float(sliding @ sliding))
    across: FloatArray = friction * load / max(speed, SLIP_VELOCITY) * sliding
    return across
