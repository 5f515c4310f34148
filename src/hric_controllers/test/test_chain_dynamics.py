"""Gravity torques of a controller from the robot description, for robots that are no plain serial chain."""

import pytest
from controllers_rig import Rig

from hric_controllers.dynamics import gravity_source
from hric_core.errors import DescriptionError
from hric_core.local.node import LocalNode

LINK = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
LIMIT = "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='10' velocity='1'/>"


JOINT = "<joint name='{0}' type='revolute'><parent link='{1}'/><child link='{2}'/>{3}{4}</joint>"
LINKS = f"<link name='a'/><link name='b'>{LINK}</link><link name='c'>{LINK}</link>"


def robot(mimic):
    """Return a node with a description of two joints one after the other."""
    joints = JOINT.format("shoulder", "a", "b", LIMIT, "") + JOINT.format("elbow", "b", "c", LIMIT, mimic)
    return LocalNode({"robot_description": f"<robot name='r'>{LINKS}{joints}</robot>"})


def test_the_source_of_gravity_names_joints_that_are_taken_as_fixed():
    _, source = gravity_source(Rig(["shoulder"], False), robot(""), ["shoulder"])
    assert source == "KDL from robot_description, with elbow at 0"


def test_a_joint_that_follows_the_arm_is_refused_as_its_weight_is_not_in_the_chain():
    node = robot("<mimic joint='shoulder' multiplier='-1'/>")
    with pytest.raises(DescriptionError, match=r"elbow mimics shoulder, and its weight .* valid: gravity: false"):
        gravity_source(Rig(["shoulder"], False), node, ["shoulder"])
