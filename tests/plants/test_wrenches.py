"""External wrenches on the robot and on free models."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle
from two_link import two_link_urdf

POSE = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]


def steps(plant, n):
    for _ in range(n):
        plant.apply([0.0] * len(plant.joint_names))
        plant.step()
    return [np.array(part) for part in plant.engine_state()]


@pytest.mark.parametrize("rotor", [0.0, 0.1])
@pytest.mark.parametrize("link", ["panda_link3", "panda_hand", "panda_hand_tcp"])
def test_a_wrench_accelerates_the_arm_by_its_jacobian(make_plant, panda_urdf, rotor, link):
    plant = make_plant(panda_urdf, rotor_inertia=rotor, half_step_readout=False, integrator="semi_implicit")
    oracle = Oracle(panda_urdf, rotor)
    q, dq = np.array(POSE), np.linspace(-0.5, 0.5, 7)
    plant.reset(q, dq)
    force, torque, point = np.array([3.0, -8.0, 5.0]), np.array([0.4, -0.3, 0.9]), np.array([0.02, -0.05, 0.1])
    plant.apply_wrench(link, force, torque, point, 0.003)
    T, J = oracle.frame(q, link), oracle.jacobian(q, link)
    tau = J.T @ np.concatenate([force, torque + np.cross(T[:3, :3] @ point, force)])
    expected = dq + 1e-3 * oracle.acceleration(q, dq, tau)
    assert np.abs(steps(plant, 1)[1] - expected).max() < 1e-6


def test_a_wrench_ends_with_its_duration_and_can_be_cleared(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, rotor_inertia=0.0, gravity=STILL)
    inertia = Oracle(two_link_urdf()).mass_matrix(np.zeros(2))
    for clear in (False, True):
        plant.reset([0.0, 0.0])
        plant.apply_wrench("planar::link1", STILL, [0.0, 2.0, 0.0], STILL, -1.0 if clear else 0.010)
        steps(plant, 10)
        if clear:
            plant.clear_wrenches("link1")
        _q, dq = steps(plant, 20)
        assert dq == pytest.approx(np.linalg.solve(inertia, [2.0, 0.0]) * 0.010, rel=1e-3)


def test_a_wrench_on_a_free_model_gives_it_linear_and_angular_momentum(make_plant, tmp_path):
    block = """<robot name="block"><link name="body"><inertial><origin xyz="0.1 0 0" rpy="0 0 0.4"/><mass value="2"/>
      <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    T = np.eye(4)
    T[:3, 3] = [3.0, 0.0, 1.0]
    plant.spawn("block", block, T)
    plant.apply_wrench("block::body", [4.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.1, 0.05, 0.0], 0.005)
    steps(plant, 5)
    twist = plant.link_state("block::body")[1]
    assert twist[5] == pytest.approx(0.005 * (0.1 - 0.05 * 4.0) / 0.04, rel=1e-3)
    at_com = twist[:3] + np.cross(twist[3:], [0.1, 0.0, 0.0])
    assert at_com == pytest.approx([0.005 * 4.0 / 2.0, 0.0, 0.0], abs=1e-5)
