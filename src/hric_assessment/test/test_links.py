"""Capsules of a description and where they are, beside closed forms and a rigid-body library."""

import math

import numpy as np
import pinocchio
import pytest

import panda_description
from hric_assessment.separation.capsules import CapsuleMotion, Capsules, capsules_of, moved_by, poses, speeds
from hric_core import urdf
from hric_core.geometry import homogeneous
from hric_core.geometry.transforms import rotation_from_rpy

SHAPES = """<robot name="shapes">
  <link name="base">
    <collision><origin xyz="0 0 1"/><geometry><sphere radius="0.1"/></geometry></collision>
    <collision><geometry><mesh filename="package://none/base.stl"/></geometry></collision>
    <collision><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/>
      <geometry><cylinder radius="0.2" length="0.6"/></geometry></collision>
  </link>
  <link name="slide">
    <collision><origin xyz="0 0 0.5"/><geometry><box size="0.2 0.4 0.1"/></geometry></collision>
  </link>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="slide"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""


def test_capsules_hold_balls_cylinders_and_boxes_and_meshes_are_named() -> None:
    found, left_out = capsules_of(urdf.read(SHAPES), ["base", "slide"])
    assert (found.links, left_out) == (("base", "base", "slide"), ["base"])
    np.testing.assert_allclose(found.radii, [0.1, 0.2, 0.5 * math.hypot(0.2, 0.1)])
    ball, cylinder, box = found.ends
    np.testing.assert_allclose(ball, [[0, 0, 1], [0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(cylinder, [[0.7, 0, 0], [1.3, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(box, [[0, -0.2, 0.5], [0, 0.2, 0.5]], atol=1e-12)


def test_a_link_with_a_mass_and_without_a_shape_is_named() -> None:
    inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    extra = "".join(
        f"<link name='{name}'>{inside}</link><joint name='to_{name}' type='fixed'><parent link='slide'/>"
        f"<child link='{name}'/></joint>"
        for name, inside in (("frame", ""), ("tool", inertial))
    )
    tree = urdf.read(SHAPES.replace("</robot>", f"{extra}</robot>"))
    assert capsules_of(tree, ["slide", "frame", "tool"])[1] == ["tool"]


def test_no_links_have_no_capsules() -> None:
    found, left_out = capsules_of(urdf.read(SHAPES), [])
    assert (found.ends.shape, found.radii.shape, left_out) == ((0, 2, 3), (0,), [])


def test_a_joint_moves_all_links_beyond_it_and_no_other() -> None:
    tree = urdf.read(panda_description.load(hand=True))
    moved = moved_by(tree, ["panda_joint6"])
    assert moved[:2] == ["panda_link6", "panda_link7"] and "panda_leftfinger" in moved
    assert not {"panda_link0", "panda_link5"} & set(moved)
    assert moved_by(tree, []) == []


def test_links_are_where_a_rigid_body_library_has_them() -> None:
    description = panda_description.load(hand=True)
    model = pinocchio.buildModelFromXML(description)
    data, random = model.createData(), np.random.default_rng(2)
    joints = [f"panda_joint{k}" for k in range(1, 8)]
    q = random.uniform(-1.0, 1.0, (3, 7))
    T_world_root = np.stack([homogeneous(rotation_from_rpy(rpy), p) for rpy, p in random.normal(size=(3, 2, 3))])
    found = poses(urdf.read(description), joints, q, T_world_root)
    for row in range(3):
        x = pinocchio.neutral(model)
        x[[model.joints[model.getJointId(name)].idx_q for name in joints]] = q[row]
        pinocchio.framesForwardKinematics(model, data, x)
        for link in ("panda_link0", "panda_link1", "panda_link7", "panda_leftfinger"):
            expected = T_world_root[row] @ data.oMf[model.getFrameId(link)].homogeneous
            np.testing.assert_allclose(found[link][row], expected, atol=1e-9, err_msg=link)


def test_between_two_samples_a_joint_moves_evenly() -> None:
    tree, capsules = urdf.read(SHAPES), Capsules(("slide",), np.array([[[0.0, 0, 0], [1, 0, 0]]]), np.array([0.1]))
    time, q = np.array([0.0, 1.0, 3.0]), np.array([[0.0], [0.4], [0.0]])
    ends = CapsuleMotion(tree, capsules, ["rail"], time, q)(np.array([0.5, 1.0, 2.5]))
    np.testing.assert_allclose(ends[:, 0, 0, 1], [0.2, 0.4, 0.1], atol=1e-12)
    np.testing.assert_allclose(ends[:, 0, 1, 0], 1.0)


@pytest.mark.parametrize("block", [2, 2000])
def test_the_speed_is_that_of_the_fastest_end_on_its_circle(block: int) -> None:
    """Ends of 0.3 m and 0.5 m from an axis about which they turn by 2 rad/s, and one that stands."""

    def ends(time: np.ndarray) -> np.ndarray:
        on_circle = np.stack([np.cos(2.0 * time), np.sin(2.0 * time), 0.0 * time], axis=-1)
        turning = np.stack([0.3 * on_circle, 0.5 * on_circle], axis=1)
        return np.stack([0.0 * turning, turning], axis=1)

    np.testing.assert_allclose(speeds(ends, np.linspace(0.0, 1.0, 5), block), 1.0, rtol=1e-5)
