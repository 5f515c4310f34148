"""The speed scale of a robot: how it moves, when it stops by itself, and who declares that it obeys."""

import itertools
import math
import random

import numpy as np
import pytest
from recorded_calls import FakeController, RecordingRobotHW

from hric_control.manager.controller_manager import ControllerManager
from hric_control.speed_scale import (
    ACCELERATION,
    LONGEST_LEASE,
    MAX_HOLDERS,
    OTHERS,
    RATE,
    UNLIMITED,
    ScaledTime,
    ScaleRequest,
    SpeedScale,
    SpeedScaleInterface,
    stopping_time,
)
from hric_control.speed_scale_topics import REQUEST_TOPIC, STATE_TOPIC, SpeedScaleTopics
from hric_core.errors import CommandError
from hric_core.local.node import LocalNode
from hric_msgs.msg import SpeedScale as SpeedScaleMessage
from hric_msgs.msg import SpeedScaleState

DT = 1e-3


def values(scale, cycles, begin=0.0):
    found = []
    for k in range(cycles):
        scale.advance(begin + k * DT, DT)
        found.append(scale.value)
    return found


def test_it_is_exactly_one_and_costs_nothing_until_somebody_asks():
    scale = SpeedScale()
    assert scale.value == 1.0 and not scale.active and scale.stiffness == scale.force == math.inf


@pytest.mark.parametrize("start", [1.0, 0.3, 0.05])
def test_it_comes_to_a_stop_in_the_stated_time_and_stands_exactly(start):
    scale = SpeedScale()
    scale.request(ScaleRequest(start))
    values(scale, 1000)
    scale.request(ScaleRequest(0.0))
    found = np.array([start, *values(scale, 500)])
    stopped = int(np.flatnonzero(found == 0.0)[0])
    assert stopped * DT == pytest.approx(stopping_time(start), abs=3 * DT)
    assert np.all(np.diff(found) <= 0.0) and found[-1] == 0.0
    # The distance of what moved at v: that of a steady deceleration over the same time, v T / 2.
    assert found.sum() * DT == pytest.approx(0.5 * start * stopping_time(start), rel=0.03)


def test_under_any_requests_it_stays_between_its_ends_and_within_its_rates():
    rng, scale, found = random.Random(3), SpeedScale(), [1.0]
    for k in range(20_000):
        if k % rng.choice((7, 50, 300)) == 0:
            scale.request(ScaleRequest(rng.choice((0.0, 1.0, rng.random()))))
        scale.advance(k * DT, DT)
        found.append(scale.value)
    rate = np.diff(found) / DT
    assert min(found) == 0.0 and max(found) == 1.0
    assert np.abs(rate).max() <= RATE * (1 + 1e-9)
    # Its last step, to the value itself, may be half of one step of the deceleration more.
    assert np.abs(np.diff(rate)).max() / DT <= 1.5 * ACCELERATION * (1 + 1e-6)
    assert np.mean(np.abs(np.diff(rate)) / DT > ACCELERATION * (1 + 1e-6)) < 0.02


def test_without_another_request_in_time_the_robot_stops_and_with_one_it_goes_on():
    scale = SpeedScale()
    scale.request(ScaleRequest(1.0, valid_for=0.1))
    values(scale, 90)
    assert scale.value == 1.0 and not scale.expired
    values(scale, 500, 0.09)
    assert scale.value == 0.0 and scale.expired
    scale.request(ScaleRequest(1.0))
    values(scale, 500, 1.0)
    assert scale.value == 1.0 and not scale.expired and not scale.active


def test_a_request_without_an_end_ends_with_the_longest_lease():
    scale = SpeedScale()
    scale.request(ScaleRequest(0.4), "once")
    assert values(scale, 1000)[-1] == 0.4
    assert values(scale, 1000, LONGEST_LEASE - 2.0)[-1] == 0.4 and not scale.lost
    assert values(scale, 1000, LONGEST_LEASE + 1.0)[-1] == 0.0 and scale.lost == ("once",)
    scale.request(UNLIMITED, "once")
    assert values(scale, 1000, LONGEST_LEASE + 2.0)[-1] == 1.0


