"""What plants share: rigid transforms, files, worlds, parameters, the memory of stops, wrenches that end."""

import math
from typing import Any, ClassVar

import numpy as np
import pytest
import yaml

from hric_control.errors import HricError, ParameterError, UnknownNameError
from hric_control.plants.config import PlantConfig
from hric_control.plants.friction import JointLosses, sigmoid_torque
from hric_control.plants.masks import masked
from hric_control.plants.resources import resolve
from hric_control.plants.spatial import (
    MassProperties,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    rpy_from_rotation,
)
from hric_control.plants.stops import StopMemory
from hric_control.plants.surfaces import SLIP_VELOCITY, Surface, Surfaces, combine, friction_force, read_rules
from hric_control.plants.worlds import load_world
from hric_control.plants.wrenches import Wrenches


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_rotations_survive_every_writing(rng):
    for rpy in [*rng.uniform(-3.1, 3.1, (100, 3)), [0.3, np.pi / 2, 0.2], [0.1, -np.pi / 2, -0.4], [np.pi, 0, 0], [0, 0, np.pi]]:
        R = rotation_from_rpy(rpy)
        assert np.abs(rotation_from_rpy(rpy_from_rotation(R)) - R).max() < 1e-9
        assert np.abs(rotation_from_quaternion(quaternion_from_rotation(R)) - R).max() < 1e-12


def test_two_bodies_add_up_by_the_parallel_axis_theorem():
    # Two balls on a rod of length 2 a: I = 2 (I0 + m a^2) across, 2 I0 along.
    ball = MassProperties(1.5, np.zeros(3), 0.01 * np.eye(3))
    ends = [ball.moved(np.block([[np.eye(3), np.array([[s * 0.3], [0], [0]])], [np.zeros((1, 3)), np.ones((1, 1))]])) for s in (-1, 1)]
    both = ends[0] + ends[1]
    assert both.mass == 3.0
    assert both.inertia == pytest.approx(np.diag([0.02, 0.02 + 3 * 0.09, 0.02 + 3 * 0.09]))


def test_principal_moments_rebuild_the_tensor_also_where_it_is_not_physical(rng):
    for _ in range(50):
        half = rng.uniform(-1, 1, (3, 3))
        tensor = half + half.T
        moments, R = MassProperties(1.0, np.zeros(3), tensor).principal()
        assert np.linalg.det(R) == pytest.approx(1.0)
        again = rotation_from_rpy(rpy_from_rotation(R))
        assert np.abs(again @ np.diag(moments) @ again.T - tensor).max() < 1e-13


def test_files_are_found_by_path_and_by_address(tmp_path, monkeypatch):
    package = tmp_path / "space" / "some_package"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>some_package</name></package>")
    (package / "a b.yaml").write_text("x: 1")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "space"))
    for address in ("package://some_package/a b.yaml", f"file://{package}/a%20b.yaml", str(package / "a b.yaml")):
        assert resolve(address) == package / "a b.yaml"
    assert resolve("a b.yaml", package) == package / "a b.yaml"


@pytest.mark.parametrize(
    ("item", "message"),
    [
        ({"name": "a", "shape": "cone"}, "object a: shape: unknown 'cone'; valid: box, sphere, cylinder, capsule, plane, urdf"),
        ({"name": "a", "shape": "box", "colour": 1}, "object a: unknown key colour; valid: name, shape, size"),
        ({"name": "a", "shape": "box", "size": [1, 2]}, r"object a: size \(length, width, height\): must be 3 number"),
        ({"name": "a", "shape": "sphere", "size": -1}, "object a: size must be positive"),
        ({"name": "a", "shape": "sphere", "size": 1, "contact": "soft"}, "object a: contact: unknown 'soft'; valid: rigid, penalty"),
        ({"name": "a", "shape": "sphere", "size": 1, "stiffness": 5.0}, "object a: stiffness and damping need contact: penalty"),
        ({"name": "a", "shape": "sphere", "size": 1, "mass": "heavy"}, "object a: mass: must be a number of at least 0"),
        ({"name": "a", "shape": "sphere", "size": 1, "pose": {"x": 1}}, "object a: pose: unknown key x; valid: xyz, rpy"),
        ({"name": "a", "shape": "urdf", "urdf": "none.urdf"}, "no file .*none.urdf"),
        ({"shape": "box"}, "object 1 needs a name"),
    ],
)
def test_a_mistake_in_a_world_names_the_object_and_what_is_valid(tmp_path, item, message):
    path = tmp_path / "world.yaml"
    path.write_text(yaml.safe_dump({"objects": [item]}))
    with pytest.raises(HricError, match=message):
        load_world(str(path), 75000.0)


