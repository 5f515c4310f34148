"""Decisions of a supervisor, read from messages."""

import math
from types import SimpleNamespace

import pytest

from hric_bags.records.safety_record import EVENT_TYPE, STATE_TYPE, SafetyMessages


def header(time):
    return SimpleNamespace(stamp=SimpleNamespace(sec=int(time), nanosec=round(1e9 * (time % 1.0))))


def state(time, state="free", scale=1.0, violation=False, fault=""):
    distance = math.nan if fault else 1.0
    numbers = {"separation": distance, "protective": 0.4, "margin": 0.6, "latency": math.nan}
    return SimpleNamespace(
        header=header(time), mode="m", state=state, scale=scale, violation=violation, fault=fault, **numbers
    )


def record(*states, events=(), offset=0.0):
    taken = SafetyMessages()
    for one in states:
        taken.add(STATE_TYPE, one)
    for time, kind in events:
        taken.add(EVENT_TYPE, SimpleNamespace(header=header(time), kind=kind, text="t", separation=1.0, margin=0.5))
    return taken.record(lambda stamp: stamp - offset)


def test_a_state_lasts_until_the_next_decision_however_far_they_are_apart():
    found = record(state(1.0), state(2.0, "stopped"), state(5.0, "slowed"), state(6.0))
    assert found.share("stopped") == pytest.approx(3.0 / 5.0) and found.share("slowed") == pytest.approx(1.0 / 5.0)
    assert found.stretches("stopped") == [(2.0, 5.0)] and found.stretches("free") == [(1.0, 2.0), (6.0, 6.0)]


def test_violations_are_stretches_and_the_last_one_ends_with_the_record():
    found = record(*(state(0.1 * k, violation=k in (1, 2, 5)) for k in range(1, 6)))
    assert found.violations == [pytest.approx((0.1, 0.3)), pytest.approx((0.5, 0.5))]


def test_times_are_the_robots_and_in_their_order():
    found = record(state(12.0, "stopped"), state(11.0), events=[(11.5, "stopped"), (11.2, "slowed")], offset=10.0)
    assert found.time.tolist() == [1.0, 2.0] and found.state.tolist() == [0, 2]
    assert [one.kind for one in found.events] == ["slowed", "stopped"]
    assert [one.time for one in found.events] == pytest.approx([1.2, 1.5])


def test_a_bag_without_decisions_has_no_record():
    assert record(events=[(1.0, "fault")]) is None
