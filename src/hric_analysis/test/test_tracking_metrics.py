"""Lag, error, frames and stamps of a synthetic run with known values."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import panda_description
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.model import FrankaFrame
from hric_analysis import tracking
from hric_analysis.tracking import TrackingMetrics
from hric_analysis.tracking_record import CapturedFrames, States, TrackingRecord
from hric_analysis.tracking_run import tip_positions
from hric_bags.reader import ControlRecord
from hric_report import sensor_text

R = np.array(tracking.THESIS_ROTATION)
END, LAG, OFFSET = 9.0, 0.0835, np.array([0.3, -0.1, 0.4])
TIMES = np.arange(0.0, END, 1e-3)


def marker(time: np.ndarray) -> np.ndarray:
    """Return the marker in the base frame, shape (n, 3): at rest until 1 s; continuous acceleration."""
    since = np.maximum(0.0, time - 1.0)
    s = since**3 / (1.0 + since**2)
    return np.stack([0.02 * np.sin(3 * s) ** 2, 0.1 * np.sin(1.5 * s), 0.5 + 0.03 * np.sin(s)], axis=1)


def made_up(
    noise: float = 0.0, late: float = 0.0, truth: bool = True, lost: tuple[float, float] | None = None
) -> TrackingRecord:
    """Return a record of the marker: frames with 240 Hz and y up, stamps delayed by `late`; not tracked between the
    two times of `lost`."""
    exposed = np.arange(0.004, END, 1 / 240)
    seen = marker(exposed) + noise * np.random.default_rng(1).standard_normal((len(exposed), 3))
    valid = np.ones(len(exposed), dtype=bool) if lost is None else (exposed < lost[0]) | (exposed >= lost[1])
    frames = CapturedFrames(
        exposed + late, np.arange(len(exposed)), valid, seen @ R, np.full(len(exposed), 0.0055), "hand", "mocap"
    )
    at = np.arange(0.0, END, 0.01)
    word = ["lost" if lost and lost[0] + 0.1 <= t < lost[1] else "following" for t in at]
    last = SimpleNamespace(losses=0, ignored=3, clamped=0, refused_reasons=["not finite"], refused_counts=[7])
    states = States("pose", at, follow(at), follow(at), follow(at), tuple(word), last)
    hand = np.arange(0.0, END, 0.01)
    return TrackingRecord(frames, states, (hand, marker(hand)) if truth else None, (), np.zeros(3), "panda_link0")


def follow(time: np.ndarray, lag: float = LAG) -> np.ndarray:
    """Return the end effector: the displacement of the marker one lag earlier, from another origin."""
    return OFFSET + marker(time - lag) - marker(np.zeros(1))


def judged(record: TrackingRecord, ee: np.ndarray | None = None, **changes: Any) -> TrackingMetrics:
    path = follow(TIMES) if ee is None else ee
    data = tracking.followed(record, TIMES, path, R, **changes)
    return tracking.metrics(data, record, TIMES, path, R)


def test_a_delayed_copy_of_the_marker_has_its_delay_as_lag_and_no_error_after_it() -> None:
    found = judged(made_up())
    assert found.lag == pytest.approx(LAG, abs=1e-4)
    assert found.correlation == pytest.approx(1.0, abs=1e-6)
    assert found.rms_error < 1e-4 and found.largest_error < 2e-4  # half a step of the lag
    assert found.acceleration.ratio == pytest.approx(1.0, abs=0.02)
    assert (found.ignored, found.refused, found.marker) == (3, {"not finite": 7}, "truth")


def test_a_robots_clock_that_does_not_keep_step_bends_nothing_of_the_markers_own_acceleration() -> None:
    record = made_up()
    assert record.truth is not None
    own, place = record.truth
    bent = own + 2e-3 * np.sin(2 * np.pi * 3 * own)
    straight, found = (
        judged(one).acceleration.ideal for one in (record, replace(record, truth=(bent, place), own_time=own))
    )
    assert found == pytest.approx(straight, rel=1e-3)


def test_what_the_end_effector_does_besides_is_error_and_acceleration() -> None:
    shaking = 2e-3 * np.sin(2 * np.pi * 5 * np.maximum(0.0, TIMES - 0.2))[:, None] * [0.0, 0.0, 1.0]
    found = judged(made_up(), follow(TIMES) + shaking)
    assert found.rms_error == pytest.approx(2e-3 / np.sqrt(2), rel=0.03)
    assert found.largest_error == pytest.approx(2e-3, rel=0.05)
    assert found.acceleration.ratio > 5


def test_the_acceleration_is_that_of_a_sine_and_a_gap_of_the_log_is_none() -> None:
    sine = 2e-3 * np.sin(2 * np.pi * 5 * TIMES)[:, None] * [0.0, 0.6, 0.8]
    expected = 2e-3 * (2 * np.pi * 5) ** 2 / np.sqrt(2)
    kept = (TIMES < 3.0) | (TIMES > 3.05)
    for cycles in (1, 10):
        assert tracking.acceleration(TIMES, sine, cycles) == pytest.approx(expected, rel=0.01)
        assert tracking.acceleration(TIMES[kept], sine[kept], cycles) == pytest.approx(expected, rel=0.01)


def test_without_the_truth_the_frames_serve_and_nothing_is_said_of_stamps() -> None:
    found = judged(made_up(noise=1e-4, truth=False))
    assert found.lag == pytest.approx(LAG, abs=2e-3)
    assert found.rms_error < 5e-4
    assert (found.stamp_error, found.marker, found.acceleration.ratio) == (None, "motion capture", None)
    assert "reference: motion capture" in sensor_text.tracking(found)


@pytest.mark.parametrize("late", [-0.003, 0.0, 0.0042])
def test_stamps_that_are_late_are_found_late(late: float) -> None:
    exact = judged(made_up(late=late)).stamp_error
    assert exact.mean == pytest.approx(late, abs=2e-6) and abs(exact.largest) == pytest.approx(abs(late), abs=1e-5)
    noisy = judged(made_up(noise=1e-4, late=late)).stamp_error
    assert noisy.mean == pytest.approx(late, abs=4 * noisy.uncertainty) and noisy.uncertainty < 5e-5


def test_lost_repeated_and_untracked_frames_are_counted() -> None:
    record = made_up(lost=(4.0, 4.5))
    number = record.frames.number.copy()
    number[100:] += 3
    number[200] = number[199]
    found = judged(replace(record, frames=replace(record.frames, number=number))).frames
    assert (found.lost, found.not_in_order, found.untracked) == (3 + 1, 1, 120)
    assert found.rate == pytest.approx(240.0, rel=1e-3) and found.latency_median == pytest.approx(0.0055)


def test_after_a_loss_it_counts_from_the_new_origins_unless_it_catches_up() -> None:
    record = made_up(lost=(3.0, 4.0))
    stopped, back = 3.0 + LAG, 4.0
    resting = follow(np.array([stopped]))[0]
    ee, again = follow(TIMES), back <= TIMES
    ee[(stopped <= TIMES) & ~again] = resting
    shift = resting - follow(np.array([back + LAG]))[0]
    ee[again] = np.where((TIMES[again] < back + LAG)[:, None], resting, follow(TIMES[again]) + shift)
    target = np.where((record.states.time < back)[:, None], record.states.target, resting)
    found = judged(replace(record, states=replace(record.states, target=target)), ee)
    assert found.lag == pytest.approx(LAG, abs=5e-3) and found.rms_error < 2e-3
    assert judged(record, ee, catch_up=True).rms_error > 1e-2


def test_a_marker_at_rest_or_never_seen_has_no_lag() -> None:
    record = made_up()
    still = replace(record, truth=(record.truth[0], np.full_like(record.truth[1], 0.5))) if record.truth else record
    found = judged(still, np.tile(OFFSET, (len(TIMES), 1)))
    assert found.lag is None and found.rms_error < 1e-12 and found.acceleration.ratio is None
    assert "lag not known" in sensor_text.tracking(found)
    unseen = judged(replace(record, frames=replace(record.frames, valid=np.zeros_like(record.frames.valid))))
    assert unseen.first_marker is None and unseen.rms_error is None
    assert "no valid marker of hand was received" in sensor_text.tracking(unseen)


def test_the_end_effector_of_a_log_is_where_the_models_kinematics_puts_it() -> None:
    text = panda_description.load(arm_id="panda", robot_sim_type="franka_sim/FrankaHWSim")
    names = tuple(f"panda_joint{i}" for i in range(1, 8))
    q = np.random.default_rng(2).uniform(-1.0, 0.0, (20, 7))
    log = ControlRecord(names, ("effort",) * 7, np.arange(20) * 1e-3, q, *([np.zeros((20, 7))] * 4), 0, (), ())
    found = tip_positions(text, log, "panda_link0", "panda_link8", np.array([0.0, 0.0, 0.1034]))
    model = KdlFrankaModel(text, "panda")
    for row, place in zip(q, found, strict=True):
        flange = model.pose(FrankaFrame.FLANGE, row)
        assert place == pytest.approx((flange @ [0.0, 0.0, 0.1034, 1.0])[:3], abs=1e-12)
