import random

import pytest

from hric_controllers.trajectory.trapezoid import TrapezoidProfile, cruise_velocity, shortest_duration
from hric_core.errors import HricError


def test_one_radian_from_rest_takes_the_textbook_time_and_peaks_at_the_limit():
    profile = TrapezoidProfile([1.0], [5.0])
    profile.plan_from(0.0, [0.0], [0.0], [1.0])
    assert profile.duration == pytest.approx(1.0 / 1.0 + 1.0 / 5.0)
    assert profile.sample(0.6)[1] == pytest.approx([1.0])


def test_a_short_way_gives_a_triangle_that_stays_below_the_velocity_limit():
    assert shortest_duration(0.05, 0.0, 1.0, 5.0) == pytest.approx(2 * (0.05 / 5.0) ** 0.5)


def test_from_rest_all_joints_move_on_a_straight_line():
    profile = TrapezoidProfile([1.0, 1.0, 2.0], [5.0, 5.0, 5.0])
    goal = [1.0, -0.3, 0.5]
    profile.plan_from(0.0, [0.0] * 3, [0.0] * 3, goal)
    for step in range(1, 120):
        position, _ = profile.sample(0.01 * step)
        share = position[0] / goal[0]
        assert position == pytest.approx([share * g for g in goal], abs=1e-12)


def test_all_joints_arrive_at_rest_at_the_same_time_from_any_state():
    rng = random.Random(1)
    for _ in range(500):
        n = 3
        v, a = [rng.uniform(0.2, 2) for _ in range(n)], [rng.uniform(1, 10) for _ in range(n)]
        q, dq, goal = ([rng.uniform(-s, s) for _ in range(n)] for s in (2, 2.5, 2))
        profile = TrapezoidProfile(v, a)
        profile.plan_from(0.0, q, dq, goal)
        position, velocity = profile.sample(profile.duration * (1 - 1e-9))
        assert position == pytest.approx(goal, abs=1e-6)
        assert velocity == pytest.approx([0.0] * n, abs=1e-6)


def test_position_and_velocity_are_continuous_and_the_limits_hold_along_the_way():
    rng = random.Random(2)
    for _ in range(100):
        v, a = rng.uniform(0.3, 2), rng.uniform(1, 10)
        dq = [rng.uniform(-v, v), rng.uniform(-v, v)]
        profile = TrapezoidProfile([v, v], [a, a])
        profile.plan_from(0.0, [0.0, 0.0], dq, [rng.uniform(-2, 2), rng.uniform(-2, 2)])
        dt = profile.duration / 400
        q_before, dq_before = profile.sample(0.0)
        assert dq_before == pytest.approx(dq)
        for step in range(1, 401):
            q, dq_now = profile.sample(step * dt)
            for i in range(2):
                assert abs(dq_now[i]) <= v + 1e-9
                assert abs(dq_now[i] - dq_before[i]) <= a * dt + 1e-9
                assert abs(q[i] - q_before[i] - 0.5 * dt * (dq_now[i] + dq_before[i])) <= a * dt * dt
            q_before, dq_before = q, dq_now


def test_replanning_in_motion_keeps_position_and_velocity():
    profile = TrapezoidProfile([1.0] * 2, [5.0] * 2)
    profile.plan_from(0.0, [0.0, 0.0], [0.0, 0.0], [1.0, -0.5])
    before = profile.sample(0.4)
    profile.plan(0.4, [-1.0, 0.7])
    after = profile.sample(0.4)
    assert after[0] == pytest.approx(before[0])
    assert after[1] == pytest.approx(before[1])
    assert profile.sample(profile.end)[0] == [-1.0, 0.7]


def test_a_joint_faster_than_its_limit_brakes_to_it():
    profile = TrapezoidProfile([0.5], [5.0])
    profile.plan_from(0.0, [0.0], [1.5], [2.0])
    assert profile.sample(0.1)[1] == pytest.approx([1.0])
    assert profile.sample(0.5)[1] == pytest.approx([0.5])


def test_a_joint_that_runs_past_its_goal_comes_back():
    profile = TrapezoidProfile([1.0], [1.0])
    profile.plan_from(0.0, [0.0], [1.0], [0.1])
    assert max(profile.sample(0.01 * k)[0][0] for k in range(300)) == pytest.approx(0.5, abs=0.01)
    assert profile.sample(profile.end)[0] == [0.1]


def test_a_longer_duration_lowers_the_cruise_velocity_to_what_fits():
    cruise = cruise_velocity(1.0, 0.0, 5.0, 3.0)
    assert cruise * (3.0 - cruise / 5.0) == pytest.approx(1.0)


def test_a_way_of_zero_takes_no_time():
    profile = TrapezoidProfile([1.0], [5.0])
    profile.plan_from(2.0, [0.3], [0.0], [0.3])
    assert profile.duration == 0.0
    assert profile.sample(2.0) == ([0.3], [0.0])


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_limits_that_are_not_positive_and_finite_are_refused(bad):
    with pytest.raises(HricError, match="positive and finite"):
        TrapezoidProfile([bad], [1.0])
