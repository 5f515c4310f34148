"""Approach of the force controller on the simulated arm without a surface."""

import pytest
from arm_rig import ArmRig
from geometry_msgs.msg import Vector3, Wrench, WrenchStamped


def test_an_approach_without_a_surface_ends_and_another_force_begins_a_new_one(caplog):
    rig = ArmRig("force_controller", approach_distance=0.03, approach_speed=0.1, contact_force=1.0)
    start = rig.state.O_T_EE[14]
    rig.run(2.0)
    assert start - rig.state.O_T_EE[14] == pytest.approx(0.03, abs=0.005)
    assert max(map(abs, rig.state.dq)) < 0.01
    assert caplog.text.count("no surface: the arm moved by 0.030 m without contact") == 1
    rig.publish("desired_force", WrenchStamped(wrench=Wrench(force=Vector3(0.0, 0.0, 5.0))))
    rig.run(2.0)
    assert start - rig.state.O_T_EE[14] == pytest.approx(0.06, abs=0.01)
