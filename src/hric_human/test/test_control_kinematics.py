"""Own weight, kinematics and inverse kinematics of a body against pinocchio and against themselves."""

import math

import numpy as np
import pinocchio
import pytest
from bodies import NAMES, PARTS, body
from numpy.testing import assert_allclose

from hric_core.geometry import Pose
from hric_core.geometry.poses import difference
from hric_core.native import load
from hric_core.urdf import read
from hric_human.body import Body
from hric_human.body.joints import ARM
from hric_human.control.human_control import resting_posture
from hric_human.control.inverse_kinematics import HandSolver, OutOfReachError
from hric_human.control.kinematics import HandChain, own_weight


class Oracle:
    """A body fixed to the world, by pinocchio, with joints in the body's order."""

    def __init__(self, body: Body) -> None:
        self.model = pinocchio.buildModelFromXML(body.urdf)
        self.data = self.model.createData()
        self.order = [self.model.joints[self.model.getJointId(name)].idx_q for name in body.joints]

    def q(self, q: np.ndarray) -> np.ndarray:
        own = np.zeros(self.model.nq)
        own[self.order] = q
        return own


def random_q(body: Body, random: np.random.Generator) -> np.ndarray:
    return np.array([random.uniform(*joint.range) for joint in body.joints.values()])


def solver(body: Body, side: str, oriented: bool) -> HandSolver:
    low, high = zip(*(joint.range for joint in body.joints.values()), strict=True)
    return HandSolver(HandChain(body, side), low, high, resting_posture(body), oriented)


@pytest.mark.parametrize("parts", PARTS)
@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (3.0, -9.0, 1.0)])
def test_the_own_weight_is_that_of_an_independent_library(parts: str, gravity: tuple[float, float, float]) -> None:
    one = body(parts=parts)
    oracle, weight, random = Oracle(one), own_weight(one, gravity), np.random.default_rng(1)
    oracle.model.gravity.linear = np.array(gravity)
    for _ in range(10):
        q = random_q(one, random)
        expected = pinocchio.computeGeneralizedGravity(oracle.model, oracle.data, oracle.q(q))[oracle.order]
        assert_allclose(weight(q.tolist()), expected, atol=1e-12)


def test_a_load_in_the_hand_is_held_by_the_transposed_jacobian_of_its_weight() -> None:
    one, random = body(parts="both_arms"), np.random.default_rng(5)
    chain, mass, hand = HandChain(one, "left"), 2.5, one.segments["left_hand"].link
    own, loaded = own_weight(one), own_weight(one, loads={hand: mass})
    carried = read(one.urdf).links[hand].mass
    assert carried is not None
    for q in (random_q(one, random) for _ in range(20)):
        posed = chain.posed(q)
        expected = np.zeros(len(q))
        expected[chain.joints] = np.array(posed.velocities(posed.point(carried.com.tolist())))[:, 2] * mass * 9.81
        assert_allclose(np.subtract(loaded(q), own(q)), expected, atol=1e-9)


@pytest.mark.parametrize("parts", ["right_arm", "left_arm", "upper_body"])
def test_pose_and_velocities_of_a_hand_are_those_of_an_independent_library(parts: str) -> None:
    one = body(parts=parts)
    side = "left" if parts == "left_arm" else "right"
    chain, oracle, random = HandChain(one, side), Oracle(one), np.random.default_rng(2)
    frame = oracle.model.getFrameId(one.segments[f"{side}_hand"].link)
    for _ in range(10):
        q = random_q(one, random)
        J = pinocchio.computeFrameJacobian(oracle.model, oracle.data, oracle.q(q), frame, pinocchio.LOCAL_WORLD_ALIGNED)
        pinocchio.updateFramePlacements(oracle.model, oracle.data)
        T, p_link_hand = oracle.data.oMf[frame], np.array(chain.p_link_hand)
        pose = chain.pose(q.tolist())
        assert_allclose(pose.position, T.act(p_link_hand), atol=1e-14)
        assert_allclose(abs(np.dot(pose.orientation, pinocchio.Quaternion(T.rotation).coeffs())), 1.0, atol=1e-14)
        root = pinocchio.SE3.Random()
        placed, expected = chain.placed(q.tolist(), root.homogeneous), root.homogeneous @ T.homogeneous
        assert_allclose(placed[:, :3], expected[:, :3], atol=1e-14)
        assert_allclose(placed[:3, 3], root.act(T.act(p_link_hand)), atol=1e-14)
        columns = [oracle.order[index] for index in chain.joints]
        moved = J[:3] - np.cross(T.rotation @ p_link_hand, J[3:].T).T
        posed = chain.posed(q.tolist())
        assert_allclose(np.array(posed.velocities(pose.position)).T, moved[:, columns], atol=1e-13)
        assert_allclose(np.array(posed.axes).T, J[3:, columns], atol=1e-14)


