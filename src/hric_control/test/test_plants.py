"""Common parts of plants: files, worlds, parameters, joint stops, wrenches that end."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
import yaml

from hric_control.plant import Mode, Surface
from hric_control.plants import (
    ContactLaw,
    Losses,
    MovingJoints,
    PlantConfig,
    StopMemory,
    Surfaces,
    Wrenches,
    combine,
    load_world,
    masked,
    reciprocals,
    rotor_inertia,
    sigmoid_torque,
)
from hric_core.errors import HricError, ParameterError, UnknownNameError
from hric_core.parameters import number
from hric_core.resources import resolve
from hric_core.urdf import read


@pytest.fixture
def rng():
    return np.random.default_rng(0)


FOLLOWERS = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
<joint name="free" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="led" type="continuous"><parent link="b"/><child link="c"/>
<mimic joint="lead" multiplier="-2" offset="0.1"/></joint>
<joint name="lead" type="continuous"><parent link="c"/><child link="d"/></joint></robot>"""


def test_a_joint_that_mimics_another_starts_on_its_law_and_is_never_held_by_itself():
    joints = MovingJoints(list(read(FOLLOWERS).joints.values()), ["lead"], "r")
    assert joints.start([0.3], [0.4], [0.7, 9.0, 9.0]) == ([0.7, pytest.approx(-0.5), 0.3], [0.0, -0.8, 0.4])
    assert joints.law_jacobian().tolist() == [[1.0, 0.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, 1.0]]
    modes = joints.modes([Mode.POSITION], [True], locked=True)
    assert modes == [Mode.BRAKE, Mode.EFFORT, Mode.BRAKE]


