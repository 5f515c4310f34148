"""Where the links and markers of a whole body are, and what the floor carries, against pinocchio."""

import numpy as np
import pinocchio
import pytest
from bodies import NAMES, PARTS, body
from numpy.testing import assert_allclose

from hric_core.errors import HricError
from hric_core.geometry import Pose, from_rotation_vector
from hric_core.geometry.transforms import rotation_from_quaternion
from hric_human.body import Body
from hric_human.control.whole_body import ExternalLoad, RootMotion, WholeBody, floor_wrench

ROOT = Pose((0.85, -0.2, 0.3), from_rotation_vector((0.0, 0.0, 2.5)))
GRAVITY = np.array([0.0, 0.0, -9.81])


class OnAFreeBase:
    """A body by pinocchio, whose root is on a free-flyer joint at ROOT, with joints in the body's order."""

    def __init__(self, body: Body) -> None:
        self.model = pinocchio.buildModelFromXML(body.urdf, pinocchio.JointModelFreeFlyer())
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(name)] for name in body.joints]
        self._q, self.columns = [joint.idx_q for joint in joints], [joint.idx_v for joint in joints]

    def q(self, q: np.ndarray) -> np.ndarray:
        own = np.zeros(self.model.nq)
        own[:3], own[3:7], own[self._q] = ROOT.position, ROOT.orientation, q
        return own

    def v(self, values: np.ndarray) -> np.ndarray:
        own = np.zeros(self.model.nv)
        own[self.columns] = values
        return own


