"""An arm that is not too clean stands still by its friction under zero torque, on every engine."""

import numpy as np
import pytest

from franka_msgs.srv import SetLoadRequest
from hric_control.plant import Load
from hric_core import plugins

PAYLOAD = Load(1.0, (0.02, -0.03, 0.1), (0.002, 0, 0, 0, 0.003, 0, 0, 0, 0.001))
DRIFT = 1e-3
"""Largest motion of any joint [rad]."""


@pytest.fixture(params=list(plugins.names(plugins.PLANT)), ids=lambda name: name.rpartition("/")[2])
def free_arm(request, make_arm, claim):
    """An arm of the preset `measured` that is commanded no torque."""
    arm = make_arm(parameters={"realism": "measured", "plant_type": request.param})
    arm.hw.do_switch([claim()], [])
    return arm


def positions(arm):
    """True positions of the joints, shape (7,) [rad]."""
    rows = [0.0] * 7, [0.0] * 7, [0.0] * 7
    arm.hw.plant.read_state(*rows)
    return np.array(rows[0])


def drift(arm, duration):
    """Return the largest distance that a joint moves from its present position [rad]."""
    start, ways = positions(arm), [0.0]
    arm.run(duration, lambda _: ways.append(float(np.abs(positions(arm) - start).max())))
    print(f"{1e6 * max(ways):.0f} urad in {duration:g} s")
    return max(ways)


@pytest.mark.parametrize("duration", [3.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_a_measured_arm_stands_still_under_zero_torque(free_arm, duration):
    assert drift(free_arm, duration) < DRIFT


@pytest.mark.parametrize("duration", [1.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_it_comes_to_rest_after_a_jolt_and_stays_with_a_payload_too(free_arm, duration):
    plant = free_arm.hw.plant
    plant.set_load(PAYLOAD, "panda_link8")
    told = SetLoadRequest(mass=PAYLOAD.mass, F_x_center_load=PAYLOAD.com, load_inertia=PAYLOAD.inertia)
    assert free_arm.node.call("franka_control/set_load", told).success
    start = positions(free_arm)
    plant.apply_wrench("panda_hand", [10.0, 0.0, -10.0], [0.0] * 3, [0.0] * 3, 0.05)
    free_arm.run(1.5)
    assert np.abs(positions(free_arm) - start).max() > 10.0 * DRIFT
    assert drift(free_arm, duration) < DRIFT


def test_an_arm_that_is_guided_by_hand_stays_where_it_is_let_go(free_arm):
    """A hand leads the robot's hand 0.1 m aside within 1.5 s, rests and lets go."""
    plant = free_arm.hw.plant
    begin = plant.link_state("panda_hand")[0][:3, 3].copy()

    def lead(time):
        T, twist = plant.link_state("panda_hand")
        goal = begin + np.array([0.0, 0.1 * min(time / 1.5, 1.0), 0.0])
        plant.apply_wrench(
            "panda_hand", 300.0 * (goal - T[:3, 3]) - 20.0 * twist[:3], [0.0] * 3, [0.0] * 3, plant.time_step
        )

    free_arm.run(2.5, lead)
    assert plant.link_state("panda_hand")[0][1, 3] - begin[1] > 0.07
    assert drift(free_arm, 1.0) < DRIFT


def test_with_too_little_friction_it_sags(make_arm, claim):
    arm = make_arm(parameters={"realism": {"preset": "measured", "breakaway": 0.0}})
    arm.hw.do_switch([claim()], [])
    assert drift(arm, 1.0) > 10.0 * DRIFT
