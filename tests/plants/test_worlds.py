"""Worlds, spawned models, names, collision masks, and reproducible results."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from two_link import two_link_urdf

import panda_description
from hric_control.plant import Load, Surface
from hric_core import plugins
from hric_core.errors import DescriptionError, HricError, UnknownNameError

JOINTS = ["joint1", "joint2"]
POSE = [0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0]
BLOCK = """<robot name="block"><link name="body"><inertial><mass value="0.5"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
  </inertial><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"""  # noqa: E501


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def run(plant, n):
    for _ in range(n):
        plant.apply([0.0] * len(plant.joint_names))
        plant.step()


@pytest.mark.parametrize("name", ["empty", "table", "wall"])
def test_the_worlds_of_the_package_load(make_plant, panda_urdf, name):
    plant = make_plant(panda_urdf, world=f"package://pybullet_ros_control/worlds/{name}.yaml", q=POSE)
    plant.set_brakes([True] * 7)
    run(plant, 200)
    assert plant.model_names() == {"empty": [], "table": ["table", "cube"], "wall": ["wall"]}[name]
    if name == "table":
        T, twist = plant.link_state("cube::link")
        assert T[2, 3] == pytest.approx(0.225, abs=1e-3)
        assert np.abs(twist).max() < 1e-2
        pairs = {frozenset((c.body_a, c.body_b)) for c in plant.contacts()}
        assert pairs == {frozenset(("table::link", "cube::link"))}


def test_an_unknown_joint_is_refused(make_plant):
    with pytest.raises(UnknownNameError, match="valid: joint1, joint2"):
        make_plant(two_link_urdf(), ["joint1", "elbow"])


def test_joints_may_be_given_in_another_order(make_plant):
    plain = make_plant(two_link_urdf(), JOINTS, rotor_inertia=[0.1, 0.2])
    turned = make_plant(two_link_urdf(), JOINTS[::-1], rotor_inertia=[0.2, 0.1])
    for plant, q, tau in ((plain, [0.3, 0.2], [4.0, 1.0]), (turned, [0.2, 0.3], [1.0, 4.0])):
        plant.reset(q, [0.1, 0.1])
        for _ in range(100):
            plant.apply(tau)
            plant.step()
    for a, b in zip(plain.engine_state(), turned.engine_state(), strict=True):
        assert a == b[::-1]
    assert np.array_equal(plain.mass_matrix(), turned.mass_matrix()[::-1, ::-1])


def test_joints_without_command_are_free_or_locked(make_plant):
    ends = {}
    for passive in ("free", "locked"):
        plant = make_plant(two_link_urdf(), ["joint1"], passive_joints=passive)
        plant.reset([0.0])
        hold = make_plant(two_link_urdf(), JOINTS, rotor_inertia=[0.1, 0.0])
        hold.reset([0.0, 0.0])
        hold.set_brakes([False, passive == "locked"])
        run(plant, 200)
        run(hold, 200)
        ends[passive] = plant.engine_state()[0][0]
        assert ends[passive] == pytest.approx(hold.engine_state()[0][0], abs=1e-9)
    assert abs(ends["free"] - ends["locked"]) > 1e-3


def test_models_are_spawned_fall_and_are_deleted(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    plant.set_brakes([True, True])
    plant.spawn("one", BLOCK, at(3, 0, 2))
    plant.spawn("two", BLOCK, at(4, 0, 2), fixed=True)
    run(plant, 100)
    assert plant.model_names() == ["one", "two"]
    assert plant.link_state("one::body")[0][2, 3] == pytest.approx(2 - 0.5 * 9.81 * 0.1**2, abs=1e-3)
    assert plant.link_state("two::body")[0][2, 3] == pytest.approx(2.0)
    with pytest.raises(HricError, match="'one' is taken"):
        plant.spawn("one", BLOCK, at(0, 0, 0))
    with pytest.raises(DescriptionError, match="not XML"):
        plant.spawn("three", "<robot", at(0, 0, 0))
    with pytest.raises(UnknownNameError, match=r"no model 'three'.*valid: one, two"):
        plant.delete("three")
    plant.delete("two")
    assert plant.model_names() == ["one"]
    plant.reset([0.0, 0.0])
    assert plant.link_state("one::body")[0][2, 3] == pytest.approx(2.0)


def test_a_spawned_pendulum_swings(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    plant.set_brakes([True, True])
    plant.spawn("pendulum", two_link_urdf(name="pendulum"), at(3, 0, 2), fixed=True)
    run(plant, 200)
    assert plant.link_state("pendulum::link2")[0][2, 3] < 1.95


def test_unknown_bodies_are_refused_with_those_that_exist(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    with pytest.raises(UnknownNameError, match=r"no link 'hand'.*valid: base, link1, link2"):
        plant.link_state("hand")
    with pytest.raises(UnknownNameError, match=r"no model 'ball'.*valid: planar"):
        plant.apply_wrench("ball::link", [1, 0, 0], [0, 0, 0], [0, 0, 0], 1.0)
    with pytest.raises(HricError, match="three finite numbers"):
        plant.apply_wrench("link1", [1, 0], [0, 0, 0], [0, 0, 0], 1.0)


def test_a_new_load_keeps_the_world(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, world="package://pybullet_ros_control/worlds/table.yaml", q=POSE)
    plant.spawn("block", BLOCK, at(3, 0, 5))
    plant.delete("table")
    plant.set_brakes([True] * 7)
    run(plant, 100)
    before = {name: plant.link_state(f"{name}::{link}") for name, link in (("cube", "link"), ("block", "body"))}
    assert before["cube"][1][2] < -0.5
    plant.set_load(Load(1.0))
    assert plant.model_names() == ["cube", "block"]
    for name, link in (("cube", "link"), ("block", "body")):
        for a, b in zip(before[name], plant.link_state(f"{name}::{link}"), strict=True):
            assert np.abs(a - b).max() < 1e-12
    plant.reset(POSE)
    assert plant.model_names() == ["table", "cube", "block"]


def test_legal_poses_have_no_self_collision(make_plant, panda_urdf, rng):
    """Check the collision masks: overlaps of neighbouring capsules are ignored, so that few random poses collide."""
    plant = make_plant(panda_urdf)
    touching = 0
    for q in rng.uniform([-2.8, -1.7, -2.8, -2.6, -2.8, 0.2, -2.8], [2.8, 1.7, 2.8, -0.3, 2.8, 3.5, 2.8], (60, 7)):
        plant.reset(q)
        run(plant, 1)
        pairs = {frozenset((c.body_a.split("_")[-1], c.body_b.split("_")[-1])) for c in plant.contacts()}
        assert frozenset(("link1", "link3")) not in pairs
        assert frozenset(("link5", "link7")) not in pairs
        touching += bool(pairs)
    assert touching < 6


def test_a_folded_arm_touches_itself_unless_told_otherwise(make_plant, panda_urdf):
    folded = [0.0, -1.7, 0.0, -3.0, 0.0, 0.1, 0.0]
    plant = make_plant(panda_urdf, q=folded)
    run(plant, 1)
    assert any(c.body_a.startswith("panda::") and c.body_b.startswith("panda::") for c in plant.contacts())
    for off in ({"self_collision": False}, {"collision": False}):
        plant = make_plant(panda_urdf, q=folded, **off)
        run(plant, 1)
        assert plant.contacts() == []


BALL = """<robot name="ball"><link name="shell"><inertial><mass value="1.0"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/>
  </inertial><collision><geometry><sphere radius="0.05"/></geometry></collision></link></robot>"""  # noqa: E501


def kinds(plant, steps):
    """Return the kind of contact of each pair of bodies during some steps."""
    found = {}
    for _ in range(steps):
        run(plant, 1)
        found.update({frozenset((c.body_a, c.body_b)): c.kind for c in plant.contacts()})
    return found


def test_surfaces_are_set_per_link(make_plant, tmp_path):
    world = tmp_path / "world.yaml"
    floor = "{name: floor, shape: box, size: [20, 20, 1], pose: {xyz: [0, 0, -0.5]}}"
    cube = "{name: cube, shape: box, size: [0.1, 0.1, 0.1], mass: 1, pose: {xyz: [3, 0, 0.051]}}"
    world.write_text(f"objects: [{floor}, {cube}]\nsurfaces: [{{link: 'cube::*', contact: penalty}}]")
    rules = [
        {"link": "ball*::shell", "contact": "penalty", "stiffness": 20000.0},
        {"link": "cube::link", "friction": 0.0},
    ]
    plant = make_plant(two_link_urdf(), JOINTS, world=str(world), surfaces=rules)
    plant.set_brakes([True, True])
    plant.spawn("ball1", BALL, at(4, 0, 0.051))
    plant.spawn("stone", BALL, at(5, 0, 0.051))
    found = kinds(plant, 60)
    pair = {
        name: found[frozenset((f"{name}::{link}", "floor::link"))]
        for name, link in (("ball1", "shell"), ("stone", "shell"), ("cube", "link"))
    }
    assert pair == {"ball1": "penalty", "stone": "rigid", "cube": "penalty"}
    peaks = {frozenset(names) for names in plant.take_contact_peaks()}
    assert peaks == {frozenset((name, "floor::link")) for name in ("ball1::shell", "cube::link")}


def resting(plant, model):
    """Return kind and stiffness (force per depth [N/m]) of the contact of a ball at rest on the floor."""
    run(plant, 250)
    (contact,) = (c for c in plant.contacts() if f"{model}::shell" in (c.body_a, c.body_b))
    return contact.kind, contact.force / contact.depth if contact.kind == "penalty" else None


def test_rules_override_surfaces_of_a_model(make_plant, tmp_path):
    world = tmp_path / "world.yaml"
    world.write_text("objects: [{name: floor, shape: box, size: [20, 20, 1], pose: {xyz: [0, 0, -0.5]}}]")
    rules = [{"link": "ruled::shell", "contact": "rigid"}]
    plant = make_plant(two_link_urdf(), JOINTS, world=str(world), surfaces=rules, q=[0.0, 0.0])
    plant.set_brakes([True, True])
    soft = {"shell": Surface(20000.0, 200.0)}
    plant.spawn("soft", BALL, at(4, 0, 0.051), surfaces=soft)
    plant.spawn("ruled", BALL, at(5, 0, 0.051), surfaces=soft)
    plant.spawn("stone", BALL, at(6, 0, 0.051))
    changes = [
        lambda: None,
        lambda: plant.reset([0.0, 0.0]),
        lambda: plant.set_load(Load(1.0)),
        lambda: plant.delete("stone"),
    ]
    for change in changes:
        change()
        assert resting(plant, "soft") == ("penalty", pytest.approx(20000.0, rel=0.01))
        assert resting(plant, "ruled") == ("rigid", None)


def test_a_surface_of_an_unknown_link_is_refused(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    with pytest.raises(UnknownNameError, match=r"no link 'core' in surfaces of model ball; valid: shell"):
        plant.spawn("ball", BALL, at(3, 0, 1), surfaces={"core": Surface(20000.0)})
    assert plant.model_names() == []
    plant.spawn("ball", BALL, at(3, 0, 1))


@pytest.mark.parametrize("pose", [np.eye(3), np.full((4, 4), np.nan)])
def test_an_invalid_pose_spawns_nothing(make_plant, pose):
    plant = make_plant(two_link_urdf(), JOINTS)
    with pytest.raises(HricError, match="model ball: its pose must be a finite 4 x 4 transform"):
        plant.spawn("ball", BALL, pose)


def test_a_sprung_link_meets_rigid_objects_softly(make_plant, panda_urdf, tmp_path):
    hand = make_plant(panda_urdf, q=POSE).link_state("panda_hand")[0]
    at_hand = (hand[:3, 3] + 0.03 * hand[:3, 2] + 0.054 * hand[:3, 0]).tolist()
    world = tmp_path / "world.yaml"
    world.write_text(f"objects: [{{name: ball, shape: sphere, size: 0.02, mass: 0.5, pose: {{xyz: {at_hand}}}}}]")
    found = {}
    for surfaces in ([], [{"link": "panda::panda_hand", "contact": "penalty", "stiffness": 1000.0}]):
        plant = make_plant(panda_urdf, q=POSE, world=str(world), gravity=[0.0, 0.0, 0.0], surfaces=surfaces)
        plant.set_brakes([True] * 7)
        found[bool(surfaces)] = {kind for pair, kind in kinds(plant, 5).items() if "panda::panda_hand" in pair}
    assert found == {False: {"rigid"}, True: {"penalty"}}


def test_a_rule_for_an_unknown_link_is_refused(make_plant):
    with pytest.raises(
        UnknownNameError,
        match=r"no link 'hand' in model planar, for the rule planar::hand of surfaces; valid: base, link1, link2",
    ):
        make_plant(two_link_urdf(), JOINTS, surfaces=[{"link": "planar::hand", "friction": 0.1}])
    plant = make_plant(two_link_urdf(), JOINTS, surfaces=[{"link": "ball::core", "friction": 0.1}])
    with pytest.raises(
        UnknownNameError, match=r"no link 'core' in model ball, for the rule ball::core of surfaces; valid: shell"
    ):
        plant.spawn("ball", BALL, at(3, 0, 1))
    assert plant.model_names() == []
    plant.spawn("other", BALL, at(3, 0, 1))


def scene(plant_type, rotor, steps):
    """Return hashes of two motions of a falling arm next to a stack, with an external wrench on a cube."""
    joints = [f"panda_joint{i}" for i in range(1, 8)]
    config = {"world": "package://pybullet_ros_control/worlds/table.yaml", "rotor_inertia": rotor, "seed": 1}
    plant = plugins.find(plugins.PLANT, plant_type)(panda_description.load(meshes=False), joints, config)
    digests = []
    for _ in range(2):
        digest = hashlib.sha256()
        plant.reset([0.3, 0.2, 0.0, -1.5, 0.0, 1.5, 0.0])
        plant.apply_wrench("cube::link", [0.3, 0.1, 0.0], [0, 0, 0], [0, 0, 0], 0.2)
        for k in range(steps):
            plant.apply([0.0] * 7)
            plant.step()
            if k % 20 == 0:
                digest.update(np.array(plant.engine_state()).tobytes() + plant.link_state("cube::link")[0].tobytes())
                digest.update(repr(plant.contacts()).encode())
        digests.append(digest.hexdigest())
    plant.close()
    return digests


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_runs_repeat_bit_for_bit(plant_type, rotor):
    steps = 400 if "PyBullet" in plant_type else 120
    here = scene(plant_type, rotor, steps)
    assert here[0] == here[1]
    folders = [str(Path(__file__).parent), *sys.path]
    code = (
        f"import sys; sys.path[:0] = {folders!r}; import test_worlds; print(test_worlds.scene({plant_type!r}, "
        f"{rotor}, {steps})[0])"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert other.stdout.split()[-1] == here[0]
