"""Joints of models beside the robot: their motion, and what acts in them."""

import numpy as np
import pinocchio
import pytest
from rigid_body_oracle import Oracle, wide
from two_link import two_link_urdf

from hric_control.plant import Load
from hric_human.body import Subject, describe

JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]
SOMEWHERE = np.array([[0.36, 0.48, -0.8, 3.0], [-0.8, 0.6, 0.0, 1.0], [0.48, 0.64, 0.6, 2.0], [0.0, 0.0, 0.0, 1.0]])
"""A pose with a rotation about no axis of the world."""
FAR = np.eye(4) + np.outer([1, 0, 0, 0], [0, 0, 0, 3])


STIFFNESS = np.array([40.0, 40.0, 4.0, 20.0, 1.0, 0.5, 0.5])
"""[N m/rad]"""


@pytest.fixture(scope="session")
def arm_urdf():
    return describe(Subject(code="P50M", mass=78.2, height=1.759, sex="male", parts="right_arm")).urdf


def steps(plant, n):
    for _ in range(n):
        plant.apply([0.0] * len(plant.joint_names))
        plant.step()


def state(plant, model):
    q, dq = [], []
    plant.read_joints(model, q, dq)
    return np.array(q), np.array(dq)


def free_mass_matrix(urdf, q):
    """Of the joints of a model with a free base, the base's six first; pinocchio."""
    model = pinocchio.buildModelFromXML(urdf, pinocchio.JointModelFreeFlyer())
    full = np.concatenate([[0, 0, 0, 0, 0, 0, 1], q])
    upper = np.triu(pinocchio.crba(model, model.createData(), full))
    return upper + np.triu(upper, 1).T


def test_a_driven_human_arm_moves_as_a_fourth_order_integration_of_the_second_library(make_plant, arm_urdf):
    urdf = wide(arm_urdf)
    plant, oracle = make_plant(two_link_urdf(), JOINTS), Oracle(urdf)
    oracle.model.gravity.linear = SOMEWHERE[:3, :3].T @ [0.0, 0.0, -9.81]
    plant.spawn("arm", urdf, SOMEWHERE, fixed=True)
    q, dq = np.array([0.5, 0.4, 0.1, 1.0, 0.2, 0.1, -0.1]), np.linspace(-0.5, 0.5, 7)
    plant.set_joints("arm", q, dq)
    plant.reset([0.0, 0.0])
    assert np.abs(np.array(state(plant, "arm")) - [q, dq]).max() < 1e-12
    phase, worst, moved = np.arange(7.0), 0.0, 0.0
    for k in range(3000):
        target = 0.4 + 0.3 * np.sin(2e-3 * np.pi * k + phase)

        def law(q, dq, target=target):
            return oracle.gravity(q) + STIFFNESS * (target - q) - 0.1 * STIFFNESS * dq

        at, v = state(plant, "arm")
        worst, moved = max(worst, np.abs(at - q).max()), max(moved, np.abs(v).max())
        plant.drive_joints("arm", law(at, v))
        steps(plant, 1)
        q, dq = oracle.hold(q, dq, law(q, dq))
    print(f"within {worst:.1e} rad, speeds to {moved:.1f} rad/s")
    assert moved > 1.0
    assert worst < 1e-4


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("damping", [0.0, 0.8])
def test_a_step_knows_drive_damping_and_wrench(make_plant, integrator, damping):
    urdf, oracle = two_link_urdf(name="arm", damping=damping), Oracle(two_link_urdf(), damping=damping)
    plant = make_plant(two_link_urdf(), JOINTS, integrator=integrator, half_step_readout=False)
    plant.spawn("arm", urdf, FAR, fixed=True)
    q, dq, force = np.array([0.3, 0.2]), np.array([1.0, -2.0]), np.array([3.0, 0.0, 5.0])
    plant.set_joints("arm", q, dq)
    plant.drive_joints("arm", [0.7, -0.3])
    plant.apply_wrench("arm::link2", force, STILL, STILL, 1e-3)
    steps(plant, 1)
    law = oracle.acceleration if integrator == "semi_implicit" else oracle.middle_acceleration
    tau = np.array([0.7, -0.3]) + oracle.jacobian(q, "link2")[:3].T @ force
    assert np.abs(state(plant, "arm")[1] - dq - 1e-3 * law(q, dq, tau)).max() < 1e-8


