"""Virtual mass and damper: closed forms, limits, and energy of the port."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hric_controllers.force.admittance_law import AdmittanceLaw, VirtualAxis

PERIOD = 1e-3
WIDE = VirtualAxis(mass=5.0, damping=20.0, stiffness=0.0, dead_band=0.0, velocity=10.0, acceleration=100.0, jerk=1e6)
NARROW = replace(WIDE, velocity=0.3, acceleration=2.0, jerk=50.0)


def test_a_constant_force_moves_the_axis_as_the_closed_form_of_mass_and_damper() -> None:
    law = AdmittanceLaw([WIDE], 0.0)
    for k in range(1, 1001):
        law.advance([8.0], PERIOD)
        expected = 8.0 / 20.0 * (1.0 - math.exp(-20.0 / 5.0 * k * PERIOD))
        assert law.velocity[0] == pytest.approx(expected, abs=2e-3)


def test_a_spring_holds_the_force_at_its_displacement() -> None:
    law = AdmittanceLaw([replace(WIDE, stiffness=100.0)], 0.0)
    for _ in range(10000):
        law.advance([8.0], PERIOD)
    assert law.position[0] == pytest.approx(0.08, abs=1e-6)


def test_a_force_within_the_dead_band_moves_nothing_and_a_larger_one_counts_less_the_band() -> None:
    law = AdmittanceLaw([replace(WIDE, dead_band=2.0)] * 2, 0.0)
    for _ in range(5000):
        law.advance([1.9, -5.0], PERIOD)
    assert law.position[0] == 0.0
    assert law.velocity[1] == pytest.approx(-3.0 / 20.0, rel=1e-6)


def test_an_axis_of_infinite_mass_is_locked() -> None:
    law = AdmittanceLaw([replace(WIDE, mass=math.inf)], 0.0)
    for _ in range(100):
        law.advance([50.0], PERIOD)
    assert law.position == [0.0]


@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_any_force_keeps_the_limits_of_velocity_acceleration_and_jerk(scale: float) -> None:
    random, law = np.random.default_rng(3), AdmittanceLaw([NARROW], 0.0)
    last, fastest = 0.0, 0.0
    for k in range(20000):
        if k % 100 == 0:
            force = float(random.choice([-200.0, 0.0, 200.0]))
        law.advance([force], PERIOD, scale)
        fastest = max(fastest, abs(law.velocity[0]))
        assert abs(law.velocity[0]) <= scale * NARROW.velocity + 1e-4
        assert abs(law.acceleration[0]) <= NARROW.acceleration
        assert abs(law.acceleration[0] - last) <= NARROW.jerk * PERIOD + 1e-12
        last = law.acceleration[0]
    assert fastest > 0.9 * scale * NARROW.velocity


def test_speed_scale_zero_brings_a_moving_axis_to_rest() -> None:
    law = AdmittanceLaw([NARROW], 0.0)
    for scale in [1.0] * 2000 + [0.0] * 1000:
        law.advance([50.0], PERIOD, scale)
    assert abs(law.velocity[0]) < 1e-4


def test_an_axis_comes_to_rest_at_the_end_of_its_range() -> None:
    law = AdmittanceLaw([NARROW], 0.0)
    law.start([(-0.05, 0.1)])
    furthest = 0.0
    for _ in range(5000):
        law.advance([100.0], PERIOD)
        furthest = max(furthest, law.position[0])
    assert law.position[0] == pytest.approx(0.1, abs=1e-4)
    assert furthest <= 0.1 + 1e-3


def test_the_environment_never_gets_more_energy_than_it_gave() -> None:
    random, law, energy = np.random.default_rng(1), AdmittanceLaw([NARROW], 0.01), [0.0]
    force = 0.0
    for _ in range(60000):
        force += 0.02 * (random.normal(0.0, 60.0) - force)
        before = law.velocity[0]
        law.advance([force], PERIOD)
        energy.append(energy[-1] + force * 0.5 * (before + law.velocity[0]) * PERIOD)
    assert energy[-1] > 1.0 and min(energy) >= -1e-3