def test_other_mistakes_in_a_world_are_told(tmp_path):
    path = tmp_path / "world.yaml"
    for text, message in (
        ("objects: [", "not YAML"),
        ("things: []", "unknown key things; valid: objects"),
        ("objects: {a: 1}", "objects must be a list"),
        ("objects: [{name: a, shape: plane}, {name: a, shape: plane}]", "twice: a"),
    ):
        path.write_text(text)
        with pytest.raises(HricError, match=message):
            load_world(str(path), 75000.0)
    with pytest.raises(HricError, match="no file"):
        load_world(str(tmp_path / "absent.yaml"), 75000.0)


def test_a_plant_with_more_parameters_names_them_all():
    class More(PlantConfig):
        defaults: ClassVar[dict[str, Any]] = {**PlantConfig.defaults, "integrator": "accurate"}

    with pytest.raises(HricError, match=r"unknown parameter rotor; valid: .*integrator.*rotor_inertia"):
        More.from_parameters({"rotor": 1}, ["a"])
    assert PlantConfig.from_parameters({"rotor_inertia": {"b": 0.2}}, ["a", "b"]).rotor_inertia == (0.0, 0.2)


def test_a_stop_waits_until_the_joint_has_been_inside():
    stops = StopMemory([(-1.0, 1.0), (0.0, 2.0), (-math.inf, math.inf)])
    assert stops.place([1.5, -0.1, 9.0]) == {0, 1}
    assert stops.waiting == {0: (False, True), 1: (True, False)}
    assert stops.check([1.2, 0.5, 9.0]) == [1]
    assert stops.check([1.2, -0.5, 9.0]) == []
    assert stops.waiting == {0: (False, True)}
    assert stops.place([0.0, 1.0, 0.0]) == {0}
    assert stops.waiting == {}


def test_a_wrench_acts_for_its_steps_and_ends_by_link_or_model():
    wrenches = Wrenches(0.001)
    wrenches.add("arm::hand", [1, 0, 0], [0, 0, 0], [0, 0, 0], 0.002)
    wrenches.add("arm::elbow", [1, 0, 0], [0, 0, 0], [0, 0, 0], -1.0)
    wrenches.add("ball::link", [1, 0, 0], [0, 0, 0], [0, 0, 0], -1.0)
    wrenches.add("ball::link", [1, 0, 0], [0, 0, 0], [0, 0, 0], 0.0)
    assert len(wrenches.active) == 3
    for left in (3, 3, 2):
        assert len(wrenches.active) == left
        wrenches.count_step()
    wrenches.clear_link("arm::elbow")
    assert [w.body for w in wrenches.active] == ["ball::link"]
    wrenches.clear_model("ball")
    assert wrenches.active == []
    with pytest.raises(ParameterError, match=r"arm::hand: .*three finite numbers"):
        wrenches.add("arm::hand", [1, 0, math.nan], [0, 0, 0], [0, 0, 0], 1.0)


