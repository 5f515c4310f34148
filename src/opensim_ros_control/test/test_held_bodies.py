"""Joints of models beside the robot, and bushings, where OpenSim is unlike the other engines."""

import numpy as np
import pinocchio
import pytest
from two_link import two_link_urdf

from hric_control.plant import Bushing
from hric_human.body import Subject, describe

JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]
INERTIAL = """<inertial><mass value="1"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial>"""
FINGERS = f"""<robot name="fingers"><link name="base"/>
  <link name="left">{INERTIAL}</link><link name="right">{INERTIAL}</link>
  <joint name="left" type="revolute"><parent link="base"/><child link="left"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="right" type="revolute"><parent link="base"/><child link="right"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/><mimic joint="left" multiplier="-2" offset="0.1"/></joint>
</robot>"""
STICK = f'<robot name="stick"><link name="body">{INERTIAL}</link></robot>'


def run(plant, n):
    for _ in range(n):
        plant.apply([0.0, 0.0])
        plant.step()


def at(x, y, z):
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


@pytest.fixture
def plant(make_plant):
    return make_plant(two_link_urdf(), JOINTS, q=[0.0, 0.0], gravity=STILL)


def test_a_joint_that_mimics_another_follows_where_that_is_put(plant):
    q, dq = [0.0] * 2, [0.0] * 2
    plant.spawn("fingers", FINGERS, at(3, 0, 1), fixed=True)
    plant.read_joints("fingers", q, dq)
    assert q == [0.0, 0.1]
    plant.set_joints("fingers", [0.3, 0.0], [0.2, 0.0])
    run(plant, 100)
    plant.read_joints("fingers", q, dq)
    assert q == pytest.approx([0.32, -0.54], abs=1e-6)
    assert dq == pytest.approx([0.2, -0.4], abs=1e-6)


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
def test_a_bushing_sees_both_links_where_they_are_and_as_fast_as_they_are(make_plant, panda_urdf, integrator):
    arm = describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male", parts="right_arm")).urdf
    plant = make_plant(panda_urdf, integrator=integrator)
    plant.spawn("human", arm, at(0.3, 0.2, 0.5), fixed=True)
    plant.set_joints("human", [0.3, 0.2, 0.1, 1.2, 0.1, 0.2, 0.1], [0.5, -0.4, 0.3, -0.2, 0.1, 0.2, 0.3])
    plant.reset([0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5], [0.3, -0.2, 0.1, 0.4, -0.5, 0.6, 0.7])
    grip = Bushing("panda_hand", "human::r_wrist", at(0.01, 0.02, 0.1), at(0, -0.05, 0.03), 100.0, 10.0, 3.0, 0.5)
    plant.connect("grip", grip)
    for _ in range(3):
        (T_hand, v_hand), (T_wrist, v_wrist) = map(plant.link_state, ("panda_hand", "human::r_wrist"))
        plant.apply([0.0] * 7)
        plant.step()
        p_hand, p_wrist = (T_hand @ grip.T_a_grip)[:3, 3], (T_wrist @ grip.T_b_grip)[:3, 3]
        speeds = [v[:3] + np.cross(v[3:], p_wrist - T[:3, 3]) for T, v in ((T_hand, v_hand), (T_wrist, v_wrist))]
        force = 100.0 * (p_wrist - p_hand) + 10.0 * (speeds[1] - speeds[0])
        torque = 3.0 * pinocchio.log3(T_wrist[:3, :3] @ T_hand[:3, :3].T) + 0.5 * (v_wrist - v_hand)[3:]
        load = plant.bushing_load("grip")
        assert np.array(load.point) == pytest.approx(p_wrist, abs=1e-12)
        assert np.array(load.force) == pytest.approx(force, abs=1e-10)
        assert np.array(load.torque) == pytest.approx(torque, abs=1e-10)


def test_bodies_that_turn_far_while_they_are_held_together_keep_their_momentum(plant):
    """Their joint frames are laid again on the way, and the model is built again for it."""
    places, frames = {"one": at(3.0, 0.0, 1.0), "two": at(3.2, 0.0, 1.0)}, set()
    for name, T in places.items():
        plant.spawn(name, STICK, T)
    plant.connect("rod", Bushing("one::body", "two::body", at(0.1, 0, 0), at(-0.1, 0, 0)))
    plant.apply_wrench("two::body", [0.0, 40.0, 0.0], [4.0, 8.0, 1.0], STILL, 0.05)
    run(plant, 50)
    momentum = {}
    for _ in range(2):
        momentum, before = {}, momentum
        for name in places:
            T, twist = plant.link_state(f"{name}::body")
            R = T[:3, :3]
            spin = R @ np.diag([0.02, 0.03, 0.04]) @ R.T @ twist[3:]
            momentum[name] = np.concatenate([twist[:3], np.cross(T[:3, 3], twist[:3]) + spin])
        for _ in range(10):
            run(plant, 60)
            frames.add(plant.world.models["two"].T_world_origin.tobytes())
    change, total = sum(momentum.values()) - sum(before.values()), sum(before.values())
    assert len(frames) > 1
    assert np.abs(change[:3]).max() < 1e-9
    assert np.abs(change[3:]).max() < 1e-3 * np.abs(total[3:]).max()


def test_joint_loads_are_empty_after_a_build_until_the_next_step(plant):
    plant.spawn("fingers", FINGERS, at(3, 0, 1), fixed=True)
    run(plant, 1)
    assert plant.joint_reactions() != []
    plant.spawn("stick", STICK, at(5, 0, 1))
    assert plant.joint_reactions() == []
