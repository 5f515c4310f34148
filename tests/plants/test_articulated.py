"""Spawned models with driven joints and connections between two bodies, such as a human arm that holds the robot."""

import math
import re

import numpy as np
import pinocchio
import pytest
from bodies import body
from rigid_body_oracle import Oracle, wide
from two_link import two_link_urdf

from hric_control.plant import Bushing
from hric_control.plants.stops import STOP_RATE
from hric_core import plugins
from hric_core.errors import CommandError, HricError, ParameterError, UnknownNameError

PLANTS = list(plugins.names(plugins.PLANT))
ARM = body(parts="right_arm").urdf
JOINTS = ["joint1", "joint2"]
READY = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
BENT = [0.3, 0.2, 0.1, 1.2, 0.1, 0.2, 0.1]
"""Joint positions of the human arm with the hand in front of the elbow [rad]."""
FIRST_FOUR = np.array([1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
WEIGHTLESS = {"gravity": [0.0, 0.0, 0.0]}
BAR = """<robot name="bar"><link name="post"/>
  <link name="bar"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="axle" type="{kind}"><parent link="post"/><child link="bar"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="0.5" effort="50" velocity="50"/>
    <dynamics damping="{damping}" friction="{friction}"/></joint>
</robot>"""
INERTIA = 0.03 + 2.0 * 0.2**2
"""Moment of inertia of the bar about its axle [kg m^2]."""
MASS = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
PADDLE = f"""<robot name="paddle"><link name="post"/><link name="arm">{MASS}</link>
  <link name="blade">{MASS}
    <collision><origin xyz="0.2 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="mount" type="fixed"><parent link="post"/><child link="arm"/></joint>
  <joint name="axle" type="continuous"><parent link="arm"/><child link="blade"/><axis xyz="0 0 1"/></joint>
</robot>"""
BLOCK = """<robot name="block"><link name="body"><inertial><mass value="{mass}"/>
  <inertia ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link></robot>"""


@pytest.fixture(params=PLANTS, ids=lambda name: name.rpartition("/")[2])
def plant_type(request):
    return request.param


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def bar(kind="revolute", damping=0.0, friction=0.0):
    return BAR.format(kind=kind, damping=damping, friction=friction)


def block(mass=1.0, inertia=0.01):
    return BLOCK.format(mass=mass, inertia=inertia)


def run(plant, n):
    for _ in range(n):
        plant.apply([0.0] * len(plant.joint_names))
        plant.step()


def joints(plant, model):
    n = len(plant.model_joints(model))
    q, dq = [0.0] * n, [0.0] * n
    plant.read_joints(model, q, dq)
    return np.array(q), np.array(dq)


@pytest.fixture
def beside(make_plant):
    """Function beside(urdf, **parameters) that returns a plant with a braked robot and a model with fixed base."""

    def made(urdf, name="model", **config):
        plant = make_plant(two_link_urdf(), JOINTS, q=[0.0, 0.0], **config)
        plant.set_brakes([True, True])
        plant.spawn(name, urdf, at(3, 0, 2), fixed=True)
        return plant

    return made


class Hands:
    """Panda whose hand is held by a human arm, each with a position controller; the robot has no collision shapes."""

    def __init__(self, make_plant, urdf, integrator="accurate", **grip):
        self.robot, self.arm = Oracle(urdf, 0.1), Oracle(ARM)
        self.plant = make_plant(urdf, q=READY, rotor_inertia=0.1, collision=False, integrator=integrator)
        T_hand, T_wrist = self.plant.link_state("panda_hand")[0], self.arm.frame(np.array(BENT), "r_wrist")
        self.plant.spawn("human", ARM, at(*(T_hand - T_wrist)[:3, 3]), fixed=True)
        self.plant.set_joints("human", BENT)
        T_wrist[:3, 3] = T_hand[:3, 3]
        T_wrist_grip = np.linalg.inv(T_wrist) @ T_hand
        self.plant.connect("grip", Bushing("panda_hand", "human::r_wrist", np.eye(4), T_wrist_grip, **grip))

    def state(self):
        """Return q and dq of the robot, then of the arm."""
        q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
        self.plant.read_state(q, dq, tau)
        return np.array(q), np.array(dq), *joints(self.plant, "human")

    def step(self, goal):
        """Step with a goal of the robot's joints; return the efforts of robot and arm."""
        q, dq, x, v = self.state()
        tau = 200.0 * (goal - q) - 20.0 * dq + self.robot.gravity(q)
        drive = 20.0 * (BENT - x) - 2.0 * v + self.arm.gravity(x)
        self.plant.apply(tau)
        self.plant.drive_joints("human", drive)
        self.plant.step()
        return tau, drive

    def guide(self, steps):
        """Move four joints of the robot along half a cosine for 0.5 s, then hold; yield the efforts of each step."""
        for k in range(steps):
            yield self.step(READY + 0.1 * (1.0 - math.cos(math.pi * min(k / 500.0, 1.0))) * FIRST_FOUR)


@pytest.fixture
def hands(make_plant, panda_urdf):
    return lambda **how: Hands(make_plant, panda_urdf, **how)


# -- joints of a model -------------------------------------------------------------------------------------------------


def test_joint_names_run_from_the_root(beside):
    expected = tuple(pinocchio.buildModelFromXML(ARM).names)[1:]
    assert beside(ARM).model_joints("model") == expected


def test_a_model_without_joints_has_no_names(beside):
    assert beside(block()).model_joints("model") == ()


def test_an_unknown_model_is_refused(beside):
    with pytest.raises(UnknownNameError, match=r"no model 'human'.*valid: model"):
        beside(ARM).model_joints("human")


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
def test_joints_are_read_where_they_were_put(beside, integrator):
    plant = beside(ARM, integrator=integrator)
    speeds = [0.5, -0.4, 0.3, -0.2, 0.1, 0.2, 0.3]
    plant.set_joints("model", BENT, speeds)
    q, dq = joints(plant, "model")
    assert q == pytest.approx(BENT, abs=1e-12)
    assert dq == pytest.approx(speeds, abs=1e-12)


def test_put_joints_place_the_links(beside):
    plant = beside(ARM)
    plant.set_joints("model", BENT)
    expected = at(3, 0, 2) @ Oracle(ARM).frame(np.array(BENT), "r_wrist")
    assert np.abs(plant.link_state("model::r_wrist")[0] - expected).max() < 1e-6


@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_driven_arm_moves_as_in_pinocchio(beside, damping):
    urdf = re.sub(r"(<limit [^>]*/>)", rf'\1<dynamics damping="{damping}"/>', wide(ARM))
    plant, oracle = beside(urdf, integrator="accurate"), Oracle(urdf, damping=damping)
    q, dq = np.array(BENT), np.full(7, 0.1)
    plant.set_joints("model", q, dq)
    size = np.array([0.5, 0.5, 0.1, 0.5, 0.005, 0.025, 0.025])
    for k in range(500):
        drive = oracle.gravity(np.array(BENT)) + size * np.sin(0.01 * k + np.arange(7.0))
        plant.drive_joints("model", drive)
        run(plant, 1)
        q, dq = oracle.hold(q, dq, drive)
    moved, error = np.abs(q - BENT).max(), np.abs(joints(plant, "model")[0] - q).max()
    print(f"damping {damping}: {error:.1e} rad of {moved:.2f} rad")
    assert moved > 0.04
    assert error < 1e-3 * moved


def test_a_drive_stays_until_it_is_given_again(beside):
    plant = beside(bar("continuous"), **WEIGHTLESS)
    plant.drive_joints("model", [0.5])
    run(plant, 100)
    assert joints(plant, "model")[1][0] == pytest.approx(0.1 * 0.5 / INERTIA, rel=1e-6)


@pytest.mark.parametrize("friction", ["none", "coulomb"])
def test_coulomb_friction_holds_a_model(beside, friction):
    plant = beside(bar(friction=1.0), friction=friction, **WEIGHTLESS)
    plant.drive_joints("model", [0.8])
    run(plant, 200)
    assert (abs(joints(plant, "model")[0][0]) < 1e-4) == (friction == "coulomb")


@pytest.mark.parametrize(
    ("q", "dq", "message"),
    [
        ([0.1], None, "got 1 values for 7 joints"),
        (BENT, [0.0] * 6, "got 6 values for 7 joints"),
        ([math.nan, *BENT[1:]], None, "must be finite"),
    ],
)
def test_an_invalid_configuration_is_refused(beside, q, dq, message):
    with pytest.raises(CommandError, match=message):
        beside(ARM).set_joints("model", q, dq)


def test_a_drive_of_other_length_is_refused(beside):
    with pytest.raises(CommandError, match=r"got 2 values for 7 joints \(right_sh_flex, "):
        beside(ARM).drive_joints("model", [0.0, 0.0])


# -- stops -------------------------------------------------------------------------------------------------------------


def test_a_pressed_stop_yields_as_its_spring(beside):
    plant = beside(bar(), **WEIGHTLESS)
    plant.drive_joints("model", [3.0])
    run(plant, 1500)
    depth = joints(plant, "model")[0][0] - 0.5
    assert depth == pytest.approx(3.0 / (STOP_RATE**2 * INERTIA), rel=0.05)


def test_a_stop_does_not_bounce(beside):
    plant = beside(bar(), **WEIGHTLESS)
    plant.set_joints("model", [0.3], [3.0])
    speeds = []
    for _ in range(300):
        run(plant, 1)
        speeds.append(joints(plant, "model")[1][0])
    assert min(speeds) > -0.2 * 3.0


def test_a_start_outside_opens_the_stop(beside):
    plant = beside(bar(), **WEIGHTLESS)
    plant.set_joints("model", [0.7])
    run(plant, 100)
    assert joints(plant, "model")[0][0] == pytest.approx(0.7, abs=1e-9)
    plant.set_joints("model", [0.7], [-2.0])
    run(plant, 200)
    plant.drive_joints("model", [3.0])
    run(plant, 1000)
    assert joints(plant, "model")[0][0] == pytest.approx(0.5, abs=1e-2)


@pytest.mark.parametrize("abduction", [0.3, math.pi / 2])
def test_stops_add_no_energy(beside, abduction):
    """Check the energy also in a singular pose of the shoulder, in which two joints have nearly no inertia."""
    plant, oracle = beside(ARM, integrator="accurate"), Oracle(ARM)
    start = [2.5, abduction, 0.5, 0.4, -1.2, 0.2, 0.1]
    plant.set_joints("model", start)
    energies = []
    for _ in range(300):
        q, dq = joints(plant, "model")
        kinetic = pinocchio.computeKineticEnergy(oracle.model, oracle.data, q, dq)
        energies.append(kinetic + pinocchio.computePotentialEnergy(oracle.model, oracle.data, q))
        run(plant, 10)
    assert energies[-1] < energies[0] - 1.0
    assert max(energies) < energies[0] + 0.1


# -- bushings ----------------------------------------------------------------------------------------------------------


def test_a_weight_stretches_a_bushing_as_a_spring(beside):
    plant = beside(bar("prismatic", damping=100.0), name="weight")
    plant.spawn("hook", block(), at(3, 0, 2), fixed=True)
    plant.connect("string", Bushing("hook::body", "weight::bar", np.eye(4), np.eye(4), 5000.0))
    run(plant, 1500)
    load = plant.bushing_load("string")
    assert load.force == pytest.approx((0.0, 0.0, -2.0 * 9.81), abs=1e-4)
    assert joints(plant, "weight")[0][0] == pytest.approx(-2.0 * 9.81 / 5000.0, rel=1e-4)
    assert load.stretch == pytest.approx(2.0 * 9.81 / 5000.0, rel=1e-4)


def test_two_bushings_on_one_link_share_its_weight(beside):
    plant = beside(bar("prismatic", damping=100.0), name="weight")
    for name, stiffness, x in (("one", 3000.0, -0.1), ("two", 1000.0, 0.3)):
        plant.connect(name, Bushing("weight::post", "weight::bar", at(x, 0, 0), at(x, 0, 0), stiffness))
    run(plant, 1500)
    weight = 2.0 * 9.81
    for name, share in (("one", 0.75), ("two", 0.25)):
        assert plant.bushing_load(name).force == pytest.approx((0.0, 0.0, -share * weight), abs=1e-4)
    assert joints(plant, "weight")[0][0] == pytest.approx(-weight / 4000.0, rel=1e-4)


def test_a_torque_twists_a_bushing_as_a_spring(beside):
    plant = beside(bar(damping=2.0), name="wheel", **WEIGHTLESS)
    plant.connect("shaft", Bushing("wheel::post", "wheel::bar", np.eye(4), np.eye(4), 0.0, 0.0, 50.0))
    plant.drive_joints("wheel", [1.0])
    run(plant, 1500)
    assert plant.bushing_load("shaft").torque == pytest.approx((0.0, 0.0, 1.0), abs=1e-4)
    assert joints(plant, "wheel")[0][0] == pytest.approx(1.0 / 50.0, rel=1e-4)


def test_a_bushing_conserves_both_momenta(beside):
    plant = beside(bar(), **WEIGHTLESS)
    parts = {"one": (1.0, 0.01), "two": (3.0, 0.02)}
    for (name, numbers), x in zip(parts.items(), (5.0, 5.5), strict=True):
        plant.spawn(name, block(*numbers), at(x, 0, 2))
    off = at(0.2, 0.1, 0.0), at(-0.2, 0.0, 0.05)
    plant.connect("string", Bushing("one::body", "two::body", *off, 2000.0, 5.0, 2.0, 0.01))
    pushed, linear, angular = 0.0, np.zeros(3), np.zeros(3)
    for _ in range(300):
        run(plant, 1)
        pushed += 1e-3 * math.hypot(*plant.bushing_load("string").force)
    for name, (mass, inertia) in parts.items():
        T, twist = plant.link_state(f"{name}::body")
        linear += mass * twist[:3]
        angular += mass * np.cross(T[:3, 3], twist[:3]) + inertia * twist[3:]
    assert pushed > 1.0
    assert np.abs(linear).max() < 1e-9 * pushed
    assert np.abs(angular).max() < 1e-3 * pushed


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("stiffness", [2e3, 1e4, 5e4])
def test_a_grip_follows_the_robot(hands, integrator, stiffness):
    held = hands(integrator=integrator, stiffness=stiffness)
    pull = max(math.hypot(*held.plant.bushing_load("grip").force) for _ in held.guide(1500))
    assert pull < 100.0
    assert np.abs(held.state()[3]).max() < 1e-2
    load = held.plant.bushing_load("grip")
    assert math.hypot(*load.force) > 0.5
    assert load.stretch == pytest.approx(math.hypot(*load.force) / stiffness, rel=0.05)


def test_robot_arm_and_grip_keep_their_energy(hands):
    """Check the energy balance: work of the drives = kinetic energy + energy of the grip's springs + damping losses."""
    held = hands()
    law = Bushing("", "", np.eye(4), np.eye(4))

    def energy():
        q, dq, x, v = held.state()
        moving = 0.5 * dq @ (held.robot.mass_matrix(q) + 0.1 * np.eye(7)) @ dq + 0.5 * v @ held.arm.mass_matrix(x) @ v
        high = pinocchio.computePotentialEnergy(held.robot.model, held.robot.data, q)
        return moving + high + pinocchio.computePotentialEnergy(held.arm.model, held.arm.data, x)

    given = passed = taken = 0.0
    start, before = energy(), held.state()
    for tau, drive in held.guide(1000):
        after = held.state()
        works = tau @ (after[0] - before[0]), drive @ (after[2] - before[2])
        given, passed, before = given + sum(works), passed + sum(map(abs, works)), after
        # Of the coming step, whose beginning is now.
        moves = held.plant.link_state("panda_hand")[1] - held.plant.link_state("human::r_wrist")[1]
        taken += 1e-3 * (law.damping * moves[:3] @ moves[:3] + law.rotational_damping * moves[3:] @ moves[3:])
    load = held.plant.bushing_load("grip")
    springs = 0.5 * law.stiffness * load.stretch**2 + 0.5 * np.dot(load.torque, load.torque) / law.rotational_stiffness
    residual = energy() + springs + taken - start - given
    print(f"residual {residual:.1e} J of {passed:.1f} J")
    assert passed > 1.0
    assert abs(residual) < 0.01 * passed


def test_a_grip_slips_at_its_limit(beside):
    plant = beside(bar("prismatic"), name="rod", **WEIGHTLESS)
    grip = Bushing("rod::post", "rod::bar", np.eye(4), np.eye(4), damping=0.0, force_limit=10.0)
    plant.connect("grip", grip)
    plant.drive_joints("rod", [30.0])
    run(plant, 150)
    load, moved = plant.bushing_load("grip"), joints(plant, "rod")
    assert math.hypot(*load.force) == pytest.approx(10.0)
    assert moved[1][0] == pytest.approx(0.15 * (30.0 - 10.0) / 2.0, rel=0.05)
    assert load.slipped == pytest.approx(moved[0][0] - 10.0 / grip.stiffness, abs=3e-3)


@pytest.mark.parametrize("contact", ["rigid", "penalty"])
def test_connected_links_do_not_touch(beside, contact):
    rules = [{"link": "two::*", "contact": contact}]
    plant = beside(block(), name="one", surfaces=rules, **WEIGHTLESS)
    plant.spawn("two", block(), at(3.05, 0, 2))
    plant.connect("glue", Bushing("one::body", "two::body", at(0.05, 0, 0), np.eye(4)))
    run(plant, 10)
    assert plant.contacts() == []
    plant.disconnect("glue")
    run(plant, 1)
    assert {contact.kind for contact in plant.contacts()} == {contact}


@pytest.mark.parametrize("contact", ["rigid", "penalty"])
def test_a_held_sleeve_touches_nothing(make_plant, panda_urdf, contact):
    """Check that a held body has no contact with its holder although the hulls overlap by centimetres."""
    plant = make_plant(panda_urdf, q=READY, surfaces=[{"link": "glove::*", "contact": contact}], **WEIGHTLESS)
    plant.set_brakes([True] * 7)
    plant.spawn("glove", block(), plant.link_state("panda_hand")[0])
    run(plant, 1)
    touched = [{one.body_a, one.body_b} for one in plant.contacts()]
    plant.connect("grip", Bushing("panda_hand", "glove::body", np.eye(4), np.eye(4)))
    run(plant, 2)
    assert {"glove::body", "panda::panda_hand"} in touched and plant.contacts() == []


def test_neighbours_of_connected_links_do_not_touch(beside):
    plant = beside(PADDLE, name="one", surfaces=[{"link": "two::*", "contact": "penalty"}], **WEIGHTLESS)
    plant.spawn("two", block(), at(3.25, 0, 2))
    run(plant, 1)
    assert {contact.body_a for contact in plant.contacts()} == {"one::blade"}
    plant.connect("glue", Bushing("one::post", "two::body", at(0.25, 0, 0), np.eye(4)))
    run(plant, 10)
    assert plant.contacts() == []


# -- names and numbers of connections ----------------------------------------------------------------------------------


def test_a_new_bushing_has_no_load(hands):
    load = hands().plant.bushing_load("grip")
    assert (load.force, load.torque, load.stretch, load.slipped) == ((0.0,) * 3, (0.0,) * 3, 0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "bushing", "error", "message"),
    [
        ("grip", Bushing("link1", "model::bar", np.eye(4), np.eye(4)), HricError, "name 'grip' is empty or taken"),
        ("", Bushing("link1", "model::bar", np.eye(4), np.eye(4)), HricError, "name '' is empty or taken"),
        ("new", Bushing("hand", "model::bar", np.eye(4), np.eye(4)), UnknownNameError, "no link 'hand'"),
        ("new", Bushing("link1", "ball::bar", np.eye(4), np.eye(4)), UnknownNameError, "no model 'ball'"),
        ("new", Bushing("link1", "planar::link1", np.eye(4), np.eye(4)), HricError, "both bodies are planar::link1"),
        ("new", Bushing("link1", "model::bar", 2 * np.eye(4), np.eye(4)), ParameterError, "T_a_grip must be a 4 x 4"),
        ("new", Bushing("link1", "model::bar", np.eye(4), np.eye(4), -1.0), ParameterError, "stiffness must be a"),
    ],
)
def test_an_invalid_connection_changes_nothing(beside, name, bushing, error, message):
    plant = beside(bar())
    plant.connect("grip", Bushing("link2", "model::bar", np.eye(4), np.eye(4)))
    with pytest.raises(error, match=message):
        plant.connect(name, bushing)
    assert plant.connections() == ["grip"]


def test_an_unknown_connection_is_refused(beside):
    plant = beside(bar())
    plant.connect("grip", Bushing("link2", "model::bar", np.eye(4), np.eye(4)))
    for request in (plant.disconnect, plant.bushing_load):
        with pytest.raises(UnknownNameError, match=r"no connection 'hold'.*valid: grip"):
            request("hold")


# -- what survives what ------------------------------------------------------------------------------------------------


def spawn(plant):
    plant.spawn("other", bar(), at(8, 0, 2), fixed=True)


def spawn_and_delete(plant):
    spawn(plant)
    plant.delete("other")


def set_load(plant):
    plant.set_load(None)


@pytest.mark.parametrize("change", [spawn, spawn_and_delete, set_load])
def test_a_scene_change_disturbs_no_arm(hands, change):
    ends = []
    for how in (lambda plant: None, change):
        held = hands()
        for k, _ in enumerate(held.guide(400)):
            if k == 200:
                before = held.state()
                how(held.plant)
                assert all(map(np.array_equal, before, held.state()))
        ends.append(np.concatenate([*held.state(), held.plant.bushing_load("grip").force]))
    assert np.abs(ends[1] - ends[0]).max() < 1e-6


def test_a_reset_returns_to_the_put_joints(beside):
    plant = beside(ARM)
    plant.set_joints("model", BENT, [0.1] * 7)
    run(plant, 50)
    plant.reset([0.0, 0.0])
    q, dq = joints(plant, "model")
    assert q == pytest.approx(BENT, abs=1e-12)
    assert dq == pytest.approx([0.1] * 7, abs=1e-12)


def test_a_reset_ends_the_drive(beside):
    plant = beside(bar(), **WEIGHTLESS)
    plant.drive_joints("model", [1.0])
    plant.reset([0.0, 0.0])
    run(plant, 10)
    assert joints(plant, "model")[0][0] == 0.0


def test_a_reset_keeps_a_grip_unslipped(beside):
    plant = beside(bar("prismatic"), name="rod", **WEIGHTLESS)
    plant.connect("grip", Bushing("rod::post", "rod::bar", np.eye(4), np.eye(4), force_limit=10.0))
    plant.drive_joints("rod", [30.0])
    run(plant, 100)
    assert plant.bushing_load("grip").slipped > 0.0
    plant.reset([0.0, 0.0])
    assert plant.connections() == ["grip"]
    run(plant, 1)
    assert plant.bushing_load("grip").slipped == 0.0


def test_a_deleted_model_frees_its_connections(beside):
    plant = beside(bar())
    plant.spawn("other", bar(), at(5, 0, 2), fixed=True)
    plant.connect("grip", Bushing("link2", "model::bar", np.eye(4), np.eye(4), 0.0, 0.0))
    plant.connect("kept", Bushing("link2", "other::bar", np.eye(4), np.eye(4), 0.0, 0.0))
    plant.delete("model")
    run(plant, 10)
    assert plant.connections() == ["kept"]


def test_a_reset_run_repeats_bit_for_bit(hands):
    held, ends = hands(), []
    for _ in range(2):
        held.plant.reset(READY)
        for _ in held.guide(200):
            pass
        ends.append((*map(tuple, held.state()), held.plant.bushing_load("grip")))
    assert ends[0] == ends[1]
