"""Preparation of a description for the engine."""

from xml.etree import ElementTree

import pytest

import panda_description
from hric_core.urdf import read
from pybullet_ros_control.urdf_model import prepare


def test_rigid_clusters_become_one_link_and_keep_every_frame():
    model = prepare(read(panda_description.load(meshes=False)), collision=False)
    links = [link.get("name") for link in ElementTree.fromstring(model.xml).findall("link")]
    assert links == ["world", *(f"panda_link{i}" for i in range(1, 8))]
    assert model.frames["panda_hand_tcp"].body_link == "panda_link7"
    assert model.frames["panda_hand_tcp"].T_body_frame[2, 3] == pytest.approx(0.107 + 0.1034)
    with_shapes = prepare(read(panda_description.load(meshes=False)))
    assert with_shapes.base == "panda_link0"
    assert with_shapes.frames["panda_hand"].body_link == "panda_hand"
    assert with_shapes.tops["panda_hand"].body_link == "panda_link7"


def test_a_cylinder_with_a_ball_at_each_end_is_one_capsule():
    model = prepare(read(panda_description.load(meshes=False)))
    shapes = [shape.find("geometry")[0] for shape in ElementTree.fromstring(model.xml).iter("collision")]
    kinds = [shape.tag for shape in shapes]
    assert "cylinder" not in kinds
    assert kinds.count("capsule") >= 14
    base = next(shape for shape in shapes if shape.tag == "capsule")
    assert (float(base.get("radius")), float(base.get("length"))) == pytest.approx((0.09, 0.095))


def test_visual_shapes_are_kept_for_a_window_only(tmp_path):
    urdf = panda_description.load(meshes=False)
    assert "<visual" not in prepare(read(urdf)).xml
    assert "<visual" in prepare(read(urdf), visual=True).xml
