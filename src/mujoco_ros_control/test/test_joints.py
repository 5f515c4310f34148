"""Brakes, drives, stops and Coulomb friction."""

import re

import numpy as np
import pytest
from rigid_body_oracle import Oracle
from two_link import two_link_urdf

from hric_control.plant import Load, Mode

READY = [0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]


def run(plant, values, n):
    for _ in range(n):
        plant.apply(values)
        plant.step()


def test_brakes_hold_a_load_and_read_what_they_carry(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=READY)
    plant.set_load(Load(3.0))
    plant.set_brakes([True] * 7)
    run(plant, [50.0] * 7, 2000)
    q, dq, tau = [0.0] * 7, [0.0] * 7, [0.0] * 7
    plant.read_state(q, dq, tau)
    assert np.abs(np.subtract(q, READY)).max() < 1e-9
    gravity = Oracle(panda_urdf).gravity(np.array(READY))
    arm = np.subtract(tau, gravity)
    assert abs(arm[1]) > 5.0  # the load
    plant.set_load(None)
    run(plant, [0.0] * 7, 1)
    plant.read_state(q, dq, tau)
    assert np.abs(np.subtract(tau, gravity)).max() < 1e-6


def test_one_brake_holds_while_the_others_fall(make_plant, wide_panda_urdf):
    plant = make_plant(wide_panda_urdf, q=READY, collision=False)
    plant.set_brakes([False, True, False, False, False, False, False])
    run(plant, [0.0] * 7, 300)
    q = plant.engine_state()[0]
    assert abs(q[1] - READY[1]) < 1e-9
    assert abs(q[3] - READY[3]) > 0.1


@pytest.mark.parametrize("mode", [Mode.VELOCITY, Mode.POSITION])
def test_drives_arrive_within_their_limits(make_plant, panda_urdf, mode):
    plant = make_plant(panda_urdf, q=READY)
    plant.set_modes([mode] * 7)
    if mode is Mode.VELOCITY:
        run(plant, [0.2] * 7, 500)
        assert np.abs(np.subtract(plant.engine_state()[1], 0.2)).max() < 1e-9
    else:
        for k in range(1, 501):
            run(plant, np.add(READY, 1e-4 * k), 1)
        goal = np.add(READY, 0.05)
        run(plant, goal, 200)
        assert np.abs(np.subtract(plant.engine_state()[0], goal)).max() < 1e-9


def test_a_position_drive_goes_to_a_far_target_at_the_speed_limit_of_its_joint(make_plant):
    urdf = two_link_urdf(limit='lower="-2" upper="2" effort="50000" velocity="0.5"')
    plant = make_plant(urdf, ["joint1", "joint2"], q=[0.0, 0.0])
    plant.set_modes([Mode.POSITION] * 2)
    for _ in range(100):
        run(plant, [1.0, -1.0], 1)
        assert plant.engine_state()[1] == pytest.approx([0.5, -0.5], abs=1e-9)


def test_a_drive_takes_no_more_than_its_effort(make_plant, panda_urdf):
    plant = make_plant(panda_urdf, q=READY)
    plant.set_modes([Mode.VELOCITY] * 7)
    plant.apply([2.0] * 7)
    plant.step()
    assert plant.motor_effort() == pytest.approx([87.0] * 4 + [12.0] * 3)
    assert max(plant.engine_state()[1]) < 2.0


def test_a_stop_holds_what_presses_against_it_and_is_open_for_a_start_outside(make_plant, panda_urdf):
    upper = 2.8973
    plant = make_plant(panda_urdf, q=[0.0] * 7, gravity=[0.0, 0.0, 0.0], collision=False)
    plant.set_brakes([False, *[True] * 6])
    run(plant, [10.0, *[0.0] * 6], 3000)
    assert plant.engine_state()[0][0] == pytest.approx(upper, abs=1e-3)
    plant.reset([upper + 0.2, *[0.0] * 6])
    run(plant, [0.0] * 7, 100)
    assert plant.engine_state()[0][0] == pytest.approx(upper + 0.2, abs=1e-6)
    run(plant, [-20.0, *[0.0] * 6], 400)
    assert plant.engine_state()[0][0] < upper
    run(plant, [20.0, *[0.0] * 6], 3000)
    assert plant.engine_state()[0][0] == pytest.approx(upper, abs=1e-3)


def test_coulomb_friction_holds_up_to_its_value_without_creeping(make_plant, panda_urdf):
    urdf = re.sub(r'friction="[^"]*"', 'friction="1.0"', panda_urdf)
    plant = make_plant(urdf, q=READY, gravity=[0.0, 0.0, 0.0], friction="coulomb", rotor_inertia=0.1)
    run(plant, [0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.8], 5000)
    assert np.abs(np.subtract(plant.engine_state()[0], READY)).max() < 1e-5
    run(plant, [1.2, *[0.0] * 6], 500)
    assert plant.engine_state()[0][0] > READY[0] + 1e-3
