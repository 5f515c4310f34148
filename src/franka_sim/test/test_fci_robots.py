"""The descriptions of the two robots."""

from xml.etree import ElementTree

import numpy as np
import pytest

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.limits import fr3_limits, franka_limits
from franka_sim.fci.robots import ROBOTS, fr3_served_urdf, fr3_urdf
from franka_sim.settings import Q_START


def test_the_served_fr3_has_what_libfranka_needs_of_it() -> None:
    root = ElementTree.fromstring(fr3_served_urdf())
    assert root.get("name") == "fr3"
    joints = {joint.get("name"): joint for joint in root.iterfind("joint")}
    for i in range(1, 8):
        joint = joints[f"joint{i}"]
        limit, bound = joint.find("limit"), joint.find("position_based_velocity_limits")
        assert limit is not None and {"lower", "upper", "velocity"} <= set(limit.attrib)
        assert bound is not None and {"velocity_offset", "deceleration_limit"} <= set(bound.attrib)
    links = [link.get("name") for link in root.iterfind("link")]
    assert "link8" in links and not any(
        name is None or "hand" in name or "finger" in name or name.startswith("fr3") for name in links
    )
    assert not root.findall("transmission") and not root.findall("gazebo")


def test_the_fr3_has_its_own_limits_in_description_and_box() -> None:
    limits = fr3_limits()
    root = ElementTree.fromstring(fr3_urdf())
    joints = {joint.get("name"): joint for joint in root.iterfind("joint")}
    for i in range(7):
        joint = joints[f"fr3_joint{i + 1}"]
        limit = joint.find("limit")
        assert limit is not None
        assert [float(limit.attrib[name]) for name in ("lower", "upper", "velocity", "effort")] == [
            limits.lower[i],
            limits.upper[i],
            limits.velocity[i],
            limits.effort[i],
        ]
    assert limits != franka_limits() and limits.translation.velocity == 3.0


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_usual_start_is_within_the_limits(name: str) -> None:
    limits = ROBOTS[name].limits()
    assert all(low < q < high for low, q, high in zip(limits.lower, Q_START, limits.upper, strict=True))


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_the_served_arm_is_the_emulated_one_without_its_hand(name: str) -> None:
    robot = ROBOTS[name]
    whole = KdlFrankaModel(robot.urdf(True, False), robot.arm_id)
    bare = KdlFrankaModel(robot.urdf(False, False), robot.arm_id)
    bare.set_load(whole.ee_inertial.mass, whole.ee_inertial.com, whole.ee_inertial.inertia.flatten())
    np.testing.assert_allclose(bare.gravity(Q_START), whole.gravity(Q_START), atol=1e-12)
    np.testing.assert_allclose(bare.mass(Q_START), whole.mass(Q_START), atol=1e-12)