DRIVEN = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/></joint>
<transmission><joint name="j"/><actuator><drake:rotor_inertia value="0.6"/></actuator></transmission></robot>"""


@pytest.mark.parametrize(
    ("plant", "inertia"), [({}, (0.6, 0.1)), ({"rotor_inertia": 0.2}, (0.2, 0.2)), ({"rotor_inertia": {}}, (0.0, 0.0))]
)
def test_a_parameter_overrides_the_described_rotor(plant, inertia):
    assert rotor_inertia(plant, ["j", "k"], read(DRIVEN)) == inertia


def test_a_joint_that_cannot_move_meets_its_stop_without_a_force():
    assert reciprocals([4.0, 0.0, -1e-17]) == [0.25, 0.0, 0.0]


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
        (
            {"name": "a", "shape": "cone"},
            r"objects\[a\].shape is 'cone'; valid: box, sphere, cylinder, capsule, plane, urdf",
        ),
        (
            {"name": "a", "shape": "box", "colour": 1},
            r"no parameter 'colour' in .*objects\[a\]; valid: .*name, pose, .*shape, size",
        ),
        (
            {"name": "a", "shape": "box", "size": [1, 2]},
            r"objects\[a\].size is \[1.0, 2.0\]; valid: length, width, height of a box \[m\]",
        ),
        (
            {"name": "a", "shape": "sphere", "size": -1},
            r"objects\[a\].size is -1; valid: a list of finite numbers above 0 \[m\]",
        ),
        (
            {"name": "a", "shape": "sphere", "size": 1, "contact": "soft"},
            r"objects\[a\].contact is 'soft'; valid: rigid, penalty",
        ),
        (
            {"name": "a", "shape": "sphere", "size": 1, "stiffness": 5.0},
            r"objects\[a\].stiffness needs .*contact: penalty",
        ),
        (
            {"name": "a", "shape": "sphere", "size": 1, "mass": "heavy"},
            r"objects\[a\].mass is 'heavy'; valid: a finite number of 0 or more \[kg\]",
        ),
        (
            {"name": "a", "shape": "sphere", "size": 1, "pose": {"x": 1}},
            r"no parameter 'x' in .*objects\[a\].pose; valid: rpy, xyz",
        ),
        ({"name": "a", "shape": "urdf", "urdf": "none.urdf"}, "no file .*none.urdf"),
        ({"shape": "box"}, r"objects\[0\].name is not set"),
        ({"name": "a"}, r"objects\[a\].shape is not set; valid: box, sphere"),
        ({"name": "a", "shape": "plane", "mass": 1}, r"objects\[a\].mass is 1.0; valid: 0: a plane has no mass"),
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
        ("things: []", "no parameter 'things' in .*world.yaml; valid: objects, surfaces"),
        ("objects: {a: 1}", "world.yaml: objects is {'a': 1}; valid: a list"),
        ("objects: [{name: a, shape: plane}, {name: a, shape: plane}]", "twice: a"),
    ):
        path.write_text(text)
        with pytest.raises(HricError, match=message):
            load_world(str(path), 75000.0)
    with pytest.raises(HricError, match="no file"):
        load_world(str(tmp_path / "absent.yaml"), 75000.0)


def test_a_plant_with_more_parameters_names_them_all():
    @dataclass(frozen=True)
    class More(PlantConfig):
        accuracy: float = number(1e-3, above=0.0)

    with pytest.raises(HricError, match=r"no parameter 'rotor' in plant; valid: accuracy, .*integrator.*rotor_inertia"):
        More.of({"rotor": 1}, "plant/", ["a"])
    assert More.of({"accuracy": "1e-4"}, "plant/").accuracy == 1e-4
    assert PlantConfig.of({"rotor_inertia": {"b": 0.2}}, "plant/", ["a", "b"]).rotor_inertia == (0.0, 0.2)


def test_a_stop_waits_until_the_joint_has_been_inside():
    stops = StopMemory([(-1.0, 1.0), (0.0, 2.0), (-math.inf, math.inf)])
    assert stops.restart([1.5, -0.1, 9.0]) == {0, 1}
    assert stops.waiting == {0: (False, True), 1: (True, False)}
    assert stops.check([1.2, 0.5, 9.0]) == [1]
    assert stops.check([1.2, -0.5, 9.0]) == []
    assert stops.waiting == {0: (False, True)}
    assert stops.restart([0.0, 1.0, 0.0]) == {0}
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
    assert combine(soft, hard) == (ContactLaw(2000.0, 5.0), pytest.approx(0.2))
    assert combine(soft, Surface(6000.0, 7.0, 1.0)) == (ContactLaw(pytest.approx(1500.0), 7.0), 0.5)


def rules_of(items):
    return PlantConfig.of({"surfaces": items}, "plant/").surfaces


def test_a_later_rule_for_a_surface_goes_over_an_earlier_one_and_over_the_model():
    rules = rules_of(
        [
            {"link": "*::*", "friction": 0.1},
            {"link": "arm::*", "contact": "penalty", "damping": 3.0},
            {"link": "arm::hand", "contact": "penalty", "stiffness": 2e4, "friction": 0.7},
            {"link": "arm::base", "contact": "rigid"},
        ],
    )
    surfaces = Surfaces(rules, 75000.0)
    assert surfaces.of_model("arm", ["base", "elbow", "hand"], Surface()) == {
        "base": Surface(None, 0.0, 0.1),
        "elbow": Surface(75000.0, 3.0, 0.1),
        "hand": Surface(2e4, 0.0, 0.7),
    }
    assert surfaces.of_model("ball", ["link"], Surface(1e4, 2.0, 0.9)) == {"link": Surface(1e4, 2.0, 0.1)}


@pytest.mark.parametrize(
    ("items", "message"),
    [
        (
            {"arm::hand": {}},
            " is .*; valid: a list of values, each a mapping with contact, stiffness, damping, .*, friction, link",
        ),
        ([{"link": "hand"}], ".*link is 'hand'; valid: model::link, each a name or a pattern such as"),
        ([{"link": "arm::hand", "kp": 1.0}], r"\[0\]; valid: contact, damping, .*, relaxing, stiffness"),
        ([{"link": "arm::hand", "contact": "soft"}], ".*contact is 'soft'; valid: rigid, penalty"),
        ([{"link": "arm::hand", "stiffness": 1.0}], ".*stiffness needs .*contact: penalty"),
        ([{"link": "arm::hand", "damping": 1.0}], ".*damping has no effect; valid: with .*contact: penalty"),
        (
            [{"link": "arm::hand", "contact": "penalty", "dissipation": 1.0}],
            ".*dissipation has no effect; valid: with .*contact: hunt_crossley",
        ),
        ([{"link": "arm::hand", "contact": "viscoelastic"}], ".*needs .*relaxing and .*relaxation_time"),
        (
            [{"link": "arm::hand", "contact": "penalty", "stiffness": 0.0}],
            r".*stiffness is 0.0; valid: a finite number above 0 \[N/m\]",
        ),
    ],
)
def test_a_wrong_rule_for_a_surface_is_refused_with_what_is_valid(items, message):
    with pytest.raises(ParameterError, match=f"plant/surfaces{message}"):
        rules_of(items)


def test_a_link_has_the_surface_that_its_model_brings_where_no_rule_goes_over_it():
    surfaces = Surfaces(rules_of([{"link": "arm::hand", "friction": 0.0}]), 75000.0)
    brought = {"hand": Surface(4e4), "elbow": Surface(3e4)}
    assert surfaces.of_model("arm", ["base", "elbow", "hand"], Surface(), brought) == {
        "base": Surface(),
        "elbow": Surface(3e4),
        "hand": Surface(4e4, 0.0, 0.0),
    }


def test_a_rule_for_a_link_that_a_model_does_not_have_is_refused_with_its_links():
    surfaces = Surfaces(rules_of([{"link": "arm::hnad", "friction": 0.1}]), 75000.0)
    assert surfaces.of_model("other", ["hand"], Surface()) == {"hand": Surface()}
    with pytest.raises(
        UnknownNameError, match="no link 'hnad' in model arm, for the rule arm::hnad of surfaces; valid: base, hand"
    ):
        surfaces.of_model("arm", ["base", "hand"], Surface())


def test_masks_match_in_either_order():
    masks = [("*_link1", "*_link3")]
    assert masked("a_link3", "b_link1", masks)
    assert not masked("a_link3", "b_link2", masks)


def test_friction_over_many_velocities_is_what_the_plant_takes_away_at_each(rng):
    phi, velocity = (0.62, 6.0, 0.03), rng.uniform(-2.0, 2.0, 50)
    a, b, c, d = Losses(sigmoid=phi).sigmoid_row()
    taken = [a * (math.tanh(b * (v + c)) - d) for v in velocity]
    assert np.allclose(sigmoid_torque(velocity, phi), taken, rtol=0.0, atol=1e-15)