def test_compliant_surfaces_act_in_series_and_rigid_ones_add_nothing():
    soft, hard = Surface(2000.0, 5.0, 0.5), Surface(None, 0.0, 0.4)
    assert combine(hard, hard) is None
    assert combine(soft, hard) == (2000.0, 5.0, pytest.approx(0.2))
    assert combine(soft, Surface(6000.0, 7.0, 1.0)) == (pytest.approx(1500.0), 7.0, 0.5)


def test_friction_acts_against_the_sliding_and_fades_where_there_is_hardly_any():
    n = np.array([0.0, 0.0, 1.0])
    assert friction_force(12.0, 0.5, n, np.array([0.3, 0.0, -1.0])) == pytest.approx([6.0, 0.0, 0.0])
    assert friction_force(10.0, 0.5, n, np.array([0.5 * SLIP_VELOCITY, 0.0, 0.0])) == pytest.approx([2.5, 0.0, 0.0])


def test_a_later_rule_for_a_surface_goes_over_an_earlier_one_and_over_the_model():
    rules = read_rules(
        [
            {"link": "*::*", "friction": 0.1},
            {"link": "arm::*", "contact": "penalty", "damping": 3.0},
            {"link": "arm::hand", "contact": "penalty", "stiffness": 2e4, "friction": 0.7},
            {"link": "arm::base", "contact": "rigid"},
        ],
        75000.0,
        "plant/surfaces",
    )
    surfaces = Surfaces(rules)
    assert surfaces.of_model("arm", ["base", "elbow", "hand"], Surface()) == {
        "base": Surface(None, 0.0, 0.1),
        "elbow": Surface(75000.0, 3.0, 0.1),
        "hand": Surface(2e4, 0.0, 0.7),
    }
    assert surfaces.of_model("ball", ["link"], Surface(1e4, 2.0, 0.9)) == {"link": Surface(1e4, 2.0, 0.1)}


@pytest.mark.parametrize(
    ("items", "message"),
    [
        ({"arm::hand": {}}, "must be a list of mappings with link and any of contact, stiffness, damping, friction"),
        ([{"link": "hand"}], "link: must be model::link, each a name or a pattern such as"),
        ([{"link": "arm::hand", "kp": 1.0}], "arm::hand: unknown key kp; valid: link, contact, stiffness, damping, friction"),
        ([{"link": "arm::hand", "contact": "soft"}], "contact: unknown 'soft'; valid: rigid, penalty"),
        ([{"link": "arm::hand", "stiffness": 1.0}], "stiffness and damping need contact: penalty"),
        ([{"link": "arm::hand", "contact": "penalty", "stiffness": 0.0}], "stiffness: must be a number of at least"),
    ],
)
def test_a_wrong_rule_for_a_surface_is_refused_with_what_is_valid(items, message):
    with pytest.raises(ParameterError, match=f"plant/surfaces.*{message}"):
        read_rules(items, 75000.0, "plant/surfaces")


def test_a_rule_for_a_link_that_a_model_does_not_have_is_refused_with_its_links():
    surfaces = Surfaces(read_rules([{"link": "arm::hnad", "friction": 0.1}], 75000.0, "plant/surfaces"))
    assert surfaces.of_model("other", ["hand"], Surface()) == {"hand": Surface()}
    with pytest.raises(UnknownNameError, match="no link 'hnad' in plant/surfaces: arm::hnad; valid: base, hand"):
        surfaces.of_model("arm", ["base", "hand"], Surface())


def test_masks_match_in_either_order():
    masks = [("*_link1", "*_link3")]
    assert masked("a_link3", "b_link1", masks)
    assert not masked("a_link3", "b_link2", masks)


def test_friction_over_many_velocities_is_what_the_plant_takes_away_at_each(rng):
    phi, velocity = (0.62, 6.0, 0.03), rng.uniform(-2.0, 2.0, 50)
    losses = JointLosses([0.0], [phi])
    assert np.allclose(sigmoid_torque(velocity, phi), [-losses.subtract([0.0], [v])[0] for v in velocity], rtol=0.0, atol=1e-15)
