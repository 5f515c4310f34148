"""Readings of a running system tell values, limits and decisions, and say what is not known."""

import math
from typing import Any

import pytest
from sensor_msgs.msg import JointState

from control_msgs.msg import JointTrajectoryControllerState
from hric_control.limits import JointLimits
from hric_core.robot_time import stamps
from hric_msgs.msg import ClockPair, SafetyState, SampleChunk
from hric_view.parts import LOST, LiveState
from hric_view.readings import PACE_PERIOD, LiveEmg, LiveLimits, LivePace, LiveSafety, LiveSetpoint

LIMITS = {name: JointLimits(name, lower=-1.0, upper=2.0, velocity=2.0, effort=10.0) for name in ("one", "two")}


@pytest.mark.parametrize(
    ("state", "near"),
    [
        ((1.0, 0.0, 0.0), None),
        ((1.9, 0.0, 0.0), (1, "0.10 rad from its upper end")),
        ((1.0, 0.0, -9.8), (2, "98 % of its effort")),
        ((1.9, 0.0, math.nan), (1, "0.10 rad from its upper end; effort not known")),
    ],
)
def test_joints_near_a_limit_are_named(state: tuple[float, float, float], near: tuple[int, str] | None) -> None:
    limits = LiveLimits(["one", "two"], LIMITS)
    limits.push(JointState(name=["two"], position=[state[0]], velocity=[state[1]], effort=[state[2]]))
    shown: Any = limits.frame()["near"]
    assert shown.get("two") == near
    assert shown["one"] == (0, "position and velocity and effort not known")


def test_the_effort_of_a_silent_joint_is_unknown() -> None:
    limits = LiveLimits(["one", "two"], LIMITS)
    limits.push(JointState(name=["two"], position=[0.0], velocity=[0.0], effort=[1.234]))
    assert limits.frame()["efforts"] == [None, 1.23]
    assert limits.frame() == {}


def test_emg_is_the_mean_since_the_last_frame() -> None:
    emg = LiveEmg(30.0)
    emg.push(SampleChunk(channels=["biceps", "dead"], rate=100.0, data=[0.1, math.nan, 0.3, math.nan]))
    assert emg.frame() == {"emg": {"biceps": pytest.approx(0.2), "dead": None}}
    assert emg.frame() == {}


def test_joints_without_a_setpoint_are_unknown() -> None:
    setpoint = LiveSetpoint(["one", "finger"])
    message = JointTrajectoryControllerState(joint_names=["one"])
    setpoint.push(message)
    assert setpoint.frame() == {}
    message.desired.positions = [0.5]
    assert setpoint.frame() == {"setpoint": [0.5, None]}


@pytest.fixture
def pace(monkeypatch: pytest.MonkeyPatch) -> LivePace:
    monkeypatch.setattr(LiveState, "patience", LOST)
    return LivePace()


def pair(wall: float, run: float, factor: float, scheduled: bool = True) -> ClockPair:
    return ClockPair(round(1e9 * wall), stamps.to_time(run), factor, scheduled)


@pytest.mark.parametrize(("later", "achieved"), [(1.0, 0.2), (5.0, None)])
def test_requested_and_achieved_pace_are_told(pace: LivePace, later: float, achieved: float | None) -> None:
    pace.push(pair(10.0, 1.0, 0.25))
    pace.push(pair(10.0 + later * PACE_PERIOD, 1.0 + 0.2 * later * PACE_PERIOD, 0.25))
    assert pace.frame() == {"pace": {"requested": 0.25, "achieved": achieved}}
    assert LiveSafety().patience == 4.0 * LOST


def test_a_real_arm_has_no_pace_of_a_simulation(pace: LivePace) -> None:
    pace.push(pair(10.0, 1.0, 1.0, scheduled=False))
    assert pace.frame() == {"pace": None}


def test_a_decision_without_a_distance_says_so() -> None:
    safety = LiveSafety()
    safety.push(SafetyState(state="stopped", fault="stale", reason="other", separation=math.nan, protective=math.nan))
    decision = safety.frame()["safety"]
    assert decision["separation"] is None and decision["reason"] == "stale"  # type: ignore[index]
