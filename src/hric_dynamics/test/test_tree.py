"""Dynamics of a robot description, and distances of its links, against the libraries pinocchio and coal."""

import coal
import numpy as np
import pinocchio
import pytest

from hric_core.errors import HricError
from hric_core.urdf import read
from hric_dynamics.tree import Tree

LINK = """<link name="{0}"><inertial><origin xyz="0.1 -0.05 0.2" rpy="0.3 0.1 -0.4"/><mass value="{1}"/>
<inertia ixx="0.02" ixy="0.001" ixz="-0.002" iyy="0.03" iyz="0.003" izz="0.025"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>
<origin xyz="0.1 0.2 0.3" rpy="0.5 -0.2 1"/>
<axis xyz="{4}"/><limit lower="-2" upper="2" effort="9" velocity="9"/></joint>"""
BRANCHED = "".join(
    (
        '<robot name="branched"><link name="base"/>',
        *(LINK.format(name, 1.0 + at) for at, name in enumerate("abcde")),
        JOINT.format("ja", "revolute", "base", "a", "0 0 1"),
        JOINT.format("jb", "prismatic", "a", "b", "0.6 0 0.8"),
        JOINT.format("jc", "fixed", "b", "c", "1 0 0"),
        JOINT.format("jd", "revolute", "c", "d", "0 1 0"),
        JOINT.format("je", "revolute", "a", "e", "0 0.6 0.8"),
        "</robot>",
    )
)
JOINTS = ("je", "ja", "jd", "jb")


class Oracle:
    """Branched robot in pinocchio at a random state, with its joints in the order of JOINTS."""

    def __init__(self, seed: int) -> None:
        self.model = pinocchio.buildModelFromXML(BRANCHED)
        self.data = self.model.createData()
        self.order = [self.model.joints[self.model.getJointId(name)].idx_v for name in JOINTS]
        self.q, self.dq, self.ddq = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, self.model.nq))

    def ours(self, values: np.ndarray) -> list[float]:
        return values[self.order].tolist()


@pytest.fixture(params=range(5))
def oracle(request: pytest.FixtureRequest) -> Oracle:
    return Oracle(request.param)


def test_the_mass_matrix_of_a_branched_tree_is_that_of_a_rigid_body_library(oracle: Oracle) -> None:
    upper = np.triu(pinocchio.crba(oracle.model, oracle.data, oracle.q))
    expected = (upper + np.triu(upper, 1).T)[np.ix_(oracle.order, oracle.order)]
    found = Tree(read(BRANCHED), JOINTS).mass_matrix(oracle.ours(oracle.q))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_poses_and_jacobians_are_those_of_a_rigid_body_library(oracle: Oracle) -> None:
    tree, q = Tree(read(BRANCHED), JOINTS), oracle.ours(oracle.q)
    pinocchio.computeJointJacobians(oracle.model, oracle.data, oracle.q)
    pinocchio.framesForwardKinematics(oracle.model, oracle.data, oracle.q)
    for link in ("d", "e", "c"):
        frame = oracle.model.getFrameId(link)
        J = pinocchio.getFrameJacobian(oracle.model, oracle.data, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:, oracle.order]
        T = oracle.data.oMf[frame]
        np.testing.assert_allclose(tree.point_jacobian(q, link, T.translation), J[:3], atol=1e-12)
        pose = np.array(tree.bodies.pose(q, tree.index[link])).reshape(3, 4)
        np.testing.assert_allclose(pose, T.homogeneous[:3], atol=1e-12)
    assert not tree.point_jacobian(q, "base", (1.0, 2.0, 3.0)).any()


def test_gravity_and_inverse_dynamics_are_those_of_a_rigid_body_library(oracle: Oracle) -> None:
    bodies, gravity = Tree(read(BRANCHED), JOINTS).bodies, (1.0, -2.0, -9.0)
    q, dq, ddq = (oracle.ours(values) for values in (oracle.q, oracle.dq, oracle.ddq))
    oracle.model.gravity.linear = np.array(gravity)
    held = pinocchio.computeGeneralizedGravity(oracle.model, oracle.data, oracle.q)
    moved = pinocchio.rnea(oracle.model, oracle.data, oracle.q, oracle.dq, oracle.ddq)
    np.testing.assert_allclose(bodies.gravity(q, gravity), oracle.ours(held), atol=1e-12)
    np.testing.assert_allclose(bodies.inverse_dynamics(q, dq, ddq, gravity), oracle.ours(moved), atol=1e-12)


def test_distances_of_capsules_on_the_links_are_those_of_a_collision_library(oracle: Oracle) -> None:
    random, tree = np.random.default_rng(7), Tree(read(BRANCHED), JOINTS)
    pinocchio.framesForwardKinematics(oracle.model, oracle.data, oracle.q)
    rows, placed = [], []
    for link in ("base", "a", "d", "e", "e"):
        radius, half = random.uniform(0.01, 0.1), random.uniform(0.0, 0.2) if len(rows) < 4 else 0.0  # the last: a ball
        middle, along = random.uniform(-0.3, 0.3, 3), np.linalg.qr(random.normal(size=(3, 3)))[0]
        along[:, 0] *= np.linalg.det(along)
        ends = middle - half * along[:, 2], middle + half * along[:, 2]
        rows.append([tree.index[link], *ends[0], *ends[1], radius])
        T = oracle.data.oMf[oracle.model.getFrameId(link)].homogeneous
        pose = coal.Transform3s(T[:3, :3] @ along, T[:3, :3] @ middle + T[:3, 3])
        placed.append((coal.Capsule(radius, 2.0 * half), pose))
    pairs = [(i, j) for i in range(5) for j in range(i)]
    distances = np.empty(len(pairs))
    tree.bodies.capsule_distances(oracle.ours(oracle.q), np.array(rows), np.array(pairs, float), distances)
    request = coal.DistanceRequest()
    expected = [coal.distance(*placed[i], *placed[j], request, coal.DistanceResult()) for i, j in pairs]
    np.testing.assert_allclose(distances, expected, atol=1e-5)


@pytest.mark.parametrize("pair", [(0.0, 2.0), (-1.0, 0.0), (np.nan, 0.0)])
def test_a_capsule_that_does_not_exist_is_refused(pair: tuple[float, float]) -> None:
    tree, rows = Tree(read(BRANCHED), JOINTS), np.zeros((2, 8))
    with pytest.raises(IndexError, match="there are 2 capsules"):
        tree.bodies.capsule_distances([0.0] * 4, rows, np.array([pair]), np.empty(1))


def test_joints_that_do_not_move_are_at_zero() -> None:
    robot, every = read(BRANCHED), Tree(read(BRANCHED), JOINTS)
    some = Tree(robot, ("ja", "jd"))
    expected = every.mass_matrix([0.0, 0.3, -0.4, 0.0])[np.ix_((1, 2), (1, 2))]
    np.testing.assert_allclose(some.mass_matrix([0.3, -0.4]), expected, atol=1e-14)


def test_a_joint_that_is_fixed_is_refused_by_name() -> None:
    with pytest.raises(HricError, match=r"jc.*valid: ja, jb, jd, je"):
        Tree(read(BRANCHED), ("ja", "jc"))
