"""Forces and constraints in the joints: brakes, friction, stops, drives, wrenches."""

import numpy as np
import pytest
from rigid_body_oracle import Oracle
from two_link import two_link_urdf

import panda_description
from hric_control.plant import Load, Mode
from hric_core.errors import HricError

POSE = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]
JOINTS = ["joint1", "joint2"]
STILL = [0.0, 0.0, 0.0]


def steps(plant, n, tau=None):
    tau = [0.0] * len(plant.joint_names) if tau is None else tau
    for _ in range(n):
        plant.apply(tau)
        plant.step()
    return [np.array(part) for part in plant.engine_state()]


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_brakes_hold_a_loaded_arm_and_free_it_exactly(make_plant, panda_urdf, rotor):
    plant = make_plant(panda_urdf, rotor_inertia=rotor, q=POSE, self_collision=False)
    plant.set_load(Load(3.0, (0.0, 0.0, 0.1)))
    plant.set_brakes([True] * 7)
    for _ in range(20):
        q, _dq = steps(plant, 100, [5.0] * 7)
        assert np.abs(q - POSE).max() < 2e-6
    tau = [0.0] * 7
    plant.read_state([0.0] * 7, [0.0] * 7, tau)
    assert tau[3] > 15.0
    plant.set_brakes([False] * 7)
    fresh = make_plant(panda_urdf, rotor_inertia=rotor, half_step_readout=False, self_collision=False)
    fresh.set_load(Load(3.0, (0.0, 0.0, 0.1)))
    fresh.reset(*plant.engine_state())
    for robot in (plant, fresh):
        steps(robot, 100)
    assert np.abs(np.array(plant.engine_state()) - np.array(fresh.engine_state())).max() < 1e-9


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_partly_braked_arm_moves_as_an_arm_without_the_braked_joints(make_plant, rotor):
    plant = make_plant(two_link_urdf(), JOINTS, rotor_inertia=rotor, half_step_readout=False)
    plant.reset([0.3, 0.2])
    plant.set_brakes([True, False])
    q, dq = np.array([0.3, 0.2]), np.zeros(2)
    oracle = Oracle(two_link_urdf(), rotor)
    for _ in range(300):
        M, h = oracle.mass_matrix(q) + rotor * np.eye(2), oracle.bias(q, dq)
        dq[1] += 1e-3 * (-h[1] / M[1, 1])
        q[1] += 1e-3 * dq[1]
        plant.apply([0.0, 0.0])
        plant.step()
    assert np.abs(np.array(plant.engine_state()) - [q, dq]).max() < 1e-4


def test_brakes_stay_with_a_new_load_and_a_reset(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=POSE)
    plant.set_brakes([True] * 7)
    steps(plant, 10)
    plant.set_load(Load(1.0))
    assert np.abs(steps(plant, 200)[0] - POSE).max() < 2e-6
    plant.reset([x + 0.1 for x in POSE])
    assert np.abs(steps(plant, 200)[0] - POSE - 0.1).max() < 2e-6


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_coulomb_friction_holds_below_its_value_and_slides_above(make_plant, rotor):
    urdf = two_link_urdf(friction=0.5)
    plant = make_plant(urdf, JOINTS, friction="coulomb", rotor_inertia=rotor, gravity=STILL)
    plant.reset([0.0, 0.0])
    q, dq = steps(plant, 1000, [0.45, 0.0])
    assert np.abs(q).max() < 1e-6
    # Joint 2 is held by its friction: it moves with joint 1 as one body.
    q, dq = steps(plant, 1000, [0.55, 0.0])
    whole = Oracle(urdf).mass_matrix(np.zeros(2))[0, 0] + rotor
    assert dq[0] == pytest.approx(0.05 / whole, rel=2e-3)
    assert abs(dq[1]) < 1e-6


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_coulomb_friction_brakes_a_sliding_joint_by_its_value(make_plant, rotor):
    urdf = two_link_urdf(friction=0.5)
    plant = make_plant(urdf, JOINTS, friction="coulomb", rotor_inertia=rotor, gravity=STILL, half_step_readout=False)
    plant.reset([0.0, 0.0], [1.0, 0.0])
    _q, dq = steps(plant, 100)
    whole = Oracle(urdf).mass_matrix(np.zeros(2))[0, 0] + rotor
    assert dq[0] == pytest.approx(1.0 - 0.1 * 0.5 / whole, abs=1e-3)


def test_urdf_friction_does_nothing_unless_requested(make_plant):
    plant = make_plant(two_link_urdf(friction=0.5), JOINTS, rotor_inertia=0.0, gravity=STILL)
    plant.reset([0.0, 0.0])
    assert steps(plant, 100, [0.1, 0.0])[1][0] > 1e-3


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_urdf_damping_acts(make_plant, rotor, integrator):
    plant = make_plant(
        two_link_urdf(damping=0.8), JOINTS, rotor_inertia=rotor, integrator=integrator, half_step_readout=False
    )
    q, dq = np.array([0.3, 0.2]), np.array([1.0, -2.0])
    plant.reset(q, dq)
    oracle = Oracle(two_link_urdf(), rotor, damping=0.8)
    law = oracle.acceleration if integrator == "semi_implicit" else oracle.middle_acceleration
    assert np.abs(steps(plant, 1)[1] - dq - 1e-3 * law(q, dq, np.zeros(2))).max() < 1e-9