def test_of_all_holders_the_smallest_of_each_limit_counts_whoever_requests_last():
    scale = SpeedScale()
    scale.request(ScaleRequest(0.0, stiffness=300.0, valid_for=0.1), "supervisor")
    for k in range(90):
        scale.request(ScaleRequest(1.0, stiffness=900.0, force=20.0), "stranger")
        scale.advance(k * DT, DT)
    assert (scale.target, scale.stiffness, scale.force, scale.holder) == (0.0, 300.0, 20.0, "supervisor")


def test_a_holder_that_falls_silent_stops_the_robot_whatever_another_requests():
    scale = SpeedScale()
    scale.request(ScaleRequest(1.0, valid_for=0.1), "supervisor")
    for k in range(600):
        scale.request(ScaleRequest(1.0, force=20.0), "stranger")
        scale.advance(k * DT, DT)
    assert scale.value == 0.0 and scale.lost == ("supervisor",) and scale.holder == "supervisor"
    scale.request(ScaleRequest(1.0, valid_for=0.1), "supervisor")
    assert values(scale, 90, 0.6)[-1] > 0.0 and not scale.lost


def test_a_holder_gives_its_lease_back_by_a_request_without_limits_and_for_itself_alone():
    scale = SpeedScale()
    scale.request(ScaleRequest(0.3), "a")
    scale.request(ScaleRequest(0.6), "b")
    values(scale, 500)
    scale.request(UNLIMITED, "a")
    scale.request(UNLIMITED, "stranger")
    assert values(scale, 500, 0.5)[-1] == 0.6 and scale.holder == "b"
    scale.request(UNLIMITED, "b")
    assert values(scale, 500, 1.0)[-1] == 1.0 and not scale.active and scale.holder == ""


def test_a_lost_holder_that_gives_its_lease_back_lets_the_robot_go():
    scale = SpeedScale()
    scale.request(ScaleRequest(1.0, valid_for=0.1), "a")
    values(scale, 10)
    assert scale.holder == ""  # it limits nothing
    values(scale, 500, 0.01)
    assert scale.lost == ("a",)
    scale.request(UNLIMITED, "a")
    assert values(scale, 500, 0.5)[-1] == 1.0 and not scale.active


def test_holders_beyond_those_that_are_told_apart_only_make_the_robot_slower():
    scale = SpeedScale()
    for k in range(MAX_HOLDERS):
        scale.request(ScaleRequest(0.9), f"h{k}")
    values(scale, 1)
    for at, requested in enumerate((0.2, 0.8, 1.0)):
        scale.request(ScaleRequest(requested), f"more{at}")
        values(scale, 1, at * DT)
        assert scale.target == 0.2 and scale.holder == OTHERS


def test_requests_without_a_name_never_replace_a_slower_one():
    scale = SpeedScale()
    for k, requests in enumerate(([0.3, 0.9], [0.6], [UNLIMITED.scale])):
        for requested in requests:
            scale.request(ScaleRequest(requested), OTHERS)
        values(scale, 1, k * DT)
        assert scale.target == 0.3


def test_a_clock_that_is_set_back_makes_no_lease_longer():
    scale = SpeedScale()
    scale.request(ScaleRequest(1.0, valid_for=0.1), "a")
    values(scale, 50, 1000.0)
    values(scale, 90)
    assert not scale.lost
    values(scale, 50, 0.09)
    assert scale.lost == ("a",)


@pytest.mark.parametrize(
    "request_",
    [
        ScaleRequest(1.1),
        ScaleRequest(-0.1),
        ScaleRequest(math.nan),
        ScaleRequest(1.0, force=-1.0),
        ScaleRequest(1.0, math.nan),
    ],
)
def test_a_request_that_cannot_be_is_refused_and_the_one_before_stays(request_):
    scale = SpeedScale()
    scale.request(ScaleRequest(0.5))
    with pytest.raises(CommandError, match="valid: 0"):
        scale.request(request_)
    assert values(scale, 500)[-1] == 0.5


