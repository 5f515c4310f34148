"""Headline of a report."""

from typing import Any

import pytest
from made_up import run_metrics

from hric_analysis.comparison import JointDifference, SetpointDifference
from hric_analysis.values import RunMetrics
from hric_report import headline


def move(settled: float | None = 1.5) -> dict[str, Any]:
    other = {"final_error": 1e-9, "overshoot": 2e-3, "settling_time": {"0.01": 0.5, "0.001": 0.5}}
    worst = {"final_error": -2.5e-6, "overshoot": 0.0, "settling_time": {"0.01": 1.0, "0.001": settled}}
    return {"joints": {"j1": other, "j2": worst}}


def shown(values: RunMetrics, run: dict[str, Any] | None = None) -> dict[str, tuple[str, str]]:
    return {one.name: (one.value, one.kind) for one in headline.of_run(run or {}, values)}


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0 rad"), (1.93e-6, "1.93 µrad"), (-0.0516, "-51.6 mrad"), (2.0, "2.00 rad"), (1234.5, "1234 rad")],
)
def test_a_small_value_gets_a_prefix_and_keeps_three_digits(value: float, text: str) -> None:
    assert headline.scaled(value, "rad") == text


def test_what_is_not_known_is_said_to_be_so() -> None:
    assert headline.scaled(None, "rad") == headline.scaled(float("nan"), "rad") == "not known"


def test_a_step_is_summed_up_by_its_worst_joint() -> None:
    found = headline.of_run({}, run_metrics(setpoints=[move()]))
    assert [(one.name, one.value) for one in found] == [
        ("Final error", "2.50 µrad"),
        ("Settling time", "1.50 s"),
        ("Overshoot", "2.00 mrad"),
        ("Stability", "stable"),
    ]
    assert found[0].meaning.endswith("j2") and found[2].meaning.endswith("j1")


def test_a_joint_that_never_settles_is_named() -> None:
    (found,) = (one for one in headline.of_run({}, run_metrics(setpoints=[move(None)])) if one.name == "Settling time")
    assert (found.value, found.kind) == ("never", headline.BAD) and "j2" in found.meaning


def test_what_went_wrong_comes_before_what_was_measured() -> None:
    unstable = {"verdict": "unstable", "reasons": ["j4 chatters", "j5 chatters"]}
    reflex = [{"time": 1.25, "errors": ["joint_reflex"]}]
    values = run_metrics(setpoints=[move()], stability=unstable, reflexes=reflex)
    found = headline.of_run({"status": "failed", "error": "the simulation diverged"}, values)
    assert [one.name for one in found][:3] == ["The run failed", "Stability", "Reflexes"]
    assert found[1].meaning == "j4 chatters; 1 more below"
    assert all(one.kind == headline.BAD for one in found[:3]) and "1.250 s: joint_reflex" in found[2].meaning


def test_a_marker_is_followed_with_a_lag_and_an_error() -> None:
    frames = {"received": 100, "lost": 0, "untracked": 0}
    values = {"rms_error": 1.21e-3, "largest_error": 2e-3, "lag": 0.1156, "marker": "truth", "frames": frames}
    found = shown(run_metrics(tracking={**values, "acceleration": {"ratio": 1.14}, "losses": 0, "body": "hand"}))
    assert found["Lag"][0] == "115.6 ms" and found["Error after the lag"][0] == "1.21 mm"
    assert found["Acceleration"][0] == "1.14 ×" and found["Marker lost"] == ("0 times", headline.GOOD)


@pytest.mark.parametrize(("lost", "kind"), [(0, headline.GOOD), (3, headline.BAD)])
def test_what_was_sent_is_held_against_what_was_recorded(lost: int, kind: str) -> None:
    sources = {topic: {"sent": 1000, "recorded": 1000, "lost": 0} for topic in ("/control_log", "/emg")}
    sources["/plate"] = {"sent": 2000, "recorded": 2000 - lost, "lost": lost}
    (found,) = (one for one in headline.of_run({}, run_metrics(sources=sources)) if one.name == "Samples lost")
    assert (found.value, found.kind) == (str(lost), kind) and ("/plate" in found.meaning) == bool(lost)
    assert f"{4000 - lost:,} of 4,000" in found.meaning


@pytest.mark.parametrize(("skew", "kind"), [(1e-4, headline.GOOD), (3e-4, headline.BAD)])
def test_the_worst_skew_is_held_against_the_bound_that_is_stated(skew: float, kind: str) -> None:
    parts = {"/emg": {"skew": {"p99": skew}, "by": "time code"}, "/mocap": {"skew": None, "by": None}}
    streams = {"/sync": {"ticks": 99, "missing": 1, "bound": 2e-4, "sources": parts}}
    found = shown(run_metrics(sync=streams))
    assert found["Skew"] == (f"{1e3 * skew:.3f} ms", kind) and found["Instants missing"] == ("1", headline.BAD)


def test_a_comparison_says_how_far_the_runs_are_apart_where_it_is_most() -> None:
    near, far = JointDifference(1e-4, 0.1, 2e-6, 0.0), JointDifference(-0.05, 2.291, 1e-7, 0.0)
    found = headline.of_comparison("a", {"b": [SetpointDifference(0, 0, 3, 0.05, 2e-6, {"j1": near, "j4": far})]})
    assert [(one.name, one.value) for one in found] == [
        ("Peak difference", "50.0 mrad"),
        ("Steady difference", "2.00 µrad"),
    ]
    same = SetpointDifference(0, 0, 3, 0.0, 0.0, {"j1": JointDifference(0.0, 0.0, 0.0, 0.0)})
    assert headline.of_comparison("a", {"b": [same]})[0].meaning == "all positions of a and b are equal"
    assert found[0].meaning == "j4 after 2.291 s: a minus b"
