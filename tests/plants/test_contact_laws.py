"""Contact laws on every engine: peak force and energy of a sphere that hits a wall, against closed forms."""

import pytest
import yaml
from contact_courses import expected_peak

from hric_control.plants.contact_law import ContactLaw, Layer

MASS, SPEED, RADIUS = 3.0, 0.5, 0.05
HALF = {"contact": "viscoelastic", "stiffness": 20e3, "relaxing": 10e3, "relaxation_time": 0.02}
SKIN = {"contact": "viscoelastic", "stiffness": 40e3, "relaxing": 40e3, "relaxation_time": 4e-3}
HERTZ = {"contact": "hunt_crossley", "stiffness": 2e6, "exponent": 1.5, "dissipation": 0.3}
CASES = {
    "spring": ({}, {"contact": "penalty", "stiffness": 40e3}, ContactLaw(40e3)),
    "hunt_crossley": (
        {},
        {"contact": "hunt_crossley", "stiffness": 40e3, "dissipation": 2.0},
        ContactLaw(40e3, dissipation=2.0),
    ),
    "hertz": ({}, HERTZ, ContactLaw(2e6, exponent=1.5, dissipation=0.3)),
    "skin": ({}, SKIN, ContactLaw(40e3, layers=(Layer(40e3, 40e3, 4e-3),))),
    "cover_and_skin": (
        HALF,
        SKIN,
        ContactLaw(40e3 / 3.0, layers=(Layer(20e3, 10e3, 0.02), Layer(40e3, 40e3, 4e-3))),
    ),
}
BOUND = 0.01
"""Allowed relative error of peak force and energy [1]."""


@pytest.fixture(scope="module")
def table():
    rows = []
    yield rows
    print(f"\n{'engine':16} {'law':16} {'peak [N]':>9} {'error %':>8} {'energy [J]':>10} {'error %':>8}")
    for engine, name, peak, of_peak, energy, of_energy in rows:
        print(f"{engine:16} {name:16} {peak:9.2f} {100 * of_peak:+8.3f} {energy:10.4f} {100 * of_energy:+8.3f}")


@pytest.mark.parametrize("name", CASES)
def test_a_sphere_has_closed_form_peak_and_energy(make_plant, panda_urdf, plant_type, tmp_path, table, name):
    ball, wall, law = CASES[name]
    sphere = {"name": "ball", "shape": "sphere", "size": RADIUS, "mass": MASS, "friction": 0.0, **ball}
    sphere |= {"velocity": {"linear": [SPEED, 0, 0]}, "pose": {"xyz": [2.0 - RADIUS - 1.13e-3, 0.0, 1.0]}}
    block = {"name": "wall", "shape": "box", "size": [1.0, 1.0, 1.0], "friction": 0.0, **wall}
    world = tmp_path / "world.yaml"
    world.write_text(yaml.safe_dump({"objects": [sphere, block | {"pose": {"xyz": [2.5, 0.0, 1.0]}}]}))
    plant = make_plant(panda_urdf, world=str(world), gravity=[0.0, 0.0, 0.0], q=[0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.785])
    peak = energy = 0.0
    for _ in range(80):
        plant.apply([0.0] * 7)
        plant.step()
        for contact in plant.contacts():
            peak, energy = max(peak, contact.force), max(energy, contact.energy)
    expected, work = expected_peak(law, MASS, SPEED), 0.5 * MASS * SPEED**2
    table.append((plant_type.rpartition("/")[2], name, peak, peak / expected - 1.0, energy, energy / work - 1.0))
    assert peak == pytest.approx(expected, rel=BOUND)
    assert energy == pytest.approx(work, rel=BOUND)
