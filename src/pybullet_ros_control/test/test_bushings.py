"""Bushings between links of one engine."""

import numpy as np
import pytest
from two_link import two_link_urdf

from hric_control.plant import Bushing, Load
from hric_control.plants import BushingLaw

JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]
MASS = 2.0
SLIDER = f"""<robot name="slider"><link name="base"/><link name="block"><inertial><mass value="{MASS}"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="block"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="5"/></joint></robot>"""
BALL = """<robot name="ball"><link name="shell"><inertial><origin xyz="0.01 0.02 -0.01"/><mass value="1.0"/>
    <inertia ixx="0.003" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><sphere radius="0.05"/></geometry></collision></link></robot>"""


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def steps(plant, n, tau=(0.0, 0.0)):
    for _ in range(n):
        plant.apply(list(tau))
        plant.step()


def momenta(plant, names):
    """Return linear and angular momentum about the origin, shape (6,)."""
    total = np.zeros(6)
    for name in names:
        T, twist = plant.link_state(f"{name}::shell")
        R, lever = T[:3, :3], T[:3, :3] @ [0.01, 0.02, -0.01]
        velocity = twist[:3] + np.cross(twist[3:], lever)
        spin = R @ np.diag([0.003, 0.002, 0.001]) @ R.T @ twist[3:]
        total += [*velocity, *(spin + np.cross(T[:3, 3] + lever, velocity))]
    return total


@pytest.mark.parametrize("damping", [0.0, 100.0])
def test_a_mass_on_a_bushing_swings_as_an_oscillator_whose_force_is_held_over_each_step(make_plant, damping):
    """Held for dt from the beginning of the step a spring k acts half a step late: as a damper of -k dt/2."""
    k, dt = 1e4, 1e-3
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.spawn("slider", SLIDER, at(3, 0, 0), fixed=True)
    plant.set_joints("slider", [0.01])
    plant.connect("spring", Bushing("slider::base", "slider::block", np.eye(4), np.eye(4), k, damping))
    rate = (damping - k * dt / 2) / (2 * MASS)
    omega = np.sqrt(k / MASS - rate**2)
    q, worst = [0.0], 0.0
    for n in range(300):
        plant.read_joints("slider", q, [0.0])
        t = n * dt
        exact = 0.01 * np.exp(-rate * t) * (np.cos(omega * t) + rate / omega * np.sin(omega * t))
        worst = max(worst, abs(q[0] - exact))
        steps(plant, 1)
    print(f"damping {damping}: within {worst / 0.01:.1e} of the amplitude")
    assert worst < 0.02 * 0.01


