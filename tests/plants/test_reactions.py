"""Joint reactions compared with pinocchio's inverse dynamics, also with contacts and external wrenches."""

import numpy as np
import pinocchio
import pytest

import panda_description
from hric_control.plant import Bushing

OPENSIM, MUJOCO = "opensim_ros_control/OpenSimPlant", "mujoco_ros_control/MujocoPlant"
POSE = [0.1, -0.5, 0.2, -2.0, 0.3, 1.5, 0.4]
STILL = [0.0, 0.0, 0.0]
HOOK = '<robot name="hook"><link name="body"/></robot>'


@pytest.fixture(params=[OPENSIM, MUJOCO], ids=lambda name: name.rpartition("/")[2])
def plant_type(request):
    """Plants that report joint reactions."""
    return request.param


def acceleration(urdf, rotor, q, dq, tau):
    model = pinocchio.buildModelFromXML(urdf)
    model.armature = np.full(model.nv, rotor)
    return np.array(pinocchio.aba(model, model.createData(), q, dq, tau - model.damping * dq))


def loads(urdf, q, dq, ddq):
    """Return origin, force and torque of each joint on its child link, in the world frame."""
    model = pinocchio.buildModelFromXML(urdf)
    data = model.createData()
    pinocchio.rnea(model, data, q, dq, ddq)
    pinocchio.forwardKinematics(model, data, q)
    turns = [np.array(data.oMi[j].rotation) for j in range(model.njoints)]
    return [
        (np.array(data.oMi[j].translation), turns[j] @ data.f[j].linear, turns[j] @ data.f[j].angular)
        for j in range(1, model.njoints)
    ]


def error(plant, expected):
    found = plant.joint_reactions()
    assert [reaction.joint for reaction in found] == list(plant.joint_names)
    pairs = [
        (vector, target)
        for reaction, row in zip(found, expected, strict=True)
        for vector, target in zip(vectors(reaction), row, strict=True)
    ]
    return max(np.abs(np.array(vector) - target).max() for vector, target in pairs)


def vectors(reaction):
    return reaction.position, reaction.force, reaction.torque


@pytest.mark.parametrize("rotor", [0.0, 0.1])
@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
def test_joint_loads_of_a_moving_arm_are_those_of_its_inverse_dynamics(make_plant, plant_type, rng, integrator, rotor):
    panda_urdf = panda_description.load(meshes=False, collision=False, damping=1.0)
    plant = make_plant(panda_urdf, rotor_inertia=rotor, integrator=integrator, half_step_readout=False)
    plant.reset(POSE, rng.uniform(-1.0, 1.0, 7))
    q, dq = map(np.array, plant.engine_state())
    assert plant.joint_reactions() == []
    tau = rng.uniform(-5.0, 5.0, 7)
    plant.apply(tau)
    plant.step()
    q_end, dq_end = map(np.array, plant.engine_state())
    ddq = (dq_end - dq) / 1e-3
    if integrator == "semi_implicit":
        assert error(plant, loads(panda_urdf, q, dq, ddq)) < 1e-9
    elif plant_type == OPENSIM:  # in the middle of the step
        assert error(plant, loads(panda_urdf, 0.5 * (q + q_end), 0.5 * (dq + dq_end), ddq)) < 1e-9
    else:  # at its end, as the last stage of Runge and Kutta's method has it: damping makes that differ from the end
        ddq = acceleration(panda_urdf, rotor, q_end, dq_end, tau)
        assert error(plant, loads(panda_urdf, q_end, dq_end, ddq)) < (5e-6 if rotor else 5e-3)


def test_a_wrench_on_the_hand_goes_through_all_joints(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=POSE, gravity=STILL)
    plant.set_brakes([True] * 7)
    force, torque = np.array([3.0, -8.0, 5.0]), np.array([0.4, -0.3, 0.9])
    plant.apply_wrench("panda_hand", force, torque, STILL, -1.0)
    plant.apply([0.0] * 7)
    plant.step()
    hand = plant.link_state("panda_hand")[0][:3, 3]
    for reaction in plant.joint_reactions():
        assert np.array(reaction.force) == pytest.approx(-force, abs=1e-9)
        assert np.array(reaction.torque) == pytest.approx(-torque - np.cross(hand - reaction.position, force), abs=1e-9)


def test_what_is_connected_to_the_hand_pulls_through_all_joints(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=POSE, gravity=STILL)
    plant.set_brakes([True] * 7)
    T_world_hook = plant.link_state("panda_hand")[0]
    T_world_hook[:3, 3] += [0.01, -0.02, 0.005]
    plant.spawn("hook", HOOK, T_world_hook, fixed=True)
    T_hand_grip = np.eye(4)
    T_hand_grip[:3, 3] = 0.1, 0.2, 0.3
    plant.connect("string", Bushing("hook::body", "panda_hand", np.eye(4), T_hand_grip, 100.0, 0.0, 1.0, 0.0))
    plant.apply([0.0] * 7)
    plant.step()
    load = plant.bushing_load("string")
    force, torque, point = np.array(load.force), np.array(load.torque), np.array(load.point)
    assert np.linalg.norm(force) > 30.0
    for reaction in plant.joint_reactions():
        assert np.array(reaction.force) == pytest.approx(force, abs=1e-9)
        assert np.array(reaction.torque) == pytest.approx(torque + np.cross(point - reaction.position, force), abs=1e-9)


def test_what_presses_on_the_hand_is_carried_by_the_first_joint(make_plant, panda_urdf, tmp_path):
    """Check a ball on a contact spring: the arm's base carries the weight of the arm and the reported contact force."""
    hand = make_plant(panda_urdf, q=POSE).link_state("panda_hand")[0][:3, 3]
    world = tmp_path / "world.yaml"
    at = [float(hand[0]), float(hand[1]), float(hand[2]) + 0.093]
    world.write_text(
        f"objects: [{{name: ball, shape: sphere, size: 0.06, pose: {{xyz: {at}}}, contact: penalty, "
        f"stiffness: 20000.0}}]"
    )
    plant = make_plant(panda_urdf, q=POSE, world=str(world), gravity=STILL)
    plant.set_brakes([True] * 7)
    plant.apply([0.0] * 7)
    plant.step()
    on_hand = sum(
        c.force * (1 if c.body_a.startswith("panda::") else -1) * np.array(c.normal) for c in plant.contacts()
    )
    assert np.linalg.norm(on_hand) > 1.0
    assert np.array(plant.joint_reactions()[0].force) == pytest.approx(-on_hand, abs=1e-9)
