"""Joint strength of a subject by sex and mass: isometric torque, the same at all angles and speeds.

Sources, as far as they are published; the tables of Stobbe 1982 (in Chaffin & Andersson, Occupational Biomechanics) are
from memory, unconfirmed:

- wrist: Delp et al., J. Biomech. 29:1371, 1996, abstract, ten men;
- flexion of the shoulder: 89.9 N m of 26 men with the arm hanging, women half of it (abstract of "Dynamic shoulder
  flexion strength for use in occupational risk analysis and clinical assessment");
- ratio of women's strength to men's: shoulder abduction 0.43, external rotation 0.56 (abstract of "Isometric strength
  in flexors, abductors and external rotators of the shoulder", 96 men and 90 women); wrist 0.64 (J. Funct. Morphol.
  Kinesiol. 10:377, 2025); all others 0.5 to 0.65 from Stobbe 1982.

A subject's strength grows with a power of the mass that is below 1, see MASS_EXPONENT.
"""

import math
from collections.abc import Collection, Sequence
from typing import NamedTuple

from hric_core.geometry import Vector
from hric_core.summation import total
from hric_human.body import Body, Subject
from hric_human.control.controller import Person

STOBBE = "Stobbe 1982, from memory, unconfirmed"
OWN = "project default, unconfirmed"
MEAN_MASS = {"female": 61.9, "male": 73.0}
"""Body mass of the subjects whose strength STRENGTH gives [kg]: de Leva's means (project default, unconfirmed)."""
MASS_EXPONENT = 0.68
"""Exponent of the body mass in a joint's strength [1]: published for torques of people with more than 20 % of body fat,
as many adults have (Folland et al., Eur. J. Appl. Physiol. 102:739, 2008, abstract: knee extension of 86 men; 1.0 for
leaner men). That it holds for all joints and for women is a project default, unconfirmed."""


class StrengthRow(NamedTuple):
    """Strength of a joint.

    Attributes:
        positive, negative: a man's maximum torque in the joint's positive and negative direction [N m].
        women: ratio of women's strength to men's [1].
        source: source of both directions.
    """

    positive: float
    negative: float
    women: float
    source: str


STRENGTH = {
    "trunk_flex": StrengthRow(143.0, 234.0, 0.65, STOBBE),
    "trunk_bend": StrengthRow(159.0, 159.0, 0.59, STOBBE),
    "trunk_rot": StrengthRow(70.0, 70.0, 0.6, OWN),
    "neck_flex": StrengthRow(30.0, 50.0, 0.5, OWN),
    "neck_bend": StrengthRow(40.0, 40.0, 0.5, OWN),
    "neck_rot": StrengthRow(15.0, 15.0, 0.5, OWN),
    "sh_flex": StrengthRow(89.9, 85.0, 0.5, "flexion published, extension project default, unconfirmed"),
    "sh_abd": StrengthRow(71.0, 67.0, 0.43, f"{STOBBE}; share of women published"),
    "sh_rot": StrengthRow(52.0, 33.0, 0.56, f"{STOBBE}; share of women published"),
    "el_flex": StrengthRow(77.0, 46.0, 0.55, STOBBE),
    "pro_sup": StrengthRow(9.0, 11.0, 0.55, OWN),
    "wr_flex": StrengthRow(12.2, 7.1, 0.64, "Delp et al. 1996"),
    "wr_dev": StrengthRow(9.5, 11.0, 0.64, "Delp et al. 1996"),
    "hip_flex": StrengthRow(120.0, 190.0, 0.51, f"extension {STOBBE}; flexion {OWN}"),
    "hip_abd": StrengthRow(100.0, 100.0, 0.6, OWN),
    "hip_rot": StrengthRow(50.0, 50.0, 0.6, OWN),
    "knee_flex": StrengthRow(100.0, 168.0, 0.62, STOBBE),
    "ankle_flex": StrengthRow(40.0, 126.0, 0.64, f"plantar flexion {STOBBE}; dorsiflexion {OWN}"),
    "ankle_inv": StrengthRow(25.0, 25.0, 0.6, OWN),
}
"""Strength of each joint, named without its side."""


def mass_factor(subject: Subject) -> float:
    """Return the ratio of a subject's strength to that of a person of the same sex and of mean mass [1]."""
    return float((subject.mass / MEAN_MASS[subject.sex]) ** MASS_EXPONENT)


def strength(body: Body) -> tuple[list[float], list[float]]:
    """Return the minimum (negative) and maximum torque that each joint's muscles can exert, n floats each [N m]."""
    subject = body.subject
    scale = mass_factor(subject)
    rows = [STRENGTH[joint.row.name] for joint in body.joints.values()]
    shares = [scale * (row.women if subject.sex == "female" else 1.0) for row in rows]
    weakest = [-share * row.negative for share, row in zip(shares, rows, strict=True)]
    return weakest, [share * row.positive for share, row in zip(shares, rows, strict=True)]


def hand_force(person: Person, q: Sequence[float], direction: Vector, joints: Collection[str] = ()) -> float:
    """Return the largest static force that the hand can exert along a direction [N], tau = g(q) + J(q)' f u.

    0: a joint is too weak for the body's own weight.

    Args:
        person: person who exerts the force.
        q: joint positions, n floats [rad].
        direction: unit vector u in axes of the body's root link.
        joints: names of the joints whose strength limits the force; empty: all joints of the hand's chain.
    """
    chain = person.hand.posed(q)
    weight, largest = person.own_weight(q), math.inf
    columns = chain.velocities(chain.point(person.hand.p_link_hand))
    for index, column in zip(person.hand.joints, columns, strict=True):
        arm = total(a * b for a, b in zip(column, direction, strict=True))
        if arm and (not joints or person.joints[index] in joints):
            limit = person.strongest[index] if arm > 0.0 else person.weakest[index]
            largest = min(largest, (limit - weight[index]) / arm)
    return max(0.0, largest)