def random_state(body: Body, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, dq, ddq."""
    q = np.array([random.uniform(*joint.range) for joint in body.joints.values()])
    return q, random.uniform(-5.0, 5.0, len(q)), random.uniform(-50.0, 50.0, len(q))


@pytest.mark.parametrize("parts", PARTS)
def test_links_and_markers_are_where_an_independent_library_has_them(parts: str) -> None:
    one = body(parts=parts)
    whole, oracle, random = WholeBody(one), OnAFreeBase(one), np.random.default_rng(1)
    for _ in range(5):
        q, _, _ = random_state(one, random)
        pinocchio.framesForwardKinematics(oracle.model, oracle.data, oracle.q(q))
        poses = whole.poses(q.tolist(), ROOT)
        for segment in one.segments.values():
            T, pose = oracle.data.oMf[oracle.model.getFrameId(segment.link)], poses[segment.link]
            assert_allclose(pose.position, T.translation, atol=1e-13)
            assert_allclose(rotation_from_quaternion(pose.orientation), T.rotation, atol=1e-13)
        markers = whole.markers(poses)
        assert list(markers) == list(one.markers)
        for name, marker in one.markers.items():
            T = oracle.data.oMf[oracle.model.getFrameId(marker.link)]
            assert_allclose(markers[name], T.act(marker.p_link_marker), atol=1e-13)


@pytest.mark.parametrize("parts", PARTS)
def test_the_floor_carries_what_inverse_dynamics_asks_of_a_free_base_and_the_rest_of_the_subject(parts: str) -> None:
    one = body(parts=parts)
    whole, oracle, random = WholeBody(one), OnAFreeBase(one), np.random.default_rng(2)
    for _ in range(10):
        q, dq, ddq = random_state(one, random)
        tau = pinocchio.rnea(oracle.model, oracle.data, oracle.q(q), oracle.v(dq), oracle.v(ddq))
        R = rotation_from_quaternion(ROOT.orientation)
        rest = (one.subject.mass - one.total_mass) * GRAVITY
        force = -R @ tau[:3] + rest
        torque = -R @ tau[3:6] + np.cross(ROOT.position, force)
        found = floor_wrench(whole, q.tolist(), dq.tolist(), ddq.tolist(), ROOT)
        assert_allclose(found, [*force, *torque], rtol=1e-11, atol=1e-9)


@pytest.mark.parametrize("parts", PARTS)
def test_a_motion_with_loads_on_links_needs_what_an_independent_library_says(parts: str) -> None:
    one = body(parts=parts)
    whole, oracle, random = WholeBody(one), OnAFreeBase(one), np.random.default_rng(3)
    links = [segment.link for segment in one.segments.values()][-2:]
    loads = [
        ExternalLoad(link, *random.uniform(-30.0, 30.0, (2, 4, 3)), random.uniform(-1.0, 1.0, (4, 3))) for link in links
    ]
    states = [random_state(one, random) for _ in range(4)]
    q, dq, ddq = (np.array(rows) for rows in zip(*states, strict=True))
    found = whole.inverse_dynamics(q, dq, ddq, ROOT, loads)
    for t in range(4):
        pinocchio.forwardKinematics(oracle.model, oracle.data, oracle.q(q[t]))
        acting = pinocchio.StdVec_Force([pinocchio.Force.Zero() for _ in range(oracle.model.njoints)])
        for load in loads:
            joint = oracle.model.frames[oracle.model.getFrameId(load.link)].parentJoint
            torque = load.torque[t] + np.cross(load.point[t], load.force[t])
            acting[joint] += oracle.data.oMi[joint].actInv(pinocchio.Force(load.force[t], torque))
        tau = pinocchio.rnea(oracle.model, oracle.data, oracle.q(q[t]), oracle.v(dq[t]), oracle.v(ddq[t]), acting)
        assert_allclose(found.torque[t], tau[oracle.columns], rtol=1e-11, atol=1e-9)
        for link, at in whole.index.items():
            frame = oracle.model.frames[oracle.model.getFrameId(link)]
            T = oracle.data.oMi[frame.parentJoint]
            assert_allclose(found.rotation[t, at], T.rotation, atol=1e-12)
            if whole.links[at].axis != (0.0, 0.0, 0.0):
                force = oracle.data.f[frame.parentJoint]
                assert_allclose(found.position[t, at], T.translation, atol=1e-12)
                assert_allclose(found.force[t, at], T.rotation @ force.linear, rtol=1e-10, atol=1e-9)
                assert_allclose(found.moment[t, at], T.rotation @ force.angular, rtol=1e-10, atol=1e-9)


def test_a_root_that_moves_needs_what_an_independent_library_says() -> None:
    one = body(parts="upper_body")
    whole, oracle, random = WholeBody(one), OnAFreeBase(one), np.random.default_rng(4)
    states = [random_state(one, random) for _ in range(4)]
    q, dq, ddq = (np.array(rows) for rows in zip(*states, strict=True))
    omega, alpha, velocity, acceleration = random.uniform(-3.0, 3.0, (4, 4, 3))
    at_rest = RootMotion.at_rest(ROOT, 4)
    moving = at_rest._replace(omega=omega, alpha=alpha, acceleration=acceleration)
    found = whole.inverse_dynamics(q, dq, ddq, moving)
    R = rotation_from_quaternion(ROOT.orientation).T  # pinocchio has the root's velocity and its rate in its own axes
    for t in range(4):
        v, a = oracle.v(dq[t]), oracle.v(ddq[t])
        v[:3], v[3:6] = R @ velocity[t], R @ omega[t]
        a[:3], a[3:6] = R @ (acceleration[t] - np.cross(omega[t], velocity[t])), R @ alpha[t]
        tau = pinocchio.rnea(oracle.model, oracle.data, oracle.q(q[t]), v, a)
        assert_allclose(found.torque[t], tau[oracle.columns], rtol=1e-11, atol=1e-9)
    assert_allclose(
        whole.inverse_dynamics(q, dq, ddq, at_rest).torque, whole.inverse_dynamics(q, dq, ddq, ROOT).torque, atol=0.0
    )


def test_a_load_on_a_link_that_is_not_there_is_refused_by_name() -> None:
    whole, none = WholeBody(body(parts="right_arm")), np.zeros((1, 3))
    with pytest.raises(HricError, match="load on 'l_wrist', which is no link of the body; valid: r_shoulder"):
        whole.inverse_dynamics(*np.zeros((3, 1, 7)), ROOT, [ExternalLoad("l_wrist", none, none, none)])


@pytest.mark.parametrize("name", NAMES)
def test_the_floor_below_a_person_at_rest_carries_their_weight(name: str) -> None:
    one = body(name, "right_arm")
    n = len(one.joints)
    fx, fy, fz, *_ = floor_wrench(WholeBody(one), [0.3] * n, [0.0] * n, [0.0] * n, ROOT)
    assert (fx, fy, fz) == pytest.approx((0.0, 0.0, -9.81 * one.subject.mass), rel=1e-12)
