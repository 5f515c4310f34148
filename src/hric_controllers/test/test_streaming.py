"""Motion behind a stream of targets: its limits, its error against ideal interpolation, and its end."""

import math

import numpy as np
import pytest

from hric_controllers.streaming.follower import StreamFollower, StreamLimits

LIMITS = StreamLimits((1.5, 1.5), (7.5, 7.5), (500.0, 500.0))
RANGES = [(-3.0, 3.0), (-3.0, 3.0)]


def wave(time):
    """Return the motion of the person at the other end, up to 0.8 rad/s and 2 rad/s^2 [rad]."""
    return [0.3 * math.sin(1.57 * time), 0.3 * math.sin(2.67 * time) * math.cos(0.3 * time)]


def messages(rate, seconds, lost=0.0, jitter=0.0, twice=0.0, seed=0):
    """Return (arrival, stamp) of each message [s]; `lost`, `twice`: shares, `jitter`: largest delay [s]."""
    random = np.random.default_rng(seed)
    stamps = [k / rate for k in range(int(seconds * rate)) if random.random() >= lost]
    stamps += [stamp for stamp in stamps if random.random() < twice]
    return sorted((stamp + 0.005 + jitter * random.random(), stamp) for stamp in stamps)


def followed(sent, seconds, stamped=True, ranges=RANGES, scale=1.0, target=wave):
    """Return the positions of each millisecond, shape (n, 2) [rad]."""
    follower, way, waiting = StreamFollower(LIMITS, ranges), [], list(sent)
    follower.start(target(0.0))
    for time in np.arange(round(seconds * 1000)) * 1e-3:
        while waiting and waiting[0][0] <= time:
            _, stamp = waiting.pop(0)
            follower.take(time, target(stamp), stamp if stamped else None)
        follower.advance(time, 1e-3, scale)
        way.append(follower.position)
    return np.array(way)


def lag_and_rms(way):
    """Return the lag behind the ideal motion [s] and the RMS error without it [rad], after the first second."""
    ideal = np.array([wave(time) for time in np.arange(len(way)) * 1e-3])
    errors = [np.sqrt(np.mean((way[1000:] - ideal[1000 - lag : len(way) - lag]) ** 2)) for lag in range(0, 300, 5)]
    return 5e-3 * int(np.argmin(errors)), min(errors)


def rates(way):
    """Return the largest velocity, acceleration and jerk of a motion sampled at 1 kHz."""
    return [np.abs(np.diff(way, order, axis=0)).max() * 1e3**order for order in (1, 2, 3)]


@pytest.mark.parametrize(("rate", "largest"), [(10, 0.003), (20, 0.001), (50, 0.001)])
def test_a_perfect_stream_is_followed_one_period_later(rate, largest):
    lag, rms = lag_and_rms(followed(messages(rate, 10.0), 9.5))
    assert lag <= 1.3 / rate and rms <= largest


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize(("rate", "largest"), [(10, 0.04), (20, 0.02), (50, 0.008)])
def test_a_stream_with_a_third_lost_late_and_doubled_targets_stays_within_the_limits(rate, largest, stamped, figure):
    way = followed(messages(rate, 60.0, lost=0.3, jitter=0.02, twice=0.1), 59.5, stamped)
    lag, rms = lag_and_rms(way)
    figure(f"stream of {rate} Hz, {'with' if stamped else 'without'} stamps, 30 % lost: lag", 1e3 * lag, "ms")
    figure(f"stream of {rate} Hz, {'with' if stamped else 'without'} stamps, 30 % lost: rms", 1e3 * rms, "mrad")
    assert rms <= largest and lag <= 2.0 / rate + 0.04
    assert np.all(rates(way) <= np.array([1.5, 7.5, 500.0]) * 1.001)


def test_a_stream_that_ceases_ends_at_its_last_target():
    way = followed(messages(20, 5.0), 7.0)
    assert way[-1] == pytest.approx(wave(4.95), abs=1e-9)
    assert way[-500:] == pytest.approx(np.tile(way[-1], (500, 1)), abs=1e-9)


def test_a_single_target_is_a_setpoint_reached_without_overshoot():
    way = followed([(0.1, 0.0)], 4.0, target=lambda time: [0.0, 0.0] if time == 0.0 else [1.0, 1.0])
    assert way[-1] == pytest.approx([0.0, 0.0])
    follower = StreamFollower(LIMITS, RANGES)
    positions = []
    follower.take(0.0, [1.0, -2.0])
    for cycle in range(4000):
        follower.advance(cycle * 1e-3, 1e-3)
        positions.append(follower.position)
    assert positions[-1] == pytest.approx([1.0, -2.0], abs=1e-9)
    assert np.max(positions, axis=0)[0] <= 1.0 + 1e-6 and np.min(positions, axis=0)[1] >= -2.0 - 1e-6
    assert np.all(rates(np.array(positions)) <= np.array([1.5, 7.5, 500.0]) * 1.001)


@pytest.mark.parametrize("seed", range(20))
def test_targets_that_jump_at_random_never_exceed_a_limit(seed):
    random = np.random.default_rng(seed)
    follower, positions, time = StreamFollower(LIMITS, RANGES), [], 0.0
    for _ in range(60):
        follower.take(time, random.uniform(-3.0, 3.0, 2).tolist(), None if seed % 2 else time)
        for _ in range(int(random.choice([3, 20, 50, 100, 700]))):
            follower.advance(time, 1e-3)
            positions.append(follower.position)
            time += 1e-3
    assert np.all(rates(np.array(positions)) <= np.array([1.5, 7.5, 500.0]) * 1.001)
    assert np.abs(positions).max() <= 3.0 + 0.01


def test_a_bridged_gap_does_not_leave_the_range():
    sent = [(time, time) for time in (0.0, 0.1, 0.2, 0.3)]
    way = followed(sent, 2.0, ranges=[(-0.5, 0.5)] * 2, target=lambda time: [1.5 * time, 0.0])
    assert way[:, 0].max() <= 0.5 + 0.01 and way[-1][0] == pytest.approx(0.45)


def test_two_senders_of_one_stream_do_not_lead_far_beyond_their_targets():
    """The line through targets of both senders, 1 ms apart, is far steeper than their motion."""
    sent = [(stamp + 0.005, stamp) for k in range(60) for stamp in (0.1 * k, 0.1 * k + 1e-3)]
    way = followed(
        sent, 6.0, target=lambda stamp: np.add(wave(stamp), [0.5 * (5e-4 < stamp % 0.1 < 0.05), 0.0]).tolist()
    )
    braking, bridged = 1.5**2 / (2.0 * 7.5), 1.5 * 0.1
    assert way[:, 0].max() < 0.8 + braking + bridged


def test_an_older_target_and_a_repeated_one_are_ignored():
    follower = StreamFollower(LIMITS, RANGES)
    follower.take(0.00, [0.0, 0.0], 10.0)
    follower.take(0.10, [0.1, 0.1], 10.1)
    for stamp in (10.1, 10.05):
        follower.take(0.15, [9.9, 9.9], stamp)
    for cycle in range(150, 3000):
        follower.advance(cycle * 1e-3, 1e-3)
    assert follower.position == pytest.approx([0.1, 0.1])


def test_the_speed_scale_slows_the_motion_and_0_stops_it():
    sent = messages(20, 20.0)
    assert rates(followed(sent, 20.0, scale=0.2))[0] <= 0.3 + 1e-6
    assert rates(followed(sent, 2.0, scale=0.0))[0] == 0.0
