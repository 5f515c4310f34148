"""Contacts by body region for a ball that falls on a fixed arm, compared with closed formulas."""

import math
import re

import numpy as np
import pytest
import yaml
from bodies import body
from two_link import two_link_urdf

from hric_human.body import surfaces
from hric_human.contact import RegionContacts

JOINTS = ["joint1", "joint2"]
STEP, MASS, RADIUS, HEIGHT, STIFFNESS = 1e-3, 1.0, 0.05, 0.05, 40e3
"""Time step [s]; mass [kg], radius [m] and height of fall [m] of the ball; stiffness of the forearm [N/m]."""
ARM = body(parts="right_arm")
LYING = np.array([[0.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]])
"""Pose of an arm along -x."""


@pytest.fixture
def fall(make_plant, tmp_path):
    """Function fall(every=1, springs=True) that returns the contacts, read in each n-th step."""
    upper_arm, forearm = ARM.segments["right_upper_arm"], ARM.segments["right_forearm"]
    middle = upper_arm.p_parent_link + forearm.p_parent_link + 0.5 * (forearm.start + forearm.end)
    p_world_middle = (LYING @ [*middle, 1.0])[:3]
    above = p_world_middle + np.array([0.0, 0.0, forearm.radius + RADIUS + HEIGHT])
    ball = {"name": "ball", "shape": "sphere", "size": RADIUS, "mass": MASS, "pose": {"xyz": above.tolist()}}
    world = tmp_path / "world.yaml"
    world.write_text(yaml.safe_dump({"objects": [{**ball, "friction": 0.0}]}))

    def ended(every=1, springs=True):
        plant = make_plant(two_link_urdf(), JOINTS, world=str(world), q=[0.0, 0.0])
        plant.set_brakes([True, True])
        urdf = re.sub('type="revolute"', 'type="fixed"', ARM.urdf)
        plant.spawn("human", urdf, LYING, fixed=True, surfaces=surfaces(ARM) if springs else {})
        contacts, found = RegionContacts(ARM, "human"), []
        for k in range(0, 150, every):
            for _ in range(every):
                plant.apply([0.0, 0.0])
                plant.step()
            found += contacts.update((k + every) * STEP, plant.contacts(), plant.take_contact_peaks(), every)
        return [*found, *contacts.present.values()]

    return ended


def test_a_ball_that_falls_on_a_forearm_is_one_contact_with_force_times_and_impulse_of_the_formula(fall):
    """Check m x'' = m g - k x from x' = v: a sine about m g / k between two zeros of x."""
    (contact,) = fall()
    speed, rate = math.sqrt(2.0 * 9.81 * HEIGHT), math.sqrt(STIFFNESS / MASS)
    sunk = math.atan(9.81 / (rate * speed)) / rate
    duration = math.pi / rate + 2.0 * sunk
    assert (contact.link, contact.regions, contact.other) == ("r_elbow", ("lower arm, wrist",), "ball::link")
    assert contact.kind == "penalty"
    peak = MASS * 9.81 + math.hypot(MASS * 9.81, speed * math.sqrt(MASS * STIFFNESS))
    assert contact.peak == pytest.approx(peak, rel=5e-3)
    assert contact.impulse == pytest.approx(2.0 * MASS * speed + MASS * 9.81 * duration, rel=5e-3)
    assert contact.begin == pytest.approx(speed / 9.81, abs=STEP)
    assert contact.peak_time == pytest.approx(speed / 9.81 + 0.5 * duration, abs=2 * STEP)
    assert contact.duration == pytest.approx(duration, abs=2 * STEP)


def test_its_peak_is_not_missed_where_only_every_fifth_step_is_looked_at(fall):
    (each,), (fifth,) = fall(), fall(every=5)
    assert fifth.peak == each.peak
    assert fifth.duration == pytest.approx(each.duration, abs=10 * STEP)


def test_a_ball_on_a_rigid_forearm_is_a_touch_without_a_force(fall):
    assert {(contact.link, contact.kind, contact.force, contact.impulse) for contact in fall(springs=False)} == {
        ("r_elbow", "rigid", None, None)
    }
