"""Gravity torques of a controller from the robot description, for robots that are no plain serial chain."""

import pytest
from controllers_rig import Rig

from hric_controllers.dynamics import gravity_source
from hric_core.errors import DescriptionError
from hric_core.local.node import LocalNode

LINK = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
LIMIT = "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='10' velocity='1'/>"


def test_a_joint_that_follows_the_arm_is_refused_as_its_weight_is_not_in_the_chain():
    joint = "<joint name='{0}' type='revolute'><parent link='{1}'/><child link='{2}'/>{3}{4}</joint>"
    robot = f"<robot name='r'><link name='a'/><link name='b'>{LINK}</link><link name='c'>{LINK}</link>"
    robot += joint.format("shoulder", "a", "b", LIMIT, "")
    robot += joint.format("elbow", "b", "c", LIMIT, "<mimic joint='shoulder' multiplier='-1'/>") + "</robot>"
    with pytest.raises(DescriptionError, match="elbow mimics shoulder, and its weight .* valid: gravity: false"):
        gravity_source(Rig(["shoulder"], False), LocalNode({"robot_description": robot}), ["shoulder"])
