"""Simulation of published strengths of joints and forces of the hand."""

import numpy as np

from hric_core.geometry import FloatArray
from hric_human.control.controller import Person
from hric_human.control.strength import hand_force
from hric_measurements.reproduction.definition import DataSet
from hric_measurements.reproduction.experiments.person import (
    AVERAGE_MAN,
    AVERAGE_WOMAN,
    MEN,
    NO_GRAVITY,
    WOMEN,
    control,
    posture,
    strengths,
)

MEASURED_MEN, MEASURED_WOMEN = 217, 283
"""Numbers of people in the publication of forearm torques."""
PLANAR = {"sh_flex": 90.0, "sh_abd": 45.0, "sh_rot": 70.0, "el_flex": 90.0}
"""Upper arm at the height of the shoulder, 45 deg outward, forearm inward and raised by 20 deg, since the range of the
shoulder's rotation ends there [deg]."""
SAGITTAL = {"sh_flex": 45.0, "el_flex": 45.0}
"""Hand in front of the body at the height of the chest [deg]."""
EIGHT = 2.0 * np.pi * np.arange(8) / 8.0
"""Angles of eight directions in a plane [rad]."""


def capacity(data: DataSet) -> dict[str, float]:
    """Return the torques of shoulder adduction and wrist extension [N m] and their ratio, means of the subjects."""
    adduction = [strengths(name, "sh_abd")[1] for name in (*WOMEN, *MEN)]
    extension = [strengths(name, "wr_flex")[1] for name in (*WOMEN, *MEN)]
    return {
        "adduction": float(np.mean(adduction)),
        "wrist_extension": float(np.mean(extension)),
        "ratio": float(np.mean(np.divide(adduction, extension))),
    }


def elbow_by_mass(data: DataSet) -> dict[str, float]:
    """Return a man's torques of elbow flexion and extension per body mass [N m/kg], and their ratio."""
    flexion, extension = strengths(AVERAGE_MAN, "el_flex")
    mass = control(AVERAGE_MAN).person.body.subject.mass
    return {"flexion": flexion / mass, "extension": extension / mass, "ratio": flexion / extension}


def elbow_of_women(data: DataSet) -> dict[str, float]:
    """Return a woman's torque of elbow flexion [N m]."""
    return {"flexion": strengths(AVERAGE_WOMAN, "el_flex")[0]}


def forearm(data: DataSet) -> dict[str, float]:
    """Return the torques of pronation and supination [N m], means weighted by the numbers of men and women."""
    men, women = strengths(AVERAGE_MAN, "pro_sup"), strengths(AVERAGE_WOMAN, "pro_sup")
    pronation, supination = np.average([men, women], axis=0, weights=(MEASURED_MEN, MEASURED_WOMEN)).tolist()
    return {"pronation": pronation, "supination": supination}


def held_arm(data: DataSet) -> dict[str, float]:
    """Return the share of the shoulder's strength that holds a straight horizontal arm [1]."""
    shares = {}
    for sex, name in (("men", AVERAGE_MAN), ("women", AVERAGE_WOMAN)):
        person = control(name).person
        index = person.joints.index("right_sh_flex")
        shares[sex] = person.own_weight(posture(person.joints, sh_flex=90.0))[index] / person.strongest[index]
    return shares


def one_handed(data: DataSet) -> dict[str, float]:
    """Return the ratio of a woman's to a man's largest hand force in the sagittal plane, mean of eight directions."""
    directions = np.stack([np.cos(EIGHT), np.zeros(8), np.sin(EIGHT)], axis=1)
    woman, man = (_forces(control(name).person, SAGITTAL, directions) for name in (AVERAGE_WOMAN, AVERAGE_MAN))
    return {"ratio": float(np.mean(woman / man))}


def horizontal_plane(data: DataSet) -> dict[str, float]:
    """Return the largest deviation of a normalised hand force from the subjects' mean [1], and an angle [deg].

    The angle is the largest one, of all subjects, between their largest force and the line from shoulder to hand.
    """
    patterns, angles = [], []
    for name in (*WOMEN, *MEN):
        person = control(name, NO_GRAVITY).person
        q = posture(person.joints, **PLANAR)
        line = np.subtract(person.hand.pose(q).position, person.hand.shoulder(q))
        turned = EIGHT + np.arctan2(line[1], line[0])
        directions = np.stack([np.cos(turned), np.sin(turned), np.zeros(8)], axis=1)
        forces = _forces(person, PLANAR, directions, ("right_sh_abd", "right_el_flex"))
        patterns.append(forces / forces.mean())
        angle = np.degrees(EIGHT[int(np.argmax(forces))])
        angles.append(min(angle % 180.0, 180.0 - angle % 180.0))
    mean = np.mean(patterns, axis=0)
    return {"pattern": float(np.max(np.abs(patterns / mean - 1.0))), "angle": float(np.max(angles))}


def _forces(
    person: Person, degrees: dict[str, float], directions: FloatArray, joints: tuple[str, ...] = ()
) -> FloatArray:
    """Return the largest static hand forces along directions, shape (n, 3), at a posture [deg]: shape (n,) [N]."""
    q = posture(person.joints, **degrees)
    return np.array([hand_force(person, q, tuple(direction), joints) for direction in directions.tolist()])
