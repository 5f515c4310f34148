"""Preparing a description for the engine."""

from xml.etree import ElementTree

import pytest

import panda_description
from hric_control.plants.urdf_tree import parse_urdf
from pybullet_ros_control.pid import Pid, PidGains
from pybullet_ros_control.urdf_model import prepare


def test_rigid_clusters_become_one_link_and_keep_every_frame():
    model = prepare(parse_urdf(panda_description.load(meshes=False)), collision=False)
    links = [link.get("name") for link in ElementTree.fromstring(model.xml).findall("link")]
    assert links == ["world", *(f"panda_link{i}" for i in range(1, 8))]
    assert model.frames["panda_hand_tcp"].body_link == "panda_link7"
    assert model.frames["panda_hand_tcp"].T_body_frame[2, 3] == pytest.approx(0.107 + 0.1034)
    with_shapes = prepare(parse_urdf(panda_description.load(meshes=False)))
    assert with_shapes.base == "panda_link0"
    assert with_shapes.frames["panda_hand"].body_link == "panda_hand"
    assert with_shapes.group["panda_hand"] == "panda_link7"


def test_a_cylinder_with_a_ball_at_each_end_is_one_capsule():
    model = prepare(parse_urdf(panda_description.load(meshes=False)))
    shapes = [shape.find("geometry")[0] for shape in ElementTree.fromstring(model.xml).iter("collision")]
    kinds = [shape.tag for shape in shapes]
    assert "cylinder" not in kinds
    assert kinds.count("capsule") >= 14
    base = next(shape for shape in shapes if shape.tag == "capsule")
    assert (float(base.get("radius")), float(base.get("length"))) == pytest.approx((0.09, 0.095))


def test_visual_shapes_are_kept_for_a_window_only(tmp_path):
    urdf = panda_description.load(meshes=False)
    assert "<visual" not in prepare(parse_urdf(urdf)).xml
    assert "<visual" in prepare(parse_urdf(urdf), visual=True).xml


def test_a_pid_has_clamped_integral_and_effort():
    pid = Pid(PidGains.from_parameter({"p": 2.0, "i": 10.0, "d": 0.5, "i_clamp": 1.0}, "gains"), effort_limit=4.0)
    assert pid.effort(1.0, 0.01) == pytest.approx(2.0 + 0.1)
    assert pid.effort(0.9, 0.01) == pytest.approx(1.8 + 0.19 - 0.5 * 0.1 / 0.01)
    for _ in range(100):
        effort = pid.effort(0.9, 0.01)
    assert effort == pytest.approx(1.8 + 1.0)
    assert pid.effort(50.0, 0.01) == 4.0
    pid.reset()
    assert pid.effort(1.0, 0.01) == pytest.approx(2.1)
