"""The plant's motion against a second rigid-body library, and against the other engine."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle, plant_pd_run

import panda_description
from hric_control.plant import Load

GOAL = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
POSE = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
JOINTS = ["joint1", "joint2"]


def steps(plant, n, tau):
    for _ in range(n):
        plant.apply(tau)
        plant.step()
    return np.array(plant.engine_state())


@pytest.mark.parametrize("inertials", ["barycentric", "thesis"])
def test_mass_matrix_equals_the_second_library_for_both_inertial_sets(make_plant, rng, inertials):
    urdf = panda_description.load(inertials=inertials, meshes=False, collision=False)
    plant, oracle = make_plant(urdf), Oracle(urdf)
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, 7)
        plant.reset(q.tolist())
        assert np.abs(plant.mass_matrix() - oracle.mass_matrix(q)).max() < 1e-12


@pytest.mark.parametrize(("rotor", "kp", "kd"), [(0.0, 50.0, 5.0), (0.1, 50.0, 10.0), (0.1, 200.0, 100.0)])
def test_the_accurate_integrator_stays_within_1e_5_rad_of_a_fourth_order_integration(
    make_plant, wide_panda_urdf, rotor, kp, kd
):
    oracle = Oracle(wide_panda_urdf, rotor)
    plant = make_plant(wide_panda_urdf, q=[0.0] * 7, rotor_inertia=rotor, effort_limits=False)
    expected = oracle.pd_run(GOAL, kp, kd, 2.0, np.zeros(7))
    error = np.abs(plant_pd_run(plant, oracle.gravity, GOAL, kp, kd, 2.0) - expected).max()
    print(f"rotor inertia {rotor}, gains {kp}/{kd}: {error:.1e} rad")
    assert error < 1e-5


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_the_semi_implicit_integrator_equals_pybullet(make_plant, wide_panda_urdf, rotor):
    from pybullet_ros_control.plant import PyBulletPlant

    gravity = Oracle(wide_panda_urdf).gravity
    ours = make_plant(
        wide_panda_urdf, q=[0.0] * 7, rotor_inertia=rotor, integrator="semi_implicit", effort_limits=False
    )
    other = PyBulletPlant(wide_panda_urdf, ours.joint_names, {"rotor_inertia": rotor, "integrator": "semi_implicit"})
    other.reset([0.0] * 7)
    runs = [plant_pd_run(plant, gravity, GOAL, 50.0, 5.0, 1.0) for plant in (ours, other)]
    other.close()
    error = np.abs(runs[0] - runs[1]).max()
    print(f"rotor inertia {rotor}: {error:.1e} rad")
    assert np.abs(runs[0] - runs[0][0]).max() > 1.0
    assert error < 1e-9


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_semi_implicit_step_is_dq_plus_dt_times_the_acceleration(make_plant, wide_panda_urdf, rng, rotor):
    plant, oracle = (
        make_plant(wide_panda_urdf, rotor_inertia=rotor, integrator="semi_implicit", half_step_readout=False),
        Oracle(wide_panda_urdf, rotor),
    )
    for _ in range(10):
        q, dq, tau = rng.uniform(-1.5, 1.5, 7), rng.uniform(-2, 2, 7), rng.uniform(-10, 10, 7)
        plant.reset(q.tolist(), dq.tolist())
        expected = dq + 1e-3 * oracle.acceleration(q, dq, tau)
        new_q, new_dq = steps(plant, 1, tau.tolist())
        assert np.abs(new_dq - expected).max() < 1e-9
        assert np.abs(new_q - q - 1e-3 * new_dq).max() < 1e-15


@pytest.mark.parametrize(("integrator", "half"), [("accurate", 0.0), ("semi_implicit", 0.5)])
def test_what_is_read_belongs_to_the_measuring_instant(make_plant, wide_panda_urdf, integrator, half):
    plant = make_plant(wide_panda_urdf, integrator=integrator)
    dq = np.linspace(-1, 1, 7)
    plant.reset(POSE, dq.tolist())
    q, read_dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    plant.read_state(q, read_dq, tau)
    assert q == pytest.approx(POSE, abs=1e-15)
    assert read_dq == dq.tolist()
    raw = plant.engine_state()[0]
    assert np.abs(np.array(raw) - np.array(POSE) - half * 1e-3 * dq).max() < 1e-15
    plant.apply([1.0] * 7)
    plant.step()
    plant.read_state(q, read_dq, tau)
    raw, raw_dq = (np.array(part) for part in plant.engine_state())
    assert q == pytest.approx((raw - half * 1e-3 * raw_dq).tolist(), abs=1e-15)
    assert plant.motor_effort() == [1.0] * 7
    assert tau == pytest.approx(
        (1.0 - np.array(panda_description.rotor_inertia()) * (raw_dq - dq) * 1e3).tolist(), abs=1e-12
    )


@pytest.mark.parametrize("config", [{"rotor_inertia": 0.0}, {"rotor_inertia": 0.1}])
def test_efforts_that_jump_every_step_are_held_exactly(make_plant, wide_panda_urdf, rng, config):
    plant, oracle = (
        make_plant(wide_panda_urdf, q=POSE, **config),
        Oracle(wide_panda_urdf, config["rotor_inertia"], steps_per_period=16),
    )
    q, dq = np.array(POSE), np.zeros(7)
    for _ in range(200):
        tau = oracle.gravity(q) + rng.choice([-4.0, 4.0], 7) * [1, 1, 1, 1, 0.1, 0.1, 0.1]
        q, dq = oracle.hold(q, dq, tau)
        state = steps(plant, 1, tau.tolist())
    assert np.abs(q - POSE).max() > 0.01
    assert np.abs(state - [q, dq]).max() < 1e-6


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_longer_time_step_is_integrated_as_accurately(make_plant, wide_panda_urdf, rotor):
    tau = [1.0, -2.0, 0.5, 1.0, 0.2, -0.2, 0.1]
    plant = make_plant(wide_panda_urdf, q=POSE, rotor_inertia=rotor, time_step=0.004)
    oracle = Oracle(wide_panda_urdf, rotor, control_period=0.004, steps_per_period=16)
    q, dq = np.array(POSE), np.zeros(7)
    for _ in range(25):
        q, dq = oracle.hold(q, dq, np.array(tau))
    assert np.abs(steps(plant, 25, tau)[0] - q).max() < 1e-5


def test_base_pose_and_gravity_of_the_description_are_kept(make_plant):
    urdf = panda_description.load(xyz="0.3 -0.2 0.5", rpy="0.1 -0.2 0.3", meshes=False, collision=False)
    plant, oracle = (
        make_plant(
            urdf,
            q=POSE,
            gravity=[1.0, -2.0, -9.0],
            rotor_inertia=0.0,
            integrator="semi_implicit",
            half_step_readout=False,
        ),
        Oracle(urdf),
    )
    oracle.model.gravity.linear = np.array([1.0, -2.0, -9.0])
    expected = 1e-3 * oracle.acceleration(np.array(POSE), np.zeros(7), np.zeros(7))
    assert np.abs(steps(plant, 1, [0.0] * 7)[1] - expected).max() < 1e-9


def test_link_states_equal_the_second_library(make_plant, panda_urdf, rng):
    plant, oracle = make_plant(panda_urdf), Oracle(panda_urdf)
    for _ in range(5):
        q, dq = rng.uniform(-1.5, 1.5, 7), rng.uniform(-1, 1, 7)
        plant.reset(q.tolist(), dq.tolist())
        for link in (
            "world",
            "panda_link0",
            "panda_link4",
            "panda_link8",
            "panda_hand",
            "panda_hand_tcp",
            "panda::panda_link4",
        ):
            T, twist = plant.link_state(link)
            name = link.removeprefix("panda::")
            assert np.abs(T - oracle.frame(q, name)).max() < 1e-12
            assert np.abs(twist - oracle.jacobian(q, name) @ dq).max() < 1e-12


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_payload_acts_from_where_the_arm_is_and_can_be_taken_off(make_plant, wide_panda_urdf, rotor):
    import pinocchio

    load = Load(1.2, (0.01, -0.02, 0.05), (2e-3, 1e-4, 0.0, 1e-4, 3e-3, 0.0, 0.0, 0.0, 1e-3))
    plant, oracle = make_plant(wide_panda_urdf, q=POSE, rotor_inertia=rotor), Oracle(wide_panda_urdf, rotor)
    steps(plant, 50, [1.0] * 7)
    before = np.array(plant.engine_state())
    plant.set_load(load, "panda_link8")
    frame = oracle.model.frames[oracle.model.getFrameId("panda_link8")]
    oracle.model.appendBodyToJoint(
        frame.parentJoint,
        pinocchio.Inertia(load.mass, np.array(load.com), np.array(load.inertia).reshape(3, 3)),
        frame.placement,
    )
    assert np.array_equal(plant.engine_state(), before)
    assert np.abs(plant.mass_matrix() - oracle.mass_matrix(before[0])).max() < 1e-12
    q, dq = before
    for _ in range(20):
        q, dq = oracle.hold(q, dq, np.ones(7))
    assert np.abs(steps(plant, 20, [1.0] * 7) - [q, dq]).max() < 1e-6
    plant.set_load(None)
    assert (
        np.abs(plant.mass_matrix() - Oracle(wide_panda_urdf).mass_matrix(np.array(plant.engine_state()[0]))).max()
        < 1e-12
    )


@pytest.mark.parametrize("config", [{"rotor_inertia": 0.0}, {"rotor_inertia": 0.1}])
def test_joints_may_be_named_in_any_order(make_plant, panda_urdf, config):
    tau = [1.0, 2.0, 3.0, 4.0, 0.5, 0.6, 0.7]
    straight = make_plant(panda_urdf, q=POSE, **config)
    turned = make_plant(panda_urdf, joints=list(straight.joint_names[::-1]), q=POSE[::-1], **config)
    assert np.array_equal(steps(straight, 20, tau), steps(turned, 20, tau[::-1])[:, ::-1])
    assert np.array_equal(straight.mass_matrix(), turned.mass_matrix()[::-1, ::-1])


def test_several_plants_live_in_one_process_without_seeing_each_other(make_plant, panda_urdf):
    alone = make_plant(panda_urdf, q=POSE, rotor_inertia=0.0)
    states = []
    for plant in (
        alone,
        make_plant(panda_urdf, q=POSE, gravity=[0.0, 0.0, 0.0], time_step=0.002),
        make_plant(panda_urdf, q=POSE, rotor_inertia=0.0),
    ):
        states.append(steps(plant, 30, [0.0] * 7))
    assert np.array_equal(states[0], states[2])
    assert not np.array_equal(states[0], states[1])


@pytest.mark.parametrize(
    "config", [{"rotor_inertia": 0.0}, {"rotor_inertia": 0.1}, {"rotor_inertia": 0.0, "integrator": "semi_implicit"}]
)
def test_a_reset_leads_to_the_same_motion_to_the_last_bit(make_plant, panda_urdf, config):
    plant = make_plant(panda_urdf, q=POSE, **config)
    first = steps(plant, 60, [1.0] * 7)
    plant.reset(POSE)
    assert np.array_equal(steps(plant, 60, [1.0] * 7), first)
