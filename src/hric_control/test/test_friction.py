"""Bristles that hold: of joints along a recorded motion, and of penalty contact on bodies whose motion is known."""

import numpy as np
import pytest

from hric_control.plants import Springs, bristle_torque, sigmoid_parameters
from hric_control.plants.contact_law import ContactLaw
from hric_control.plants.friction import FADE, GIVE, breakaways, refuse_other_joints
from hric_control.plants.spring_step import BRISTLE_STIFFNESS
from hric_core.errors import ParameterError

STEP, MASS, BOUND = 1e-3, 2.0, 6.0
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
PAIR = ("block", "ground")

SHARED = 4.0


def give(force, mass=MASS):
    """Deflection of the bristle under a force [m]; that of a light body is softer, so that five of them are stable."""
    return force / BRISTLE_STIFFNESS + SHARED * STEP**2 * force / mass


def rubbed(drive, mass=MASS, contacts=1, bound=BOUND, start=0.0):
    """Positions [m], speeds [m/s] and forces of friction [N] of a mass along x under `drive` [N], one each per step;
    each contact has its share of the bound and does not know of the others."""
    springs, x, v, before, course = Springs(STEP), 0.0, start, start, []
    pairs = [("block", f"ground {i}") for i in range(contacts)]
    for force in drive:
        springs.begin()
        total = 0.0
        for pair in pairs:
            springs.push(pair, 1e-3, 0.0, 0.0, 1.0, ContactLaw(1e4))
            relative = np.array([v * X - Z, before * X - Z])
            total += float(springs.rub(pair, bound / contacts, Z, relative, lambda along: 1.0 / mass) @ X)
        before, v = v, v + STEP * (force + total) / mass
        x += STEP * v
        course.append((x, v, total))
    return np.array(course).T


def test_friction_of_contact_acts_across_the_normal_against_the_sliding():
    springs = Springs(STEP)
    for _ in range(3):
        springs.begin()
        springs.push(PAIR, 1e-3, 0.0, 0.0, 1.0, ContactLaw(1e4))
        v = np.array([0.3, -0.4, -1.0])
        force = springs.rub(PAIR, 5.0, Z, np.array([v, v]), lambda along: 0.0)
    assert force == pytest.approx([-3.0, 4.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_a_body_that_is_pushed_less_than_friction_holds_bends_its_bristle_and_stays(share):
    x, v, _ = rubbed(share * BOUND * np.minimum(np.arange(10000) / 100.0, 1.0))
    assert x[-1] == pytest.approx(give(share * BOUND), rel=1e-6)
    assert np.abs(x[1000:] - x[-1]).max() < 1e-9 and abs(v[-1]) < 1e-12


def test_a_load_that_swings_below_the_bound_does_not_walk_the_body_away():
    drive = BOUND * (0.4 + 0.5 * np.sin(2.0 * np.pi * 25.0 * STEP * np.arange(10000)))
    x = rubbed(drive)[0]
    assert abs(x[6000:].mean() - x[2000:6000].mean()) < 1e-12


def test_a_body_that_slides_is_braked_by_the_bound_and_then_rests():
    x, v, _ = rubbed([0.0] * 500, start=0.3)
    assert x.max() == pytest.approx(0.5 * 0.3**2 * MASS / BOUND, rel=0.02)
    assert np.abs(v[-100:]).max() < 1e-6


def test_beyond_the_bound_it_slides_with_what_is_left():
    assert rubbed([1.5 * BOUND] * 1000)[1][-1] == pytest.approx(0.5 * BOUND / MASS, rel=0.01)


@pytest.mark.parametrize("mass", [1e-3, 0.1, 10.0])
@pytest.mark.parametrize("contacts", [1, 5])
def test_contacts_of_any_body_stay_stable_though_they_do_not_know_of_each_other(mass, contacts):
    x, v, _ = rubbed([0.3 * BOUND] * 2000, mass, contacts)
    assert np.abs(v[-100:]).max() < 1e-9
    assert x[-1] == pytest.approx(give(0.3 * BOUND / contacts, mass), rel=0.3)


def test_friction_of_contact_takes_energy_on_any_drive():
    drive = np.random.default_rng(3).normal(0.0, 2.0 * BOUND, 20000)
    _, v, force = rubbed(drive)
    taken = -STEP * np.cumsum(force * v)
    assert taken.min() > -0.5 * BOUND * give(BOUND) and taken[-1] > 0.0


def test_the_bristle_of_a_joint_bends_by_the_way_up_to_its_bound_and_lets_go_of_a_fast_joint():
    time = np.arange(0.0, 1.0, STEP)
    slow = bristle_torque(np.full_like(time, 1e-3), time)
    assert slow[50] == pytest.approx(50 * STEP * 1e-3 / GIVE) and slow[-1] == pytest.approx(1.0, abs=1e-3)
    assert bristle_torque(np.full_like(time, -0.5 * FADE), time)[-1] == pytest.approx(-(0.75**2))
    assert not bristle_torque(np.full_like(time, 1.01 * FADE), time).any()


@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf"), "much", None])
def test_a_breakaway_that_is_none_is_refused_with_its_joint(value):
    with pytest.raises(ParameterError, match="breakaway of b must be a finite number of 0 or more"):
        breakaways({"a": {"breakaway": 0.2}, "b": {"breakaway": value}}, ["a", "b"])
    assert breakaways({"phi1": [1.0, 1.0], "breakaway": [0.1, 0.2]}, ["a", "b"]) == [0.1, 0.2]
    assert breakaways({"a": {"phi1": 1.0}, "b": {"breakaway": 0.3}}, ["a", "b"]) == [0.0, 0.3]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"c": {"phi1": 1.0}}, "no joint 'c' in friction_parameters; valid: a, b, breakaway, phi1, phi2, phi3"),
        ({"phi4": [1.0, 1.0]}, r"no joint 'phi4' .*did you mean phi"),
        ({"a": {"phi1": 1.0, "breakway": 0.1}}, r"no parameter 'breakway' in friction_parameters\.a; .*breakaway"),
        ({"phi1": [1.0, 1.0, 1.0]}, r"friction_parameters\.phi1 is \[.*\]; valid: 2 values, for a, b"),
        ({"phi1": 1.0}, r"friction_parameters\.phi1 is 1\.0; valid: 2 values, for a, b"),
    ],
)
def test_friction_of_no_joint_and_lists_of_another_length_are_refused_by_their_key(given, message):
    with pytest.raises(ParameterError, match=message):
        refuse_other_joints(given, ["a", "b"])


@pytest.mark.parametrize(("phi1", "phi2"), [(-0.5, 5.0), (0.5, -5.0)])
def test_friction_that_drives_is_refused(phi1, phi2):
    with pytest.raises(ParameterError, match=r"\(phi1, phi2\) of a is .*; valid: 0 or more each"):
        sigmoid_parameters({"a": {"phi1": phi1, "phi2": phi2, "phi3": 0.0}}, ["a"])


def test_friction_by_joint_and_in_lists_is_taken():
    refuse_other_joints({"phi1": [1.0, 1.0], "a": {"phi2": 1.0}, "breakaway": [0.1, 0.2]}, ["a", "b"])