@pytest.mark.parametrize("parts", ["right_arm", "upper_body"])
def test_the_compiled_arm_has_the_bits_of_the_chain(parts: str) -> None:
    one, hand = body(parts=parts), load("hric_human_kinematics").hand
    chain, random, n = HandChain(one, "right"), np.random.default_rng(4), len(ARM)
    pose, linear, axes = np.empty(7), np.empty((n, 3)), np.empty((n, 3))
    for scale in (1.0, 1e-9, 0.0):
        q = (scale * random_q(one, random)).tolist()
        arm, posed, expected = chain.numbers(q), chain.posed(q), chain.pose(q)
        hand(arm, pose, linear, axes, [q[index] for index in chain.arm])
        assert pose.tolist() == [*expected.position, *expected.orientation]
        assert linear.tolist() == [list(row) for row in posed.velocities(expected.position)[-n:]]
        assert axes.tolist() == [list(row) for row in posed.axes[-n:]]
    with pytest.raises(ValueError, match="do not fit together"):
        hand(arm, pose, linear, axes, [0.0])


@pytest.mark.parametrize("oriented", [False, True])
@pytest.mark.parametrize("name", NAMES)
def test_inverse_kinematics_gives_back_any_pose_that_the_joints_can_take(name: str, oriented: bool) -> None:
    one = body(name, "right_arm")
    chain, solve, random = HandChain(one, "right"), solver(one, "right", oriented), np.random.default_rng(3)
    low, high = np.array([joint.range for joint in one.joints.values()]).T
    for _ in range(15):
        target = chain.pose(random_q(one, random).tolist())
        q = np.array(solve.first(target))
        error = difference(chain.pose(q.tolist()), target)
        assert np.abs(error[:3]).max() < 1e-6
        assert not oriented or np.abs(error[3:]).max() < 1e-6
        assert (low <= q).all() and (q <= high).all()


def test_the_next_pose_is_found_from_the_last_one_and_the_posture_follows_smoothly() -> None:
    one = body(parts="upper_body")
    chain, solve = HandChain(one, "left"), solver(one, "left", False)
    x, y, z = chain.pose(resting_posture(one)).position
    q = solve.first(Pose((x, y, z)))
    assert_allclose(q, resting_posture(one), atol=1e-5)
    for k in range(1, 101):
        target = Pose((x + 1e-3 * k, y - 1e-3 * k, z + 1e-3 * k))
        after = solve.next(target, q)
        assert math.dist(chain.pose(after).position, target.position) < 1e-6
        assert np.abs(np.subtract(after, q)).max() < 0.02
        q = after
    others = [index for index in range(len(q)) if index not in chain.arm]
    assert [q[index] for index in others] == [resting_posture(one)[index] for index in others]


def test_what_is_out_of_reach_is_refused_with_its_distance_and_the_reach() -> None:
    one = body(parts="right_arm")
    chain, solve = HandChain(one, "right"), solver(one, "right", False)
    x, y, z = chain.shoulder(resting_posture(one))
    straight = [0.0] * 7
    assert math.dist(chain.pose(straight).position, (x, y, z)) == pytest.approx(chain.reach, abs=1e-12)
    with pytest.raises(OutOfReachError, match=rf"1.000 m from the right shoulder; valid: up to {chain.reach:.3f} m"):
        solve.first(Pose((x + 0.6, y, z + 0.8)))
    with pytest.raises(OutOfReachError, match=r"0.050 m from the right shoulder, is outside the ranges of the joints"):
        solve.first(Pose((x, y - 0.05, z)))
