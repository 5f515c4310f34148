"""The engine's dynamics against a second rigid-body library."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle, plant_pd_run, wide

import panda_description
from hric_control.plant import Load
from hric_core.urdf import read
from pybullet_ros_control.joint_dynamics import Losses, make_dynamics
from pybullet_ros_control.urdf_model import prepare

GOAL = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])


@pytest.mark.parametrize("inertials", ["barycentric", "thesis"])
def test_mass_matrix_equals_the_second_library_for_both_inertial_sets(make_plant, rng, inertials):
    urdf = panda_description.load(inertials=inertials, meshes=False)
    plant, oracle = make_plant(urdf, collision=False), Oracle(urdf)
    worst = 0.0
    for q in rng.uniform(-2.8, 2.8, (200, 7)):
        plant.set_configuration(q)
        worst = max(worst, np.abs(plant.mass_matrix() - oracle.mass_matrix(q)).max())
    print(inertials, worst)
    assert worst < 1e-9


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("inertials", ["barycentric", "thesis"])
def test_forward_dynamics_of_one_step_equals_the_second_library(make_plant, rng, inertials, integrator):
    urdf = panda_description.load(inertials=inertials, meshes=False)
    worst = 0.0
    for rotor in (0.0, 0.1):
        plant = make_plant(urdf, collision=False, rotor_inertia=rotor, integrator=integrator, half_step_readout=False)
        oracle = Oracle(urdf, rotor)
        acceleration = oracle.acceleration if integrator == "semi_implicit" else oracle.middle_acceleration
        for _ in range(50):
            q, dq, tau = (
                rng.uniform(0.1, 1.5, 7) * [1, 1, 1, -1, 1, 1, 1],
                rng.uniform(-2, 2, 7),
                rng.uniform(-20, 20, 7),
            )
            plant.reset(q, dq)
            plant.apply(tau)
            plant.step()
            expected = dq + 1e-3 * acceleration(q, dq, tau)
            worst = max(worst, np.abs(np.array(plant.engine_state()[1]) - expected).max())
    print(inertials, integrator, worst)
    # Two passes come so near to the implicit midpoint rule; the engine's own step has rounding only.
    assert worst < (1e-9 if integrator == "semi_implicit" else 1e-7)


@pytest.mark.parametrize(
    ("rotor", "damping", "kd", "tolerance"),
    [(0.0, 0.0, 5.0, 1e-4), (0.0, 1.0, 5.0, 2e-4), (0.1, 0.0, 10.0, 2e-5), (0.1, 1.0, 10.0, 2e-5)],
)
def test_raw_step_stays_near_a_fourth_order_integration(make_plant, rotor, damping, kd, tolerance):
    urdf = wide(panda_description.load(meshes=False, damping=damping))
    oracle, plant = Oracle(urdf, rotor, damping=damping), make_plant(urdf, rotor_inertia=rotor, self_collision=False)
    expected = oracle.pd_run(GOAL, 50.0, kd, 4.0, np.zeros(7))
    error = np.abs(plant_pd_run(plant, oracle.gravity, GOAL, 50.0, kd, 4.0) - expected).max()
    print(f"rotor inertia {rotor}, damping {damping}, Kp 50, Kd {kd}: {error:.1e} rad")
    assert error < tolerance
    assert np.abs(expected[-1] - GOAL).max() < 5e-3


@pytest.mark.parametrize(("rotor", "share"), [(0.0, 0.01), (0.1, 0.001)])
def test_ten_seconds_of_free_swing_keep_the_energy(make_plant, wide_panda_urdf, rotor, share):
    import pinocchio

    oracle, plant = Oracle(wide_panda_urdf, rotor), make_plant(wide_panda_urdf, rotor_inertia=rotor, collision=False)
    plant.reset([0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5])
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    kinetic, total = [], []
    for step in range(10001):
        plant.read_state(q, dq, tau)
        if step % 10 == 0:
            at, v = np.array(q), np.array(dq)
            kinetic.append(0.5 * v @ oracle.mass_matrix(at) @ v + 0.5 * rotor * v @ v)
            total.append(kinetic[-1] + pinocchio.computePotentialEnergy(oracle.model, oracle.data, at))
        plant.apply([0.0] * 7)
        plant.step()
    drift = np.abs(np.array(total) - total[0]).max() / max(kinetic)
    print(
        f"rotor inertia {rotor}: energy within {100 * drift:.3f} % of the largest kinetic energy, {max(kinetic):.0f} J"
    )
    assert max(kinetic) > 50.0
    assert drift < share


@pytest.mark.parametrize("inertials", ["barycentric", "thesis"])
def test_the_plants_own_model_equals_the_second_library(rng, inertials):
    urdf = panda_description.load(inertials=inertials, xyz="0.3 -0.2 0.5", rpy="0.1 -0.2 0.3", meshes=False)
    oracle, model = Oracle(urdf), prepare(read(urdf))
    dynamics = make_dynamics(
        model, list(model.joints), [Losses()] * len(model.joints), (0.0, 0.0, -9.81), 1e-3, second_order=True
    )
    for _ in range(100):
        q = rng.uniform(-2.8, 2.8, oracle.model.nv)
        mobility = np.array(dynamics.mobility(q.tolist())).reshape(7, 7)
        assert np.abs(mobility @ oracle.mass_matrix(q) - np.eye(7)).max() < 1e-11


def test_the_plants_own_model_has_sliding_joints_and_branches(rng):
    """The open hand: two fingers slide on one link, behind seven turning joints."""
    urdf = panda_description.load(meshes=False, fingers="prismatic")
    oracle, model = Oracle(urdf), prepare(read(urdf))
    names = [oracle.model.names[i] for i in range(1, oracle.model.njoints)]
    assert len(names) == 9 and set(names) == set(model.joints)
    dynamics = make_dynamics(model, names, [Losses()] * 9, (0.0, 0.0, -9.81), 1e-3, second_order=True)
    law = np.vstack([np.eye(8), np.eye(8)[7]])  # the second finger mimics the first one
    for _ in range(20):
        q = rng.uniform(-1.0, 1.0, 9)
        mobility = np.array(dynamics.mobility(q.tolist())).reshape(9, 9)
        expected = law @ np.linalg.inv(law.T @ oracle.mass_matrix(q) @ law) @ law.T
        assert np.abs(mobility - expected).max() < 1e-11


def test_what_has_not_the_size_of_the_robot_is_refused_and_not_read(panda_urdf):
    model = prepare(read(panda_urdf))
    dynamics = make_dynamics(model, list(model.joints), [Losses()] * 7, (0.0, 0.0, -9.81), 1e-3, second_order=True)
    seven = [0.0] * 7
    for short in (
        (seven[:6], seven, seven, None, None),
        (seven, seven, seven, seven[:6], None),
        (seven, seven, seven, None, [None] * 6),
    ):
        with pytest.raises(ValueError, match=r"7 (numbers|values) are needed, got 6"):
            dynamics.torque(*short)
    with pytest.raises(TypeError):
        dynamics.torque(seven, None, seven, None, None)
    with pytest.raises(TypeError):
        dynamics.torque(seven, list("abcdefg"), seven, None, None)


def test_link_states_equal_the_second_library(make_plant, panda_urdf, rng):
    plant, oracle = make_plant(panda_urdf), Oracle(panda_urdf)
    for _ in range(20):
        q, dq = rng.uniform(-1.5, -0.1, 7) * [1, 1, 1, 1, 1, -1, 1], rng.uniform(-1, 1, 7)
        plant.reset(q, dq)
        raw = np.array(plant.engine_state()[0])
        for link in ("world", "panda_link0", "panda_link4", "panda_link8", "panda_hand", "panda_hand_tcp"):
            T, twist = plant.link_state(link)
            assert np.abs(T - oracle.frame(raw, link)).max() < 1e-6
            assert np.abs(twist - oracle.jacobian(raw, link) @ dq).max() < 1e-6


def test_base_pose_of_the_description_is_kept(make_plant):
    urdf = panda_description.load(xyz="0.3 -0.2 0.5", rpy="0.1 -0.2 0.3", meshes=False)
    plant, oracle = make_plant(urdf), Oracle(urdf)
    q = np.array([0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5])
    plant.reset(q)
    T, _ = plant.link_state("panda_hand_tcp")
    assert np.abs(T - oracle.frame(q, "panda_hand_tcp")).max() < 1e-6
    assert np.abs(plant.mass_matrix() - oracle.mass_matrix(q)).max() < 1e-9


def test_payload_enters_the_mass_matrix_and_keeps_the_state(make_plant, panda_urdf):
    import pinocchio

    load = Load(1.2, (0.01, -0.02, 0.05), (2e-3, 1e-4, 0.0, 1e-4, 3e-3, 0.0, 0.0, 0.0, 1e-3))
    plant, oracle = make_plant(panda_urdf), Oracle(panda_urdf)
    q, dq = np.array([0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]), np.linspace(-1, 1, 7)
    plant.reset(q, dq)
    before = plant.engine_state()
    plant.set_load(load, "panda_link8")
    frame = oracle.model.frames[oracle.model.getFrameId("panda_link8")]
    body = pinocchio.Inertia(load.mass, np.array(load.com), np.array(load.inertia).reshape(3, 3))
    oracle.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    raw = np.array(before[0])
    assert plant.engine_state() == before
    assert np.abs(plant.mass_matrix() - oracle.mass_matrix(raw)).max() < 1e-9
    plant.set_load(None)
    assert plant.engine_state() == before
    assert np.abs(plant.mass_matrix() - Oracle(panda_urdf).mass_matrix(raw)).max() < 1e-9


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_change_of_load_in_motion_continues_as_with_that_load_from_there(make_plant, wide_panda_urdf, rotor):
    load = Load(2.0, (0.0, 0.0, 0.1))
    q = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
    changed = make_plant(wide_panda_urdf, q=q, rotor_inertia=rotor)
    for _ in range(50):
        changed.apply([1.0] * 7)
        changed.step()
    changed.set_load(load)
    fresh = make_plant(wide_panda_urdf, rotor_inertia=rotor, half_step_readout=False)
    fresh.set_load(load)
    fresh.reset(*changed.engine_state())
    for plant in (changed, fresh):
        for _ in range(200):
            plant.apply([1.0] * 7)
            plant.step()
    assert np.abs(np.array(changed.engine_state()) - np.array(fresh.engine_state())).max() < 1e-9


def test_several_plants_live_in_one_process_without_seeing_each_other(make_plant, panda_urdf):
    q = [0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0]
    alone = make_plant(panda_urdf, q=q)
    states = []
    for plant in (
        alone,
        make_plant(panda_urdf, q=q, gravity=[0.0, 0.0, 0.0], time_step=0.002),
        make_plant(panda_urdf, q=q),
    ):
        for _ in range(50):
            plant.apply([0.0] * 7)
            plant.step()
        states.append(plant.engine_state())
    assert states[0] == states[2]
    assert states[0] != states[1]