def test_two_free_bodies_that_are_held_together_keep_their_momenta(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    for name, y in (("one", 0.0), ("two", 0.15)):
        plant.spawn(name, BALL, at(3, y, 1))
    plant.connect("grip", Bushing("one::shell", "two::shell", at(0, 0.075, 0), at(0, -0.075, 0)))
    plant.apply_wrench("one::shell", [5, 3, -8], [0.3, 0.1, 0.2], STILL, 0.1)
    steps(plant, 101)
    before = momenta(plant, ("one", "two"))
    apart = plant.link_state("two::shell")[0][:3, 3] - plant.link_state("one::shell")[0][:3, 3]
    steps(plant, 300)
    change = momenta(plant, ("one", "two")) - before
    print(change, before)
    assert np.abs(change[:3]).max() < 1e-12
    assert np.abs(change[3:]).max() < 1e-3 * np.linalg.norm(before[3:])
    now = plant.link_state("two::shell")[0][:3, 3] - plant.link_state("one::shell")[0][:3, 3]
    assert np.linalg.norm(now) == pytest.approx(np.linalg.norm(apart), abs=1e-3)
    assert np.linalg.norm(now - apart) > 0.05


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
def test_a_braked_robot_holds_what_hangs_on_it_and_feels_it_in_its_joints(make_plant, integrator):
    plant = make_plant(two_link_urdf(), JOINTS, integrator=integrator)
    plant.reset([0.3, 0.2])
    plant.set_brakes([True, False])
    plant.set_brakes([True, True])
    T = plant.link_state("link2")[0]
    plant.spawn("ball", BALL, T)
    efforts = []
    for held in (False, True):
        if held:
            plant.connect("hook", Bushing("link2", "ball::shell", np.eye(4), np.eye(4)))
        steps(plant, 1000)
        efforts.append([0.0, 0.0])
        plant.read_state([0.0, 0.0], [0.0, 0.0], efforts[-1])
        if not held:
            plant.delete("ball")
            plant.spawn("ball", BALL, T)
    load = plant.bushing_load("hook")
    assert load.force == pytest.approx([0.0, 0.0, -9.81], abs=1e-3)
    # About the axes, which point along y: z-force times the lever along x, and the ball's own centre of mass.
    com = T[:3, :3] @ [0.01, 0.02, -0.01]
    levers = [T[0, 3] + com[0], com[0]]
    assert np.subtract(*efforts) == pytest.approx([9.81 * x for x in levers], abs=2e-2)
    q, _dq = plant.engine_state()
    assert np.abs(np.array(q) - [0.3, 0.2]).max() < 1e-5


def test_a_free_joint_beside_a_braked_one_is_pulled_by_a_bushing_as_by_a_wrench(make_plant):
    ends = []
    for held in (True, False):
        plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
        plant.set_brakes([True, False])
        if held:
            plant.spawn("ball", BALL, at(0, 0, 0), fixed=True)
            soft = Bushing("ball::shell", "link2", at(0.5, 0, 0.1), np.eye(4), 100.0, 0.0, 0.0, 0.0)
            plant.connect("spring", soft)
        else:
            plant.apply_wrench("link2", [0, 0, 10], STILL, STILL, 0.05)
        steps(plant, 50)
        ends.append(plant.engine_state()[0])
    assert ends[0] == pytest.approx(ends[1], abs=1e-5)


@pytest.mark.parametrize("contact", ["rigid", "penalty"])
def test_what_is_connected_does_not_touch_until_it_is_let_go(make_plant, contact):
    rule = [{"link": "*::shell", "contact": contact}]
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL, surfaces=[] if contact == "rigid" else rule)
    for name, x in (("one", 0.0), ("two", 0.099), ("three", 0.198)):
        plant.spawn(name, BALL, at(3 + x, 0, 1), fixed=name != "two")

    def touching():
        steps(plant, 1)
        return {frozenset((c.body_a[:-7], c.body_b[:-7])) for c in plant.contacts()}

    left, right = frozenset(("one", "two")), frozenset(("two", "three"))
    assert touching() == {left, right}
    plant.connect("grip", Bushing("one::shell", "two::shell", at(0.099, 0, 0), np.eye(4)))
    assert touching() == {right}
    plant.reset([0.0, 0.0])
    assert touching() == {right}
    plant.set_load(Load(1.0))
    assert touching() == {right}
    plant.disconnect("grip")
    plant.reset([0.0, 0.0])
    assert touching() == {left, right}
    plant.connect("grip", Bushing("one::shell", "two::shell", at(0.099, 0, 0), np.eye(4)))
    plant.disconnect("grip")
    assert touching() == {left, right}
    plant.connect("grip", Bushing("one::shell", "two::shell", at(0.099, 0, 0), np.eye(4)))
    plant.delete("one")
    plant.spawn("one", BALL, at(3, 0, 1), fixed=True)
    assert plant.connections() == []
    plant.reset([0.0, 0.0])
    assert touching() == {left, right}


def test_links_of_the_robot_that_are_let_go_obey_its_masks_again(make_plant, panda_urdf):
    pose = [0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0]
    plant = make_plant(panda_urdf, [f"panda_joint{i}" for i in range(1, 8)], pose, gravity=STILL)
    plant.connect("strap", Bushing("panda_link5", "panda_link7", np.eye(4), np.eye(4), 0.0, 0.0, 0.0, 0.0))
    plant.disconnect("strap")
    steps(plant, 2, [0.0] * 7)
    assert plant.contacts() == []


def test_no_law_is_asked_twice_a_step(make_plant, monkeypatch):
    """A grip that slips would slip twice."""
    asked = []
    law = BushingLaw.step
    monkeypatch.setattr(BushingLaw, "step", lambda self, a, b: asked.append(1) or law(self, a, b))
    plant = make_plant(two_link_urdf(), JOINTS)
    plant.spawn("ball", BALL, at(0, 0, 0))
    plant.connect("hook", Bushing("link2", "ball::shell", np.eye(4), np.eye(4)))
    steps(plant, 5)
    assert len(asked) == 5
