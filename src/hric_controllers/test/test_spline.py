import pytest

from hric_controllers.trajectory.spline import SplineSegment, SplineTrack, Waypoint, follow, hold, stop


def numeric(segment, t, h=1e-6):
    (a, va, _), (b, vb, _) = segment.sample(t - h), segment.sample(t + h)
    return (b - a) / (2 * h), (vb - va) / (2 * h)


def test_a_quintic_meets_position_velocity_and_acceleration_at_both_ends():
    segment = SplineSegment(Waypoint(1.0, 0.2, 0.3, -0.4), Waypoint(3.0, 1.0, -0.5, 0.6))
    assert segment.sample(1.0) == pytest.approx((0.2, 0.3, -0.4))
    assert segment.sample(3.0 - 1e-12) == pytest.approx((1.0, -0.5, 0.6), abs=1e-9)


def test_a_cubic_meets_position_and_velocity_at_both_ends():
    segment = SplineSegment(Waypoint(0.0, 0.2, 0.3), Waypoint(2.0, 1.0, -0.5))
    assert segment.sample(0.0)[:2] == pytest.approx((0.2, 0.3))
    assert segment.sample(2.0 - 1e-12)[:2] == pytest.approx((1.0, -0.5), abs=1e-9)


def test_one_end_without_velocity_makes_a_straight_line():
    segment = SplineSegment(Waypoint(0.0, 0.0, 0.3, 0.1), Waypoint(2.0, 1.0))
    assert segment.sample(0.5) == pytest.approx((0.25, 0.5, 0.0))


def test_one_end_without_acceleration_makes_a_cubic():
    assert SplineSegment(Waypoint(0.0, 0.0, 0.0, 0.0), Waypoint(1.0, 1.0, 0.0)).sample(0.0)[2] == pytest.approx(6.0)


@pytest.mark.parametrize("last", [Waypoint(2.0, 1.0), Waypoint(2.0, 1.0, 0.7), Waypoint(2.0, 1.0, 0.7, -0.2)])
def test_velocity_and_acceleration_are_the_derivatives_of_the_position(last):
    segment = SplineSegment(Waypoint(0.0, 0.1, 0.2, 0.3), last)
    for t in (0.1, 0.7, 1.9):
        assert numeric(segment, t) == pytest.approx(segment.sample(t)[1:], abs=1e-5)


def test_before_its_start_and_after_its_end_a_segment_rests():
    segment = SplineSegment(Waypoint(1.0, 0.1, 0.2), Waypoint(2.0, 1.0, 0.7))
    assert segment.sample(0.5) == (0.1, 0.0, 0.0)
    assert segment.sample(2.5) == (1.0, 0.0, 0.0)


def test_a_track_passes_all_its_waypoints_and_rests_at_the_last():
    points = [Waypoint(1.0, 0.5, 0.1), Waypoint(2.0, -0.5, 0.2), Waypoint(3.0, 0.0, 0.0)]
    track = follow(0.0, (0.2, 0.0, 0.0), points)
    assert track.sample(0.0)[0] == pytest.approx(0.2)
    for point in points:
        assert track.sample(point.time)[0] == pytest.approx(point.position)
    assert track.sample(9.0) == (0.0, 0.0, 0.0)
    assert track.end == 3.0


def test_following_leaves_a_moving_state_without_a_jump():
    track = follow(0.5, (0.2, 0.4, -0.1), [Waypoint(1.0, 0.5, 0.0, 0.0)])
    assert track.sample(0.5) == pytest.approx((0.2, 0.4, -0.1))


def test_waypoints_that_are_past_are_left_out():
    track = follow(1.5, (0.0, 0.0, 0.0), [Waypoint(1.0, 5.0, 0.0), Waypoint(2.0, 1.0, 0.0)])
    assert len(track.segments) == 1
    assert track.sample(2.0)[0] == 1.0


def test_a_stop_brakes_at_a_constant_rate_to_rest():
    track = stop(1.0, 0.5, 2.0, 0.5)
    assert track.sample(1.0)[:2] == pytest.approx((0.5, 2.0))
    assert track.sample(1.25)[1] == pytest.approx(1.0)
    assert track.sample(1.5) == pytest.approx((1.0, 0.0, 0.0))


def test_a_stop_without_a_duration_rests_at_once():
    assert stop(1.0, 0.5, 2.0, 0.0).sample(1.0) == (0.5, 0.0, 0.0)


def test_holding_is_resting():
    assert hold(1.0, 0.3).sample(7.0) == (0.3, 0.0, 0.0)


def test_looking_at_a_track_does_not_move_it():
    track = SplineTrack(
        [SplineSegment(Waypoint(0.0, 0.0), Waypoint(1.0, 1.0)), SplineSegment(Waypoint(1.0, 1.0), Waypoint(2.0, 0.0))]
    )
    assert track.look(1.5)[0] == pytest.approx(0.5)
    assert track.sample(0.5)[0] == pytest.approx(0.5)
