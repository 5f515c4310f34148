"""The criterion for a diverged simulation, and its error message."""

import math

import pytest

from hric_control.plants.divergence import LOWEST_BOUND, VELOCITY_FACTOR, DivergedError, Divergence, bound

JOINTS = ["hip", "slide", "wheel"]
LIMITS = [20.0, 0.1, math.inf]


@pytest.fixture
def divergence():
    return Divergence(JOINTS, LIMITS, [False, True, False], 1e-3)


def test_the_bound_is_a_multiple_of_the_velocity_limit_and_never_below_what_gravity_reaches():
    assert VELOCITY_FACTOR >= 50.0
    assert [bound(limit) for limit in LIMITS] == [20.0 * VELOCITY_FACTOR, LOWEST_BOUND, LOWEST_BOUND]


def test_each_joint_may_reach_its_own_bound(divergence):
    divergence.check([0.0, 0.0, 1e6], [2000.0, -1000.0, 1000.0])
    for place, value in ((0, 2000.1), (1, -1000.1), (2, 1000.1)):
        dq = [0.0, 0.0, 0.0]
        dq[place] = value
        with pytest.raises(DivergedError) as caught:
            divergence.check([0.0] * 3, dq)
        assert (caught.value.joint, caught.value.value) == (JOINTS[place], value)


def test_of_several_joints_the_one_farthest_beyond_its_bound_is_named(divergence):
    with pytest.raises(DivergedError, match=r"speed of slide is 2500 m/s, beyond 1000 m/s \(velocity limit 0\.1 m/s\)"):
        divergence.check([0.0] * 3, [3000.0, 2500.0, 1100.0])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(3))
def test_what_is_not_finite_is_named_position_or_speed_whatever_the_others_are(divergence, value, place):
    values = [math.inf if value != value else 0.5] * 3
    values[:place] = [0.5] * place
    values[place] = value
    with pytest.raises(DivergedError, match=f"at 0.001 s: speed of {JOINTS[place]} is .* not finite"):
        divergence.check([0.0] * 3, values)
    with pytest.raises(DivergedError, match=f"at 0.002 s: position of {JOINTS[place]} is .* not finite"):
        divergence.check(values, [0.0] * 3)
    with pytest.raises(DivergedError, match=f"effort of {JOINTS[place]} is .* not finite"):
        divergence.check_efforts(values)


def test_a_joint_without_a_limit_says_so(divergence):
    with pytest.raises(DivergedError, match=r"wheel is 2e\+04 rad/s, beyond 1000 rad/s \(no velocity limit\)"):
        divergence.check([0.0] * 3, [0.0, 0.0, 2e4])
