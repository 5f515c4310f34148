"""Text report of a run."""

from made_up import run_metrics

from hric_report import text


def rendered(*times: float) -> str:
    joints = {"panda_joint1": {"effort_peak": 9.38, "velocity_peak": 1.2, "velocity_ratio": 0.55}}
    moves = [{"time": at, "controller": "pd", "joints": {"panda_joint1": {}}} for at in times]
    return text.render({}, run_metrics(joints=joints, setpoints=moves))


def test_peaks_of_the_run_are_not_those_of_each_of_its_setpoints() -> None:
    moves, _, whole = rendered(1.0, 4.0).partition("peaks over the whole run")
    assert moves.count("setpoint at") == 2 and "|tau| max" not in moves
    assert whole.count("9.38") == 1 and "55 %" in whole


def test_peaks_of_a_run_with_one_setpoint_are_in_its_table() -> None:
    assert "9.38" in rendered(1.0) and "whole run" not in rendered(1.0)
