"""Contact laws against closed forms, through the steps that every engine takes."""

import math

import pytest
from contact_courses import expected_peak

from hric_control.plant import Surface
from hric_control.plants.contact_law import ContactLaw, Layer
from hric_control.plants.spring_step import Springs
from hric_control.plants.surfaces import combine
from hric_core.errors import ParameterError

STEP, MASS, SPEED = 1e-3, 3.0, 0.5
SKIN, COVER = Layer(40e3, 40e3, 4e-3), Layer(20e3, 10e3, 20e-3)
LAWS = {
    "spring": ContactLaw(40e3),
    "hertz": ContactLaw(2e6, exponent=1.5),
    "hunt_crossley": ContactLaw(40e3, dissipation=2.0),
    "hunt_crossley_hertz": ContactLaw(2e6, exponent=1.5, dissipation=0.3),
    "skin": ContactLaw(40e3, layers=(SKIN,)),
    "cover_and_skin": ContactLaw(40e3 / 3.0, layers=(COVER, SKIN)),
}


def impact(law, phase):
    """Return peak force, energy and speed afterwards of a mass that the mean force of each step moves."""
    springs, x, v, before, peak, energy = Springs(STEP), -(3.0 + phase) * STEP * SPEED, SPEED, SPEED, 0.0, 0.0
    while v > 0.0 or x > -1e-4:
        springs.begin()
        done = springs.push(("a", "b"), x, v, (v - before) / STEP, 1.0 / MASS, law)
        before, after = v, v - STEP * done.mean / MASS
        x, v = x + 0.5 * STEP * (v + after), after
        peak, energy = max(peak, done.reading), max(energy, springs.energy(("a", "b")))
    return peak, energy, v


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("phase", [0.0, 0.35, 0.8])
def test_an_impact_has_the_closed_form_peak(name, phase):
    peak, energy, speed = impact(LAWS[name], phase)
    assert peak == pytest.approx(expected_peak(LAWS[name], MASS, SPEED), rel=2e-3)
    assert energy == pytest.approx(0.5 * MASS * SPEED**2, rel=2e-3)
    assert (abs(speed) < 0.99 * SPEED) == (name not in ("spring", "hertz"))


def test_a_held_layer_relaxes_to_its_spring():
    springs, pair, law = Springs(STEP), ("a", "b"), ContactLaw(40e3, layers=(SKIN,))
    readings = []
    for _ in range(100):
        springs.begin()
        readings.append(springs.push(pair, 1e-3, 0.0, 0.0, 0.0, law).reading)
    assert readings[0] == pytest.approx(40.0 * (1.0 + math.exp(-0.25)), rel=1e-6), "at the end of the step"
    assert readings[-1] == pytest.approx(40.0, rel=1e-3)


def test_a_spring_against_skin_is_a_layer():
    law, friction = combine(Surface(40e3, relaxing=40e3, relaxation_time=4e-3), Surface(40e3, friction=0.4))
    assert law.layers == (SKIN, Layer(40e3))
    assert (law.stiffness, friction) == (20e3, 0.2)


def test_two_hertz_surfaces_keep_their_exponent():
    law, _ = combine(Surface(1e6, exponent=1.5, dissipation=0.4), Surface(1e6, exponent=1.5))
    assert law.stiffness == pytest.approx(2.0**-1.5 * 1e6), "each takes half of the penetration"
    assert law.dissipation == pytest.approx(0.2)


def test_surfaces_of_different_exponents_are_refused():
    with pytest.raises(ParameterError, match=r"exponents 1\.5 and 1; valid: the same exponent"):
        combine(Surface(1e6, exponent=1.5), Surface(1e6))
