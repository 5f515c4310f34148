"""Stability of the control loop, from synthetic logs with known results."""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hric_analysis import stability
from hric_bags.reader import ControlRecord
from hric_report import text as table

FloatArray = npt.NDArray[np.float64]
LIMITS = {"shoulder": {"effort": 87.0}, "wrist": {"effort": 12.0}}
TIME = 1e-3 * np.arange(2000)


def log_of(wrist: FloatArray) -> ControlRecord:
    """Return the log of a smooth motion of the shoulder under gravity and this torque of the wrist [N m]."""
    torque = np.stack([40.0 + 20.0 * np.sin(2.0 * np.pi * 2.0 * TIME[: len(wrist)]), wrist], axis=1)
    zero = np.zeros_like(torque)
    return ControlRecord(
        ("shoulder", "wrist"), ("effort", "effort"), TIME[: len(wrist)], zero, zero, zero, torque, torque, 0, (), ()
    )


def judged(wrist: FloatArray, **run: Any) -> stability.Stability:
    return stability.judge(run, log_of(wrist), LIMITS)


@pytest.mark.parametrize("period", [2, 3, 4, 5, 8, 10])
def test_a_torque_that_swings_within_a_few_cycles_is_unstable_with_joint_amplitude_and_frequency(period: int) -> None:
    found = judged(1.0 + 0.6 * np.cos(2.0 * np.pi * np.arange(2000) / period + 0.3))
    assert found.verdict == "unstable" and list(found.joints) == ["wrist"]
    wrist = found.joints["wrist"]
    assert wrist.frequency == pytest.approx(1000.0 / period)
    rms = 0.6 * (abs(np.cos(0.3)) if period == 2 else np.sqrt(0.5))
    assert wrist.ripple == pytest.approx(rms, rel=0.1) and wrist.share == pytest.approx(wrist.ripple / 12.0)
    assert (wrist.begin, wrist.end) == (0.0, 1.999)
    (reason,) = found.reasons
    assert reason.startswith(f"wrist chatters at {1000 / period:.0f} Hz") and "% of its effort limit" in reason


def test_it_is_said_when_the_chatter_began_and_ended() -> None:
    wrist = np.where((TIME >= 0.5) & (TIME < 1.0), 2.0 * (-1.0) ** np.arange(2000), 0.0)
    values = judged(wrist).joints["wrist"]
    assert values.begin == pytest.approx(0.5, abs=0.026) and values.end == pytest.approx(1.0, abs=0.026)


def ring(frequency: float, decay: float) -> FloatArray:
    """Return the torque of a contact at 1 s with a decaying oscillation [N m]."""
    after = np.maximum(TIME - 1.0, 0.0)
    return np.where(TIME >= 1.0, 5.0 + 8.0 * np.exp(-after / decay) * np.cos(2.0 * np.pi * frequency * after), 0.0)


NOISE = np.random.default_rng(0).normal(size=2000)
STABLE = {
    "rest": np.zeros(2000),
    "a swing at 10 Hz": 10.0 * np.sin(2.0 * np.pi * 10.0 * TIME),
    "a step": np.where(TIME < 1.0, -12.0, 12.0),
    "steps every 20 ms": 12.0 * np.sign(np.sin(np.pi * TIME / 0.02 + 0.1)) * (TIME < 0.2),
    "a contact that rings at 23 Hz": ring(23.0, 0.1),
    "a contact that rings at 200 Hz": ring(200.0, 0.05),
    "noise of the speed times Kd 10": 0.06 * NOISE,
    "noise of the speed times Kd 100": 0.6 * NOISE,
    "noise behind a filter of 100 Hz": np.convolve(0.6 * NOISE, 0.47 * 0.53 ** np.arange(30))[:2000],
    "chatter of a hundredth": 0.12 * (-1.0) ** np.arange(2000),
}


@pytest.mark.parametrize("case", STABLE)
def test_what_is_no_chatter_is_stable(case: str) -> None:
    found = judged(STABLE[case])
    assert found.verdict == "stable" and not found.reasons and not found.joints


def test_wild_torque_needs_no_period() -> None:
    found = judged(12.0 * NOISE)
    assert found.verdict == "unstable" and "without a fixed period" in found.reasons[0]


def test_the_requested_torque_counts_where_the_command_was_an_effort_else_the_measured_one() -> None:
    chatter, calm = 2.0 * (-1.0) ** np.arange(2000), np.zeros(2000)
    log = log_of(chatter)
    by_effort = np.ones((2000, 2), dtype=bool)
    assert stability.judge({}, replace(log, by_effort=by_effort), LIMITS).verdict == "unstable"
    assert stability.judge({}, replace(log, by_effort=~by_effort), LIMITS).verdict == "stable"
    measured = replace(log_of(calm), effort=log.command_raw, interfaces=("position", "position"))
    assert stability.judge({}, measured, LIMITS).verdict == "unstable"


def test_a_joint_without_an_effort_limit_is_measured_by_a_stated_one() -> None:
    chatter = log_of(3.0 * (-1.0) ** np.arange(2000))
    assert stability.judge({}, chatter, {}).joints["wrist"].share == pytest.approx(
        3.0 / stability.NO_LIMIT_EFFORT, rel=0.02
    )


def test_a_run_that_diverged_or_that_the_arm_ended_itself_is_unstable_however_short() -> None:
    found = judged(
        np.zeros(3),
        error="DivergedError: the simulation diverged at 0.003 s: speed of wrist is -514.5 rad/s, beyond 261 rad/s",
    )
    assert (found.verdict, found.reasons) == (
        "unstable",
        ("the simulation diverged at 0.003 s: speed of wrist is -514.5 rad/s, beyond 261 rad/s",),
    )
    assert judged(np.zeros(2000), arm_error='motion aborted by reflex! ["instability_detected"]').verdict == "unstable"
    assert (
        judged(np.zeros(2000), arm_error='motion aborted by reflex! ["joint_velocity_violation"]').verdict == "stable"
    )
    assert judged(np.zeros(2000), error="HricError: controller pd was stopped").verdict == "stable"


def test_too_short_a_run_is_not_judged() -> None:
    found = judged(np.zeros(stability.PIECE * stability.STRETCH - 1))
    assert found.verdict is None
    assert "not judged" in table._stability(found)


def test_the_thresholds_stand_in_the_metrics() -> None:
    expected = {"share": 0.02, "periodicity": 0.5, "wild_share": 0.1, "piece": 25, "stretch": 10, "lags": 12}
    assert judged(np.zeros(2000)).thresholds == stability.Thresholds(**expected)
