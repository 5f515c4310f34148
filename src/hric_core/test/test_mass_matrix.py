"""Mass matrix and Jacobians of a description beside those of a rigid-body library."""

import numpy as np
import pinocchio
import pytest

from hric_core.urdf import read
from hric_core.urdf.mass_matrix import mass_matrix, point_jacobian

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


@pytest.mark.parametrize("seed", range(5))
def test_mass_matrix_and_jacobian_of_a_branched_tree_are_those_of_a_rigid_body_library(seed):
    robot, model = read(BRANCHED), pinocchio.buildModelFromXML(BRANCHED)
    data, x = model.createData(), np.random.default_rng(seed).uniform(-1.0, 1.0, model.nq)
    q = {name: x[model.joints[model.getJointId(name)].idx_q] for name in ("ja", "jb", "jd", "je")}
    M, rows = mass_matrix(robot, q)
    order = [model.joints[model.getJointId(name)].idx_v for name in rows]
    upper = np.triu(pinocchio.crba(model, data, x))
    expected = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
    np.testing.assert_allclose(M, expected, atol=1e-12)
    pinocchio.framesForwardKinematics(model, data, x)
    for link in ("d", "e", "c"):
        frame = model.getFrameId(link)
        J = pinocchio.computeFrameJacobian(model, data, x, frame, pinocchio.LOCAL_WORLD_ALIGNED)[:3, order]
        point = data.oMf[frame].translation
        np.testing.assert_allclose(point_jacobian(robot, q, link, point), J, atol=1e-12)
