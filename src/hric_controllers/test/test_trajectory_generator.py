"""Online trajectory generator: limits, continuity, and the effect of a noisy marker."""

import math
import random

import numpy as np
import pytest

from hric_controllers.marker.motion import MotionLimits, OnlineTrajectoryGenerator
from hric_core.errors import HricError

LIMITS = MotionLimits(velocity=0.5, acceleration=2.0, jerk=50.0)
DT = 1e-3


def random_targets(seconds, seed, interval=0.03, size=0.3, smoothing=0.0):
    """Positions of each millisecond under targets that change all the time, shape (n, 3), and the targets' range."""
    rng, motion = random.Random(seed), OnlineTrajectoryGenerator(LIMITS, smoothing)
    path = []
    for step in range(round(seconds / DT)):
        if step % round(interval / DT) == 0:
            motion.go([rng.uniform(-size, size) for _ in range(3)])
        motion.advance(DT)
        path.append(motion.position)
    return np.array(path)


@pytest.mark.parametrize("interval", [0.004, 0.03, 0.4])
def test_under_any_targets_velocity_acceleration_and_jerk_stay_within_their_limits(interval):
    path = random_targets(6.0, seed=round(1e3 * interval), interval=interval)
    velocity = np.diff(path, axis=0) / DT
    acceleration = np.diff(velocity, axis=0) / DT
    jerk = np.diff(acceleration, axis=0) / DT
    assert np.abs(velocity).max() <= LIMITS.velocity * (1 + 1e-9)
    assert np.abs(acceleration).max() <= LIMITS.acceleration * (1 + 1e-6)
    assert np.abs(jerk).max() <= LIMITS.jerk * (1 + 1e-3)
    assert np.abs(velocity).max() > 0.1  # it did move


def test_targets_inside_a_box_never_lead_out_of_it():
    path = np.vstack([random_targets(5.0, seed, interval, 0.1) for seed, interval in ((1, 0.02), (2, 0.1), (3, 0.3))])
    assert np.abs(path).max() <= 0.1 + 1e-9


def test_it_arrives_at_the_target_and_rests_there_exactly():
    motion = OnlineTrajectoryGenerator(LIMITS, smoothing_time=0.03)
    motion.start([0.4, 0.0, 0.5])
    motion.go([0.5, -0.1, 0.55])
    for _ in range(3000):
        motion.advance(DT)
    assert motion.position == pytest.approx([0.5, -0.1, 0.55], abs=1e-12)
    assert motion.velocity == [0.0] * 3 and not motion.moving and motion.rest == motion.position


def test_a_single_way_takes_the_time_of_the_textbook():
    """From rest to rest with a and j, the velocity limit not reached: jerk phases of a/j and constant acceleration
    between."""
    way, (a, j) = 0.1, (LIMITS.acceleration, LIMITS.jerk)
    peak = 0.5 * (-(a * a) / j + math.sqrt((a * a / j) ** 2 + 4.0 * a * way))
    assert peak < LIMITS.velocity
    motion = OnlineTrajectoryGenerator(LIMITS, axes=1)
    motion.go([way])
    steps = 0
    while motion.moving:
        motion.advance(DT)
        steps += 1
    assert steps * DT == pytest.approx(2.0 * (peak / a + a / j), abs=2 * DT)


def test_a_stop_ends_as_soon_as_the_limits_allow_where_it_predicts():
    motion = OnlineTrajectoryGenerator(LIMITS)
    motion.go([1.0, 0.2, 0.0])
    for _ in range(600):
        motion.advance(DT)
    v = motion.velocity[0]
    assert v == pytest.approx(LIMITS.velocity)
    motion.stop()
    predicted, steps = motion.rest, 0
    while motion.moving:
        motion.advance(DT)
        steps += 1
    assert steps * DT == pytest.approx(v / LIMITS.acceleration + LIMITS.acceleration / LIMITS.jerk, abs=2 * DT)
    assert motion.position == pytest.approx(predicted, abs=1e-12)


def test_after_a_stop_in_motion_a_new_target_is_followed_without_a_jump():
    motion, path = OnlineTrajectoryGenerator(LIMITS, 0.02), []
    motion.go([1.0, 0.2, 0.0])
    for step in range(3000):
        if step == 500:
            motion.stop()
        if step == 540:
            motion.go([0.0, 0.0, 0.1])
        motion.advance(DT)
        path.append(motion.position)
    assert np.abs(np.diff(path, n=2, axis=0)).max() <= LIMITS.acceleration * DT * DT * (1 + 1e-6)
    assert motion.position == pytest.approx([0.0, 0.0, 0.1], abs=1e-9)


def test_a_lost_cycle_is_made_up_for():
    one, two = OnlineTrajectoryGenerator(LIMITS), OnlineTrajectoryGenerator(LIMITS)
    for motion in (one, two):
        motion.go([0.2, 0.1, 0.0])
    for _ in range(100):
        one.advance(DT)
        one.advance(DT)
        two.advance(2 * DT)
    assert one.position == two.position


def test_a_motion_is_found_to_any_target_from_any_state():
    """Targets of any size, on top of each other or far away, change in every millisecond."""
    rng, motion = random.Random(5), OnlineTrajectoryGenerator(LIMITS)
    for _ in range(20000):
        motion.go([rng.choice((0.0, 1e-12, 1.0, 100.0)) * rng.uniform(-1, 1) for _ in range(3)])
        motion.advance(DT)
    assert max(map(abs, motion.velocity)) <= LIMITS.velocity * (1 + 1e-9)


def test_a_noisy_marker_is_followed_with_little_lag_and_little_shaking():
    """0.1 m at 0.25 Hz, 240 Hz, 0.1 mm of noise on each axis; the arm is ideal here."""
    rng, omega, amplitude = np.random.default_rng(1), 2 * math.pi * 0.25, 0.1
    motion = OnlineTrajectoryGenerator(MotionLimits(0.7, 2.0, 50.0).each_of(3), smoothing_time=0.02)
    samples, path, shaking = 0, [], []
    for step in range(8000):
        if samples / 240 <= step * DT:
            motion.go(np.array([amplitude * math.sin(omega * samples / 240), 0.0, 0.0]) + rng.normal(0.0, 1e-4, 3))
            samples += 1
        motion.advance(DT)
        path.append(motion.position[0])
        shaking.append(motion.acceleration)
    ideal = [amplitude * math.sin(omega * step * DT) for step in range(8000)]
    errors = [np.sqrt(np.mean(np.subtract(path[lag:], ideal[: 8000 - lag]) ** 2)) for lag in range(150)]
    assert np.argmin(errors) <= 110
    assert min(errors) < 1.5e-3
    assert np.sqrt(np.mean(np.sum(np.square(shaking), axis=1))) <= 1.45 * amplitude * omega**2 / math.sqrt(2)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_limits_that_are_not_positive_and_finite_are_refused(bad):
    with pytest.raises(HricError, match="jerk is"):
        MotionLimits(1.0, 1.0, bad)
    with pytest.raises(HricError, match="velocity is"):
        MotionLimits(bad, 1.0, 1.0)
