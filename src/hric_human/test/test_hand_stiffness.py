"""Stiffness of the hand when it is pulled by a centimetre, compared with published stiffness of arms."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from bodies import body

from hric_core import plugins
from hric_core.geometry import FloatArray
from hric_human.control import HumanControl

ARM = body(parts="right_arm")
PULL = 0.01
"""Displacement by which the hand is pulled [m]."""
UPPER_ARM, FOREARM = 0.31, 0.34
"""Segment lengths of the arm in PMC2784227, table 1 [m]."""
RELAXED = np.array([[10.8, 2.83], [2.51, 8.67]])
"""Stiffness of shoulder and elbow of a relaxed arm (Gomi & Osu 1998; unconfirmed) [N m/rad]."""


def published(shoulder: float, elbow: float) -> tuple[float, float]:
    """Smallest and greatest stiffness of the hand of that two-joint arm, in its plane [N/m]; angles [deg]."""
    a, b = math.radians(shoulder), math.radians(shoulder + elbow)
    J = np.array(
        [
            [-UPPER_ARM * math.sin(a) - FOREARM * math.sin(b), -FOREARM * math.sin(b)],
            [UPPER_ARM * math.cos(a) + FOREARM * math.cos(b), FOREARM * math.cos(b)],
        ]
    )
    K = np.linalg.inv(J).T @ RELAXED @ np.linalg.inv(J)
    low, high = np.linalg.eigvalsh(0.5 * (K + K.T))
    return float(low), float(high)


POST = """<robot name="post"><link name="world"/><link name="knob"><inertial><mass value="1"/>
  <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="axle" type="continuous"><parent link="world"/><child link="knob"/><axis xyz="0 0 1"/></joint></robot>"""
"""A plant has a robot."""


def way(force: FloatArray) -> FloatArray:
    """Return the final displacement of a hand under a constant force, shape (3,) [m]."""
    plant = plugins.find(plugins.PLANT, "mujoco_ros_control/MujocoPlant")(POST, ["axle"], {})
    human = HumanControl(ARM, {}, 0)
    hand = human.person.hand
    plant.spawn("human", ARM.urdf, np.eye(4), fixed=True)
    plant.set_joints("human", human.posture)
    plant.apply_wrench("human::r_wrist", force.tolist(), (0.0, 0.0, 0.0), hand.p_link_hand, -1.0)
    q, dq = [0.0] * 7, [0.0] * 7
    for k in range(5000):
        plant.read_joints("human", q, dq)
        plant.drive_joints("human", human.update(1e-3 * k, q, dq))
        plant.apply([0.0])
        plant.step()
    plant.close()
    assert max(map(abs, dq)) < 1e-4
    return np.array(hand.pose(q).position) - hand.pose(human.posture).position


def pulled(direction: FloatArray) -> float:
    """Return the stiffness along a force that displaces the hand by about PULL [N/m]."""
    tried = 0.5
    force = tried * PULL / float(way(tried * direction) @ direction)
    gone = float(way(force * direction) @ direction)
    assert gone == pytest.approx(PULL, rel=0.2)
    return force / gone


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_hand_that_is_pulled_by_a_centimetre_is_as_stiff_as_arms_are(
    axis: str, figure: Callable[[str, float, str], None]
) -> None:
    stiffness = pulled(np.eye(3)["xyz".index(axis)])
    figure(f"stiffness of the hand along {axis}", stiffness, "N/m")
    for shoulder, elbow in ((45.0, 90.0), (30.0, 110.0), (60.0, 60.0)):
        low, high = published(shoulder, elbow)
        figure(f"arm of PMC2784227, relaxed, shoulder {shoulder:g} elbow {elbow:g} deg: least", low, "N/m")
        figure(f"arm of PMC2784227, relaxed, shoulder {shoulder:g} elbow {elbow:g} deg: greatest", high, "N/m")
    assert 30.0 < stiffness < 800.0
