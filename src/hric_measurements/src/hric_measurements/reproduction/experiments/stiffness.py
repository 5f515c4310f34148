"""Simulation of published stiffness of the elbow and of the hand."""

from collections.abc import Sequence

import numpy as np

from hric_core.geometry import FloatArray
from hric_measurements.reproduction.definition import DataSet
from hric_measurements.reproduction.experiments.person import AVERAGE_MAN, NO_GRAVITY, control, posture
from hric_measurements.reproduction.experiments.plant import ArmInPlant
from hric_measurements.reproduction.experiments.strength import PLANAR

STEP = 0.01
"""Displacement of a joint [rad]."""
HELD = 0.3
"""Time for which a displacement is held, longer than the delay of the senses [s]."""
PULL = 1.0
"""Force on the hand [N]; the displacement is about proportional to it."""
SETTLED = 4.0
"""Time after which the pulled hand is at rest [s]."""


def relaxed_elbow(data: DataSet) -> dict[str, float]:
    """Return the stiffness of the elbow of a supported arm at rest [N m/rad]."""
    subject = control(AVERAGE_MAN, NO_GRAVITY)
    index = subject.person.joints.index("right_el_flex")
    return {"stiffness": float(joint_stiffness(subject.person.rest, (index,))[0, 0])}


def planar_hand(data: DataSet) -> dict[str, float]:
    """Return the ratio of the largest to the smallest hand stiffness of a supported arm in the horizontal plane [1]."""
    person = control(AVERAGE_MAN, NO_GRAVITY).person
    q = posture(person.joints, **PLANAR)
    joints = tuple(person.joints.index(f"right_{name}") for name in ("sh_abd", "el_flex"))
    chain = person.hand.posed(q)
    columns = np.array(chain.velocities(chain.point(person.hand.p_link_hand)))
    inverse = np.linalg.inv(columns[[person.hand.joints.index(index) for index in joints], :2].T)
    return {"ratio": _ratio(inverse.T @ joint_stiffness(q, joints) @ inverse)}


def resting_hand(data: DataSet) -> dict[str, float]:
    """Return the ratio of the largest to the smallest stiffness of a resting hand in the horizontal plane [1]."""
    with ArmInPlant(control(AVERAGE_MAN)) as arm:
        still = arm.pulled((0.0, 0.0, 0.0), SETTLED)
        moved = [arm.pulled(force, SETTLED) - still for force in ((PULL, 0.0, 0.0), (0.0, PULL, 0.0))]
    return {"ratio": _ratio(np.asarray(np.linalg.inv(np.array(moved)[:, :2].T / PULL)))}


def joint_stiffness(q: Sequence[float], joints: Sequence[int]) -> FloatArray:
    """Return the stiffness of joints of a supported arm [N m/rad], from the torques of the displaced arm.

    Args:
        q: joint positions, n floats [rad].
        joints: indices of the joints, k of them.

    Returns:
        Stiffness, shape (k, k): change of torque, negative, of each joint (row) with the position of each (column).
    """
    desired = dict(zip(control(AVERAGE_MAN).person.joints, q, strict=True))

    def torque(displaced: int | None) -> FloatArray:
        subject, position = control(AVERAGE_MAN, NO_GRAVITY, [{"time": 0.0, **desired}]), list(q)
        if displaced is not None:
            position[displaced] += STEP
        still, tau = [0.0] * len(position), list[float]()
        for k in range(round(HELD / 1e-3)):
            tau = subject.update(1e-3 * k, position, still)
        return np.array(tau)[list(joints)]

    alone = torque(None)
    return np.stack([(alone - torque(index)) / STEP for index in joints], axis=1)


def _ratio(stiffness: FloatArray) -> float:
    """Return the ratio of the axes of a stiffness ellipse; stiffness: shape (2, 2) [N/m]."""
    low, high = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    return float(high / low)
