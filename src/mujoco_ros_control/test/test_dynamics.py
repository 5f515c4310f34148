"""The engine's motion against a second rigid-body library and conserved quantities."""

import numpy as np
import pinocchio
import pytest
from rigid_body_oracle import Oracle, plant_pd_run, wide

import panda_description
from hric_control.plants import sigmoid_torque

GOAL = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
SWING = [0.1, -0.5, 0.2, -2.0, 0.1, 1.5, 0.5]


@pytest.mark.parametrize("inertials", ["barycentric", "thesis"])
def test_mass_matrix_equals_the_second_library_also_where_no_body_has_the_tensors(make_plant, rng, inertials):
    urdf = panda_description.load(inertials=inertials, meshes=False)
    plant, oracle = make_plant(urdf, collision=False), Oracle(urdf)
    for q in rng.uniform(-2.8, 2.8, (50, 7)):
        plant.set_configuration(q)
        assert np.abs(plant.mass_matrix() - oracle.mass_matrix(q)).max() < 1e-12


@pytest.mark.parametrize(
    ("rotor", "damping", "kd"), [(0.0, 0.0, 5.0), (0.0, 1.0, 5.0), (0.1, 0.0, 10.0), (0.1, 1.0, 10.0)]
)
def test_the_raw_step_of_the_thesis_is_that_of_the_reference_integration(make_plant, rotor, damping, kd):
    urdf = wide(panda_description.load(meshes=False, damping=damping))
    oracle, plant = Oracle(urdf, rotor, damping=damping), make_plant(urdf, rotor_inertia=rotor, self_collision=False)
    expected = oracle.pd_run(GOAL, 50.0, kd, 4.0, np.zeros(7))
    error = np.abs(plant_pd_run(plant, oracle.gravity, GOAL, 50.0, kd, 4.0) - expected).max()
    print(f"rotor inertia {rotor}, damping {damping}: {error:.1e} rad")
    assert error < (1e-9 if rotor else 1e-6 if damping else 1e-8)


# Without rotors the wrist comes to 100 rad/s, and the swing is chaotic: starts 1e-12 rad apart lose between 1.5e-7 and
# 1.9e-6 of the energy at 1 ms. So that arm takes half the step here.
@pytest.mark.parametrize(("rotor", "time_step"), [(0.1, 1e-3), (0.0, 5e-4)])
def test_ten_seconds_of_free_swing_keep_the_energy(make_plant, wide_panda_urdf, rotor, time_step):
    oracle = Oracle(wide_panda_urdf, rotor)
    plant = make_plant(wide_panda_urdf, rotor_inertia=rotor, collision=False, time_step=time_step)
    plant.reset(SWING)
    kinetic, total = [], []
    for step in range(round(10.0 / time_step) + 1):
        if step % 10 == 0:
            q, dq = map(np.array, plant.engine_state())
            kinetic.append(0.5 * dq @ oracle.mass_matrix(q) @ dq + 0.5 * rotor * dq @ dq)
            total.append(kinetic[-1] + pinocchio.computePotentialEnergy(oracle.model, oracle.data, q))
        plant.apply([0.0] * 7)
        plant.step()
    drift = np.abs(np.array(total) - total[0]).max() / max(kinetic)
    print(
        f"rotor inertia {rotor}, steps of {1e3 * time_step:g} ms: energy within {100 * drift:.1e} % of the largest "
        f"kinetic energy, {max(kinetic):.0f} J"
    )
    assert max(kinetic) > 50.0
    assert drift < 1e-6


def test_a_minute_of_holding_by_a_law_drifts_by_less_than_a_nanoradian(make_plant, panda_urdf):
    oracle, plant = Oracle(panda_urdf, 0.1), make_plant(panda_urdf, q=GOAL, rotor_inertia=0.1)
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    for _ in range(60000):
        plant.read_state(q, dq, tau)
        x = np.array(q)
        plant.apply(100.0 * (GOAL - x) - 10.0 * np.array(dq) + oracle.gravity(x))
        plant.step()
    drift = np.abs(np.array(q) - GOAL).max()
    print(f"drift {drift:.1e} rad")
    assert drift < 1e-9


def test_identified_friction_acts_within_the_step(make_plant, wide_panda_urdf):
    phi = {"phi1": [0.5] * 7, "phi2": [5.0] * 7, "phi3": [0.04] * 7}
    plant = make_plant(
        wide_panda_urdf, q=SWING, rotor_inertia=0.1, friction="identified", friction_parameters=phi, collision=False
    )
    oracle = Oracle(wide_panda_urdf, 0.1)
    oracle.acceleration = lambda q, dq, tau: pinocchio.aba(
        oracle.model, oracle.data, q, dq, tau - sigmoid_torque(dq, (0.5, 5.0, 0.04))
    )
    q, dq = np.array(SWING), np.zeros(7)
    for _ in range(1000):
        plant.apply([0.0] * 7)
        plant.step()
        q, dq = oracle.hold(q, dq, np.zeros(7))
    assert np.abs(np.array(plant.engine_state()[0]) - q).max() < 1e-7
    without = make_plant(wide_panda_urdf, q=SWING, rotor_inertia=0.1, collision=False)
    for _ in range(1000):
        without.apply([0.0] * 7)
        without.step()
    assert np.abs(np.array(without.engine_state()[0]) - q).max() > 1e-2