def test_the_time_of_a_motion_is_robot_time_to_the_bit_as_long_as_the_scale_is_one():
    along = ScaledTime(SpeedScale())
    along.restart(0.1)
    assert all(along.along(0.1 + k * DT, DT) == 0.1 + k * DT for k in range(1000))


def test_the_time_of_a_motion_stands_where_the_scale_is_zero_and_never_goes_back():
    scale = SpeedScale()
    along = ScaledTime(scale)
    along.restart(0.0)
    times = []
    for k in range(2000):
        if k in (300, 1200):
            scale.request(ScaleRequest(0.0 if k == 300 else 1.0))
        scale.advance(k * DT, DT)
        times.append(along.along(k * DT, DT))
    steps = np.diff(times)
    assert np.all(steps >= 0.0) and np.all(np.abs(steps[700:1150]) < 1e-12)
    assert steps[-1] == pytest.approx(DT) and along.lag == pytest.approx(0.9, abs=0.02)


class Obeying(FakeController):
    def init(self, robot_hw, root_node, controller_node):
        super().init(robot_hw, root_node, controller_node)
        robot_hw.get(SpeedScaleInterface).handle()


def test_the_list_of_controllers_shows_who_obeys():
    node = LocalNode({name: {"type": name, "joints": [joint]} for name, joint in (("a", "joint1"), ("b", "joint2"))})
    manager = ControllerManager(RecordingRobotHW(), node, {"a": Obeying, "b": FakeController})
    for name in ("a", "b"):
        manager.load(name)
    manager.switch(["a", "b"], [], loop_running=False)  # one resource for all is no conflict
    claims = {status.name: status.claims for status in manager.list()}
    assert claims["a"]["hric_control::SpeedScaleInterface"] == ("speed_scale",)
    assert "hric_control::SpeedScaleInterface" not in claims["b"]


def test_a_request_by_topic_is_answered_with_the_cycle_that_took_it_up():
    node, scale, got = LocalNode(), SpeedScale(), []
    from hric_core.robot_time import stamps

    topics = SpeedScaleTopics(node, scale, stamps.to_time)
    node.subscribe(STATE_TOPIC, SpeedScaleState, got.append)
    requests = node.advertise(REQUEST_TOPIC, SpeedScaleMessage)
    message = SpeedScaleMessage(scale=0.25, stiffness=math.inf, force=50.0, valid_for=0.1)
    message.header.stamp = stamps.to_time(1.0)
    requests.publish(message)
    for k in itertools.count():
        if k == 400:
            break
        if scale.active:
            topics.advance(1.02 + k * DT, DT)
    assert [state.expired for state in got] == [False, True]
    first, last = got
    assert (first.header.stamp.to_sec(), first.request.to_sec(), first.requested) == (1.02, 1.0, 0.25)
    assert first.force == 50.0 and last.requested == 0.0 and scale.value == 0.0


def test_a_second_publisher_of_the_topic_never_speeds_the_robot_up_and_who_is_lost_is_named():
    from hric_core.robot_time import stamps

    node, scale, states = LocalNode(), SpeedScale(), []
    topics = SpeedScaleTopics(node, scale, stamps.to_time)
    node.subscribe(STATE_TOPIC, SpeedScaleState, states.append)
    supervisor = node.child("supervisor").advertise(f"/{REQUEST_TOPIC}", SpeedScaleMessage)
    strangers = [node.advertise(REQUEST_TOPIC, SpeedScaleMessage) for _ in range(2)]
    supervisor.publish(SpeedScaleMessage(scale=0.2, stiffness=math.inf, force=math.inf, valid_for=0.5))
    for k in range(1000):
        strangers[0].publish(SpeedScaleMessage(scale=0.6, stiffness=math.inf, force=math.inf, valid_for=0.0))
        strangers[1].publish(SpeedScaleMessage(scale=1.0, stiffness=math.inf, force=math.inf, valid_for=0.0))
        topics.advance(k * DT, DT)
        if k == 400:
            assert scale.value == 0.2
    assert scale.value == 0.0 and states[0].holder == "/supervisor" and not states[0].expired
    assert states[-1].expired and states[-1].holder == "/supervisor"
