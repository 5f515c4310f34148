"""Fatigue of muscles against closed forms of the model, and how far it is from the published endurance."""

import numpy as np
import pytest

from hric_assessment.ergonomics.fatigue import RATES, REST, RISE, STEP, Fatigue
from hric_core.errors import HricError

F, R = RATES["shoulder"]


def test_a_constant_load_fatigues_as_the_linear_model_says() -> None:
    """While there is a reserve, M_A = a (1 - exp(-(L+F) t)) with a = L load / (L + F), and M_F follows it."""
    load, t, rate = 0.3, 60.0, RISE + F
    muscle = Fatigue(["shoulder"])
    missed = muscle.update(np.array([load]), t)
    a = RISE * load / rate
    fatigued = F * a * ((1.0 - np.exp(-R * t)) / R - (np.exp(-R * t) - np.exp(-rate * t)) / (rate - R))
    assert muscle.active == pytest.approx([a], rel=1e-9)
    assert muscle.fatigued == pytest.approx([fatigued], rel=1e-4)
    assert muscle.resting + muscle.active + muscle.fatigued == pytest.approx([1.0])
    assert missed == pytest.approx([load - a], rel=1e-6)


def test_at_rest_the_fatigued_recover_faster_by_the_factor_of_rest() -> None:
    muscle = Fatigue(["shoulder"])
    muscle.active, muscle.fatigued, muscle.resting = np.array([0.0]), np.array([0.4]), np.array([0.6])
    muscle.update(np.array([0.0]), 20.0)
    assert muscle.fatigued == pytest.approx([0.4 * np.exp(-REST * R * 20.0)], rel=1e-6)
    assert muscle.capacity == pytest.approx(1.0 - muscle.fatigued)


def test_a_full_load_ends_where_the_tired_and_the_recovered_balance() -> None:
    """M_R = M_A F/L and M_F = M_A F/R."""
    muscle = Fatigue(["shoulder"])
    muscle.update(np.array([1.0]), 600.0)
    assert muscle.active == pytest.approx([1.0 / (1.0 + F / R + F / RISE)], rel=1e-3)


def test_muscles_do_not_know_of_each_other() -> None:
    loads = np.array([0.1, 0.5, 0.9])
    all_of_them = Fatigue(["shoulder", "elbow", "grip"])
    all_of_them.update(loads, 30.0)
    for k, joint in enumerate(("shoulder", "elbow", "grip")):
        alone = Fatigue([joint])
        alone.update(loads[k : k + 1], 30.0)
        assert alone.fatigued[0] == all_of_them.fatigued[k]


def test_the_published_endurance_is_missed_by_what_the_module_says() -> None:
    """The page of the module has 7.9 s RMS at the shoulder, from the curve 14.86 I^-1.83 [s]."""
    share = np.linspace(0.2, 0.9, 8)
    muscles, endurance = Fatigue(["shoulder"] * len(share), rest=1.0), np.full(len(share), np.nan)
    active = F * share / (RISE + F)  # what a held load misses by the law of the drive alone
    period = 10.0 * STEP
    for n in range(4000):
        missed = muscles.update(share, period)
        over = np.isnan(endurance) & (n > 20) & (missed > 2.0 * active + 1e-3)
        endurance[over] = n * period
    error = endurance - 14.86 * share**-1.83
    assert np.sqrt(np.mean(error**2)) == pytest.approx(7.9, abs=1.0)


def test_a_joint_without_rates_is_refused_by_name() -> None:
    with pytest.raises(HricError, match=r"fatigue of joint 'wrist'; valid: shoulder, elbow"):
        Fatigue(["shoulder", "wrist"])
    with pytest.raises(HricError, match=r"factor of rest is 0\.5"):
        Fatigue(["shoulder"], rest=0.5)
