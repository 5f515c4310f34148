"""Targets that follow from marker samples, and the samples from which none follows."""

import dataclasses
import itertools
import math

import pytest

from hric_controllers.cartesian.workspace import Box, FrameRotation
from hric_controllers.marker.follower import (
    NEXT,
    FollowerConfig,
    FollowerEvent,
    FollowerState,
    MarkerFollower,
    PoseOffset,
)
from hric_controllers.marker.sample import MarkerSample, SampleValidator
from hric_core.errors import HricError
from hric_core.geometry import quaternions

THESIS = FrameRotation(((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)))
CONFIG = FollowerConfig(THESIS, Box((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5)), SampleValidator(10.0, 0.1), lost_after=0.05)
HERE = PoseOffset((0.4, 0.0, 0.5))


def follower(**changes):
    lines = []
    made = MarkerFollower(dataclasses.replace(CONFIG, **changes), lambda warn, text: lines.append(text))
    return made, lines


def test_the_first_marker_sets_the_origin_and_relative_motion_goes_through_the_frame_rotation():
    made, lines = follower()
    assert made.tracking is FollowerState.WAITING
    assert made.take(MarkerSample((2.0, 1.0, -3.0)), 0.0, HERE) == HERE
    target = made.take(MarkerSample((2.01, 1.02, -2.97)), 0.01, HERE)
    assert target.position == pytest.approx((0.41, -0.03, 0.52))  # (x, y, z) -> (x, -z, y)
    assert made.tracking is FollowerState.FOLLOWING and len(lines) == 1


def test_a_marker_given_in_the_base_is_not_rotated():
    made, _ = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0), in_base=True), 0.0, HERE)
    assert made.take(MarkerSample((0.01, 0.02, 0.03), in_base=True), 0.01, HERE).position == pytest.approx(
        (0.41, 0.02, 0.53)
    )


def test_y_up_and_z_up_streams_give_the_same_motion():
    up_y, up_z = follower()[0], follower(rotation=FrameRotation(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))))[0]
    for k in range(100):
        x, y, z = 0.1 * math.sin(0.1 * k), 0.05 * math.cos(0.07 * k), 0.002 * k
        one, two = (
            up_z.take(MarkerSample((x, y, z)), 0.01 * k, HERE),
            up_y.take(MarkerSample((x, z, -y)), 0.01 * k, HERE),
        )
        assert one.position == pytest.approx(two.position, abs=1e-12)


def test_a_marker_is_lost_after_silence_and_after_as_much_time_with_invalid_ones_and_that_is_reported_once():
    for sends in (False, True):
        made, lines = follower()
        made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
        gone = []
        for k in range(1, 100):
            time = 0.001 * k
            if sends:
                assert made.take(MarkerSample((0.0, 0.0, 0.0), valid=False), time, HERE) is None
            if made.lost(time):
                gone.append(time)
        assert gone == pytest.approx([0.051])
        assert made.tracking is FollowerState.LOST and made.counts.losses == 1
        assert sum("is lost" in line for line in lines) == 1


def test_one_invalid_sample_loses_nothing():
    made, _ = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
    made.take(MarkerSample((9.0, 9.0, 9.0), valid=False), 0.004, HERE)
    assert not made.lost(0.004)
    assert made.take(MarkerSample((0.01, 0.0, 0.0)), 0.008, HERE).position == pytest.approx((0.41, 0.0, 0.5))


@pytest.mark.parametrize("catch_up", [False, True])
def test_on_return_both_are_anchored_anew_or_the_marker_is_caught_up_with(catch_up):
    made, lines = follower(catch_up=catch_up)
    made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
    assert made.lost(0.1)
    stopped = PoseOffset((0.42, 0.0, 0.5))
    back = made.take(MarkerSample((0.3, 0.0, 0.0)), 0.5, stopped)
    assert back.position == pytest.approx((0.7, 0.0, 0.5) if catch_up else stopped.position)
    onwards = made.take(MarkerSample((0.31, 0.0, 0.0)), 0.504, stopped)
    assert onwards.position[0] - back.position[0] == pytest.approx(0.01)
    assert "catches up" in lines[-1] if catch_up else "new origins" in lines[-1]


NAN = float("nan")
UNBELIEVABLE = {
    "position not finite": MarkerSample((NAN, 0.0, 0.0)),
    "further from the origin of its frame than largest_distance": MarkerSample((1e30, 0.0, 0.0)),
    "further from the previous marker than largest_step": MarkerSample((0.2, 0.0, 0.0)),
    "not newer than the previous marker": MarkerSample((0.0, 0.0, 0.0), stamp=1.0),
    "in another frame than the previous marker": MarkerSample((0.0, 0.0, 0.0), in_base=True),
}


@pytest.mark.parametrize("reason", UNBELIEVABLE)
def test_an_invalid_sample_is_refused_counted_by_reason_and_reported_once(reason):
    made, lines = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0), stamp=1.0), 0.0, HERE)
    for _ in range(3):
        assert made.take(UNBELIEVABLE[reason], 0.01, HERE) is None
    assert made.counts.refused == {reason: 3}
    assert sum(reason in line for line in lines) == 1
    assert made.lost(0.06)  # refused ones do not keep it alive