def test_a_drive_stays_until_a_reset_and_not_longer(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.spawn("arm", two_link_urdf(name="arm"), FAR, fixed=True)
    plant.drive_joints("arm", [1.0, 0.0])
    steps(plant, 10)
    assert state(plant, "arm")[1][0] > 1e-3
    plant.reset([0.0, 0.0])
    steps(plant, 10)
    assert np.abs(state(plant, "arm")).max() == 0.0


def test_a_new_load_of_the_robot_leaves_arms_their_motion(make_plant):
    """Bit by bit: they are loaded again."""
    ends = []
    for changed in (False, True):
        plant = make_plant(two_link_urdf(), JOINTS)
        plant.spawn("arm", two_link_urdf(name="arm", damping=0.1), FAR, fixed=True)
        plant.spawn("free", two_link_urdf(name="free").replace('<link name="base"/>', BASE), 2 * FAR - np.eye(4))
        for model in ("arm", "free"):
            plant.set_joints(model, [0.1, 0.2], [0.3, -0.4])
            plant.drive_joints(model, [0.5, 0.1])
        steps(plant, 20)
        before = [*state(plant, "arm"), *state(plant, "free")]
        if changed:
            plant.set_load(Load(1.0))
            assert np.array_equal(before, [*state(plant, "arm"), *state(plant, "free")])
        steps(plant, 20)
        ends.append([*state(plant, "arm"), *state(plant, "free")])
    assert np.abs(np.subtract(*ends)).max() < 1e-12


BASE = """<link name="base"><inertial><origin xyz="0.1 0 0.05"/><mass value="0.7"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.01" ixy="0.001" ixz="0" iyz="0"/></inertial></link>"""


def floating(name="free", **properties):
    """Return two links on a base that moves freely."""
    return two_link_urdf(name=name, **properties).replace('<link name="base"/>', BASE)


def test_a_model_with_a_free_base_is_driven_against_its_base(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.spawn("free", floating(), SOMEWHERE)
    plant.set_joints("free", [0.3, 0.2])
    plant.drive_joints("free", [0.7, -0.3])
    steps(plant, 1)
    expected = 1e-3 * np.linalg.solve(free_mass_matrix(floating(), [0.3, 0.2]), [0.0] * 6 + [0.7, -0.3])
    assert np.abs(state(plant, "free")[1] - expected[6:]).max() < 1e-9


@pytest.mark.parametrize("fixed", [True, False])
def test_damping_of_any_size_brings_the_joints_of_a_model_to_rest(make_plant, fixed):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.spawn("model", floating(damping=1000.0), SOMEWHERE, fixed=fixed)
    plant.set_joints("model", [0.3, 0.2], [1.0, -2.0])
    speeds = []
    for _ in range(200):
        steps(plant, 1)
        speeds.append(np.abs(state(plant, "model")[1]).max())
    assert max(speeds) <= 2.0
    assert speeds[-1] < 1e-3


@pytest.mark.parametrize("fixed", [True, False])
def test_coulomb_friction_holds_the_joints_of_a_model_where_the_robot_has_it(make_plant, fixed):
    for friction, moves in (("none", True), ("coulomb", False)):
        plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL, friction=friction)
        plant.spawn("model", floating(friction=0.5), SOMEWHERE, fixed=fixed)
        plant.drive_joints("model", [0.45, 0.1])
        steps(plant, 100)
        assert (np.abs(state(plant, "model")[0]).max() > 1e-3) == moves


def test_the_stop_of_a_model_with_a_free_base_holds(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.spawn("free", floating(), SOMEWHERE)
    plant.set_joints("free", [1.9, 0.0])
    plant.drive_joints("free", [2.0, 0.0])
    top = 0.0
    for _ in range(1000):
        steps(plant, 1)
        top = max(top, state(plant, "free")[0][0])
    assert 2.0 < top < 2.05


def test_a_model_in_the_memory_of_another_has_its_own_mass(make_plant):
    """The engine's mass matrix would be that of the one that was deleted."""
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    for scale in (1.0, 5.0):
        urdf = floating().replace('<mass value="2.0"/>', f'<mass value="{2.0 * scale}"/>')
        plant.spawn("free", urdf, SOMEWHERE)
        expected = np.linalg.inv(free_mass_matrix(urdf, [0.0, 0.0]))[6:, 6:]
        assert np.abs(plant.world.joints["free"].mobility() - expected).max() < 1e-9 * np.abs(expected).max()
        plant.delete("free")
