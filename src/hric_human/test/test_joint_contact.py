"""Contact forces in joints: closed forms here, OpenSim's JointReaction in test_arm26.py."""

import numpy as np
import pytest
from bodies import body

from hric_core.errors import HricError
from hric_core.geometry import Pose, from_rotation_vector
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.control.whole_body import ExternalLoad, WholeBody
from hric_human.muscles.anatomy import BUILT_IN, Anatomy, Muscle, load
from hric_human.muscles.joint_contact import JointContact, Pulls
from hric_human.muscles.polynomial import Polynomial

ROOT = Pose((0.4, -0.2, 1.1), from_rotation_vector((0.0, 0.0, 0.7)))
JOINTS = ("sh_flex", "sh_abd", "sh_rot", "el_flex", "pro_sup")
Q, DQ, DDQ = (
    [0.6, 0.3, -0.2, 1.1, 0.2, 0.1, 0.0],
    [0.5, -1.0, 0.3, 2.0, 0.0, 0.4, 0.1],
    [3.0, -2.0, 1.0, 5.0, 1.0, 0.0, 0.0],
)


def anatomy() -> Anatomy:
    """One muscle across the shoulder that pulls up and to the right, along z and y of the torso."""
    length, x, y, z = (Polynomial(("sh_flex",), 0, (value,)) for value in (0.2, 0.0, -0.6, 0.8))
    muscle = Muscle("puller", 100.0, 0.1, 0.1, length, {"shoulder": (x, y, z)}, ())
    return Anatomy("one", JOINTS, (-3.0,) * 5, (3.0,) * 5, {"puller": muscle}, {}, "", {})


def test_a_muscle_that_carries_the_whole_arm_unloads_the_joint_by_as_much() -> None:
    whole = WholeBody(body(parts="right_arm"))
    contact = JointContact(whole, anatomy(), ["right_puller"])
    weight = 9.81 * whole.body.total_mass
    rest = [0.0] * 7
    assert contact.at(rest, rest, rest, np.zeros(1), ROOT)["right_shoulder"] == pytest.approx((0.0, 0.0, weight))
    _, _, z = contact.at(rest, rest, rest, np.array([weight / 0.8]), ROOT)["right_shoulder"]
    assert z == pytest.approx(0.0, abs=1e-9)


def test_a_muscle_adds_the_opposite_of_its_pull_in_axes_of_the_torso() -> None:
    one = body(parts="upper_body")
    whole = WholeBody(one)
    contact = JointContact(whole, anatomy(), ["right_puller", "left_puller"])
    n = len(one.joints)
    q = [0.0] * n
    q[0], q[2] = 0.4, 0.5  # trunk forward, then turned
    without = contact.at(q, [0.0] * n, [0.0] * n, np.zeros(2), ROOT)
    found = contact.at(q, [0.0] * n, [0.0] * n, np.array([50.0, 30.0]), ROOT)
    R = rotation_from_quaternion(whole.poses(q, ROOT)["torso"].orientation)
    for side, pull in (("right", (0.0, -30.0, 40.0)), ("left", (0.0, 18.0, 24.0))):
        change = np.subtract(found[f"{side}_shoulder"], without[f"{side}_shoulder"])
        assert change == pytest.approx(-R @ pull, abs=1e-9)
        assert found[f"{side}_elbow"] == pytest.approx(without[f"{side}_elbow"])


def test_a_load_in_the_hand_is_carried_by_all_joints_before_it() -> None:
    whole = WholeBody(body(parts="right_arm"))
    contact = JointContact(whole, anatomy(), ["right_puller"])
    load = ExternalLoad("r_wrist", np.array([[3.0, -4.0, -49.0]]), np.zeros((1, 3)), np.array([[0.5, 0.1, 0.9]]))
    without = contact.at(Q, DQ, DDQ, np.zeros(1), ROOT)
    found = contact.at(Q, DQ, DDQ, np.zeros(1), ROOT, [load])
    for name in ("right_shoulder", "right_elbow"):
        assert np.subtract(found[name], without[name]) == pytest.approx(-load.force[0])


def test_a_left_arm_is_the_mirror_image_of_the_right_one() -> None:
    whole = WholeBody(body(parts="both_arms"))
    built_in = load(BUILT_IN)
    names = [f"{side}_{name}" for side in ("right", "left") for name in built_in.muscles]
    forces = np.tile(np.linspace(20.0, 200.0, len(built_in.muscles)), 2)
    found = JointContact(whole, built_in, names).at(2 * Q, 2 * DQ, 2 * DDQ, forces, Pose())
    for centre in ("shoulder", "elbow"):
        x, y, z = found[f"right_{centre}"]
        assert found[f"left_{centre}"] == pytest.approx((x, -y, z))
        assert np.linalg.norm((x, y, z)) > 500.0


def test_all_pulls_at_once_are_the_polynomials_of_each_muscle() -> None:
    built_in = load(BUILT_IN)
    pulls, q = Pulls(built_in), np.random.default_rng(4).uniform(built_in.lower, built_in.upper, (20, 5))
    for centre, found in pulls.at(q).items():
        for k, name in enumerate(pulls.names[centre]):
            for axis, part in enumerate(built_in.muscles[name].pulls[centre]):
                own = q[:, [built_in.joints.index(joint) for joint in part.joints]]
                assert found[:, k, axis] == pytest.approx(part.values(own), abs=1e-12)


def test_a_muscle_without_a_force_is_refused_by_name() -> None:
    with pytest.raises(HricError, match="force of muscle right_puller; available: right_other"):
        JointContact(WholeBody(body(parts="right_arm")), anatomy(), ["right_other"])