@pytest.mark.parametrize("attitude", [None, (0.0, 0.0, 0.0, 0.5), (NAN, 0.0, 0.0, 1.0)])
def test_an_attitude_that_is_none_is_refused_where_attitudes_are_followed(attitude):
    made, _ = follower(follow_attitude=True, validator=SampleValidator(10.0, 0.1, attitude=True))
    assert made.take(MarkerSample((0.0, 0.0, 0.0), attitude=attitude), 0.0, HERE) is None
    assert made.counts.refused == {"no unit quaternion": 1} and made.tracking is FollowerState.WAITING


def test_after_a_jump_that_stays_the_marker_is_lost_and_then_followed_from_its_new_place_without_motion():
    made, _ = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
    targets = []
    for k in range(1, 30):
        time = 0.004 * k
        targets.append(made.take(MarkerSample((1.0, 0.0, 0.0)), time, HERE))
        made.lost(time)
    assert [target for target in targets if target is not None] == [HERE] * 16
    assert made.counts.losses == 1


def test_a_clock_that_went_back_is_accepted_after_the_loss():
    made, _ = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0), stamp=100.0), 0.0, HERE)
    assert made.take(MarkerSample((0.0, 0.0, 0.0), stamp=1.0), 0.01, HERE) is None
    assert made.lost(0.06)
    assert made.take(MarkerSample((0.0, 0.0, 0.0), stamp=1.06), 0.07, HERE) == HERE


def test_targets_outside_of_the_workspace_are_brought_to_its_border_and_counted():
    made, _ = follower(workspace=Box((0.3, -0.05, 0.4), (0.45, 0.05, 0.6)))
    made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
    assert made.take(MarkerSample((0.09, 0.0, 0.0)), 0.01, HERE).position == pytest.approx((0.45, 0.0, 0.5))
    assert made.counts.clamped == 1


def test_the_attitude_turns_the_end_effector_about_the_same_axis_as_the_marker():
    made, _ = follower(follow_attitude=True, validator=SampleValidator(10.0, 0.1, attitude=True))
    tilted = quaternions.from_rotation_vector((0.3, -0.2, 0.9))
    made.take(MarkerSample((0.0, 0.0, 0.0), attitude=tilted), 0.0, HERE)
    about_up = quaternions.product(
        quaternions.from_rotation_vector((0.0, 0.4, 0.0)), tilted
    )  # y is up in the marker's frame
    assert made.take(MarkerSample((0.0, 0.0, 0.0), attitude=about_up), 0.01, HERE).rotation == pytest.approx(
        (0.0, 0.0, 0.4)
    )
    far = quaternions.product(quaternions.from_rotation_vector((0.0, 2.8, 0.0)), tilted)
    assert made.take(MarkerSample((0.0, 0.0, 0.0), attitude=far), 0.02, HERE) is None
    assert made.counts.refused == {"rotates the end effector by more than largest_turn": 1}


def test_a_commanded_pose_goes_before_markers_until_it_is_reached():
    made, _ = follower()
    made.take(MarkerSample((0.0, 0.0, 0.0)), 0.0, HERE)
    made.command()
    assert made.take(MarkerSample((0.01, 0.0, 0.0)), 0.01, HERE) is None
    assert not made.lost(5.0) and made.tracking is FollowerState.COMMANDED
    made.arrived()
    there = PoseOffset((0.5, 0.1, 0.6))
    assert made.take(MarkerSample((0.9, 0.0, 0.0)), 6.0, there) == there


def drive(made, event, time):
    if event is FollowerEvent.VALID:
        made.take(MarkerSample((0.0, 0.0, 0.0)), time, HERE)
    elif event is FollowerEvent.GONE:
        made.lost(time + 1.0)
    else:
        {FollowerEvent.COMMAND: made.command, FollowerEvent.ARRIVED: made.arrived}[event]()


WAY = {
    FollowerState.WAITING: [],
    FollowerState.FOLLOWING: [FollowerEvent.VALID],
    FollowerState.LOST: [FollowerEvent.VALID, FollowerEvent.GONE],
    FollowerState.COMMANDED: [FollowerEvent.COMMAND],
}


@pytest.mark.parametrize(("tracking", "event"), list(itertools.product(FollowerState, FollowerEvent)))
def test_each_arrow_of_the_table_and_each_missing_one(tracking, event):
    made, _ = follower()
    for step, past in enumerate(WAY[tracking]):
        drive(made, past, 0.01 * step)
    assert made.tracking is tracking
    drive(made, event, 0.03)
    assert made.tracking is NEXT.get((tracking, event), tracking)


@pytest.mark.parametrize(
    "rows", [((1, 0, 0), (0, 1, 0), (0, 0, -1)), ((1, 0, 0), (0, 2, 0), (0, 0, 1)), ((NAN, 0, 0), (0, 1, 0), (0, 0, 1))]
)
def test_a_frame_rotation_that_mirrors_or_stretches_is_refused(rows):
    with pytest.raises(HricError, match="valid: a rotation matrix"):
        FrameRotation(rows)


def test_a_workspace_whose_corners_are_crossed_is_refused():
    with pytest.raises(HricError, match=r"upper is .* valid: above lower"):
        Box((0.0, 0.0, 0.5), (1.0, 1.0, 0.4))
