"""The spring of penalty contact within a step, against closed formulas."""

import math

import pytest

from hric_control.plants.contact_law import ContactLaw
from hric_control.plants.spring_step import Springs, spring_step

STIFFNESS, STEP = 75000.0, 1e-3
SPRING = ContactLaw(STIFFNESS)


@pytest.mark.parametrize("mass", [0.3, 0.6, 5.0])
@pytest.mark.parametrize(("depth", "speed", "push"), [(1e-3, 0.3, 0.0), (2e-3, -0.2, 5.0), (0.5e-3, 0.0, -9.81)])
def test_a_step_in_contact_is_that_of_the_harmonic_oscillator(mass, depth, speed, push):
    done = spring_step(depth, speed, push, 1.0 / mass, SPRING, STEP)
    w = math.sqrt(STIFFNESS / mass)
    rest = push / w**2
    c, s = math.cos(w * STEP), math.sin(w * STEP)
    x, v = rest + (depth - rest) * c + speed / w * s, speed * c - (depth - rest) * w * s
    assert x > 0.0
    assert done.mean == pytest.approx(mass * (push - (v - speed) / STEP), rel=1e-5)
    assert done.ahead == pytest.approx(x - (depth + STEP * 0.5 * (speed + v)), abs=1e-10)
    if v > 0.0 or speed <= 0.0:
        assert done.reading == pytest.approx(STIFFNESS * x, rel=1e-6)


def test_the_maximum_within_a_step_is_what_is_read():
    mass = 0.6
    w = math.sqrt(STIFFNESS / mass)
    amplitude, before = 1e-3, 0.4 * STEP
    done = spring_step(
        amplitude * math.cos(w * before), amplitude * w * math.sin(w * before), 0.0, 1.0 / mass, SPRING, STEP
    )
    assert done.reading == pytest.approx(STIFFNESS * amplitude, rel=3e-4)


def test_a_gap_that_closes_within_the_step_takes_its_time():
    done = spring_step(-0.25e-3, 0.5, 0.0, 0.0, SPRING, STEP)
    assert done.reading == pytest.approx(STIFFNESS * 0.25e-3)
    assert done.mean == pytest.approx(STIFFNESS * 0.25e-3 * 0.25)
    assert spring_step(-0.6e-3, 0.5, 0.0, 1.0, SPRING, STEP).mean == 0.0
    assert spring_step(-0.1e-3, -0.5, 0.0, 1.0, SPRING, STEP).mean == 0.0
    falls = spring_step(-0.1e-3, 0.0, 800.0, 0.0, SPRING, STEP)
    assert falls.reading == pytest.approx(STIFFNESS * 0.3e-3)


def test_damping_never_pulls():
    leaving = spring_step(0.1e-3, -0.5, 0.0, 1.0, ContactLaw(STIFFNESS, 1000.0), STEP)
    assert (leaving.mean, leaving.reading) == (0.0, 0.0)


def impact(mass, speed, phase, known_mass=1.0, damping=0.0):
    """(peak force, impulse, speed afterwards) of a mass on a fixed spring, moved by the mean force of each step."""
    springs, x, v, before, peak, impulse = Springs(STEP), -(3.0 + phase) * STEP * speed, speed, speed, 0.0, 0.0
    while v > 0.0 or x > -1e-4:
        springs.begin()
        done = springs.push(("a", "b"), x, v, (v - before) / STEP, known_mass / mass, ContactLaw(STIFFNESS, damping))
        before, after = v, v - STEP * done.mean / mass
        x, v = x + 0.5 * STEP * (v + after), after
        peak, impulse = max(peak, done.reading), impulse + STEP * done.mean
    assert springs.take_peaks() == {("a", "b"): peak}
    assert springs.take_peaks() == {}
    return peak, impulse, v


@pytest.mark.parametrize("mass", [0.6, 5.0])
def test_an_impact_is_exact_at_every_phase_of_the_step(mass):
    for k in range(20):
        peak, impulse, speed = impact(mass, 0.25, k / 20)
        assert peak == pytest.approx(0.25 * math.sqrt(mass * STIFFNESS), rel=3e-4)
        assert impulse == pytest.approx(2.0 * mass * 0.25, rel=1e-4)
        assert speed == pytest.approx(-0.25, rel=2e-4)


@pytest.mark.parametrize("known", [0.5, 1.3])
def test_a_mass_that_is_known_badly_costs_half_a_percent(known):
    peak, _, speed = impact(0.6, 0.25, 0.3, known)
    assert peak == pytest.approx(0.25 * math.sqrt(0.6 * STIFFNESS), rel=5e-3)
    assert speed == pytest.approx(-0.25, rel=5e-3)


def test_a_damped_impact_leaves_by_the_closed_formula_of_a_force_that_never_pulls():
    mass, damping = 5.0, 300.0
    zeta = damping / (2.0 * math.sqrt(STIFFNESS * mass))
    w = math.sqrt(STIFFNESS / mass)
    wd = w * math.sqrt(1.0 - zeta**2)
    # The force k x + c x' is zero when tan(wd t) = -2 zeta sqrt(1 - zeta^2) / (1 - 2 zeta^2).
    end = (math.pi - math.atan2(2.0 * zeta * math.sqrt(1.0 - zeta**2), 1.0 - 2.0 * zeta**2)) / wd
    expected = math.exp(-zeta * w * end) * (math.cos(wd * end) - zeta * w / wd * math.sin(wd * end))
    assert impact(mass, 0.25, 0.3, damping=damping)[2] / 0.25 == pytest.approx(expected, rel=1e-3)


def test_a_body_at_rest_on_its_spring_stays_there_whatever_is_known_of_its_mass():
    mass, load = 0.6, 50.0
    springs, x, v, before = Springs(STEP), load / STIFFNESS, 0.0, 0.0
    for _ in range(2000):
        springs.begin()
        done = springs.push(("a", "b"), x, v, (v - before) / STEP, 0.7 / mass, SPRING)
        before, after = v, v + STEP * (load - done.mean) / mass
        x, v = x + 0.5 * STEP * (v + after), after
    # The first step does not know of the load yet: what it sets going is small, and does not grow.
    assert abs(done.mean / load - 1.0) < 0.03
    assert abs(STIFFNESS * x / load - 1.0) < 0.03