@pytest.mark.parametrize("integrator", ["accurate", "semi_implicit"])
@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_identified_friction_is_the_published_sigmoid(make_plant, panda_urdf, rotor, integrator):
    parameters = panda_description.friction_parameters()
    config = {
        "rotor_inertia": rotor,
        "integrator": integrator,
        "half_step_readout": False,
        "friction": "identified",
        "friction_parameters": parameters,
    }
    plant, oracle = make_plant(panda_urdf, **config), Oracle(panda_urdf, rotor)
    q, dq = np.array(POSE), np.linspace(-2.0, 2.0, 7)
    phi1, phi2, phi3 = (np.array([parameters[f"panda_joint{i}"][f"phi{k}"] for i in range(1, 8)]) for k in (1, 2, 3))

    def tau_f(u):
        return phi1 / (1 + np.exp(-phi2 * (u + phi3))) - phi1 / (1 + np.exp(-phi2 * phi3))

    plant.reset(q, dq)
    middle = integrator == "accurate"
    expected = (
        oracle.middle_acceleration(q, dq, np.zeros(7), tau_f) if middle else oracle.acceleration(q, dq, -tau_f(dq))
    )
    assert np.abs(steps(plant, 1)[1] - dq - 1e-3 * expected).max() < (1e-6 if middle else 1e-9)


def test_damping_of_any_size_brings_a_joint_to_rest(make_plant):
    """Taken at the velocity of the middle of the step; at that of its beginning this much would blow up."""
    plant = make_plant(two_link_urdf(damping=1000.0), JOINTS, rotor_inertia=0.0, gravity=STILL)
    plant.reset([0.3, 0.2], [1.0, -2.0])
    speeds = [np.abs(steps(plant, 1)[1]).max() for _ in range(200)]
    assert max(speeds) <= 2.0
    assert speeds[-1] < 1e-3


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_stop_holds_a_pushing_joint(make_plant, rotor):
    plant = make_plant(two_link_urdf(), JOINTS, rotor_inertia=rotor, gravity=STILL)
    plant.reset([1.9, 0.0])
    top = 0.0
    for _ in range(150):
        top = max(top, steps(plant, 10, [20.0, 0.0])[0][0])
    assert top < 2.02
    q, _dq = steps(plant, 500, [20.0, 0.0])
    assert q[0] == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_a_stop_acts_only_once_the_joint_has_been_inside(make_plant, rotor):
    plant = make_plant(two_link_urdf(), JOINTS, rotor_inertia=rotor, gravity=STILL)
    plant.reset([2.3, 0.0])
    acceleration = Oracle(two_link_urdf(axis="0 0 1"), rotor).acceleration(
        np.zeros(2), np.zeros(2), np.array([1.0, 0.0])
    )
    q, dq = steps(plant, 100, [1.0, 0.0])
    # Outside, nothing hinders it, in either direction.
    assert q[0] == pytest.approx(2.3 + 0.5 * 0.1**2 * acceleration[0], abs=5e-4)
    for _ in range(3000):
        q, dq = steps(plant, 1, [-3.0 - 5.0 * dq[0], -5.0 * dq[1]])
        if q[0] < 1.9:
            break
    assert q[0] < 1.9
    for _ in range(300):
        q, dq = steps(plant, 10, [5.0, 0.0])
    assert q[0] == pytest.approx(2.0, abs=2e-3)


def test_a_new_load_leaves_a_waiting_stop_open(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS, gravity=STILL)
    plant.reset([2.3, 0.0])
    plant.set_load(Load(0.5))
    q, _dq = steps(plant, 300, [1.0, 0.0])
    assert q[0] > 2.31


@pytest.mark.parametrize("rotor", [0.0, 0.1])
def test_velocity_and_position_drives_follow_their_targets_under_gravity(make_plant, rotor):
    urdf = two_link_urdf(limit='lower="-2" upper="2" effort="50000" velocity="50"')
    plant = make_plant(urdf, JOINTS, rotor_inertia=rotor)
    plant.reset([0.3, 0.2])
    plant.set_modes([Mode.VELOCITY, Mode.POSITION])
    q, dq = steps(plant, 200, [0.5, 0.4])
    assert q == pytest.approx([0.4, 0.4], abs=2e-4)
    assert dq == pytest.approx([0.5, 0.0], abs=1e-4)
    tau = [0.0, 0.0]
    plant.read_state([0.0, 0.0], [0.0, 0.0], tau)
    assert abs(tau[0]) > 5.0
    plant.set_modes([Mode.EFFORT, Mode.EFFORT])
    fresh = make_plant(urdf, JOINTS, rotor_inertia=rotor, half_step_readout=False)
    fresh.reset(*plant.engine_state())
    assert np.abs(np.array(steps(plant, 50)) - np.array(steps(fresh, 50))).max() < 1e-9


def test_a_drive_gives_no_more_than_the_urdf_allows(make_plant):
    weak = two_link_urdf(limit='lower="-2" upper="2" effort="3" velocity="0.5"')
    plant = make_plant(weak, JOINTS, rotor_inertia=0.0, gravity=STILL)
    plant.reset([0.0, 0.0])
    plant.set_modes([Mode.POSITION, Mode.POSITION])
    _q, dq = steps(plant, 5, [1.0, 0.0])
    assert dq[0] == pytest.approx(3.0 * 5e-3 / Oracle(weak).mass_matrix(np.zeros(2))[0, 0], rel=0.02)
    _q, dq = steps(plant, 400, [1.0, 0.0])
    assert dq[0] == pytest.approx(0.5, abs=1e-6)


def test_a_model_that_diverges_is_reported_and_not_passed_on(make_plant):
    plant = make_plant(two_link_urdf(), JOINTS)
    plant.apply([float("nan"), 0.0])
    with pytest.raises(HricError, match="diverged"):
        plant.step()
