"""Known motions of the own body come back from their markers, and what the markers do not show is not known."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body import Subject, describe
from hric_motion.measured import MeasuredMotion, bridged, measured
from hric_motion.postures import BodyPostures, MarkerPostures

RATE, FRAMES = 100.0, 400
PERSON = Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body")
BODY = describe(PERSON)
NAMES, JOINTS = tuple(BODY.markers), list(BODY.joints)
MODEL = MarkerPostures(BODY, NAMES)


def truth() -> BodyPostures:
    """Return a motion of all joints through most of their ranges, while the person walks and turns."""
    t, q = np.arange(FRAMES) / RATE, np.zeros((FRAMES, len(JOINTS)))
    for column, joint in enumerate(BODY.joints.values()):
        low, high = joint.range
        middle = 0.3 * (low + high) if "flex" in JOINTS[column] else 0.0
        wave = np.sin(2.0 * np.pi * (0.25 + 0.05 * (column % 7)) * t + column)
        q[:, column] = np.clip(middle + 0.3 * (high - low) * wave, low + 0.02, high - 0.02)
    R = Rotation.from_rotvec(np.column_stack([0.2 * np.sin(t), 0.1 * np.cos(t), 0.5 * t])).as_matrix()
    return BodyPostures(R, np.column_stack([0.3 * t, 0.0 * t, 1.0 + 0.02 * np.sin(t)]), q)


TRUTH = truth()
CLEAN = MODEL.positions(TRUTH)


class Case(NamedTuple):
    """Disturbance of a trial: noise and misplacement of markers [m], share of lost ones, factor of the height."""

    noise: float = 0.0
    lost: float = 0.0
    misplaced: float = 0.0
    height: float = 1.0

    def positions(self) -> FloatArray:
        """Return the positions of the markers."""
        random, geometry = np.random.default_rng(1), MODEL.geometry
        shift = random.normal(size=geometry.markers.shape) * self.misplaced / np.sqrt(3.0)
        positions = MODEL.positions(TRUTH, geometry._replace(markers=geometry.markers + shift))
        positions += self.noise * random.normal(size=positions.shape)
        positions[random.random(positions.shape[:2]) < self.lost] = np.nan
        return positions


def errors(motion: MeasuredMotion) -> FloatArray:
    """Return the errors of the joint angles [rad]; NaN: not known."""
    return np.asarray(motion.q - TRUTH.q)


@pytest.mark.parametrize(
    ("case", "degrees", "most"),
    [
        (Case(), 2.0, 1.0),  # without any error the interval, which the priors give, holds the truth always
        (Case(noise=0.002), 3.0, 0.99),
        (Case(noise=0.005), 5.0, 0.99),
        (Case(noise=0.002, lost=0.3), 5.0, 0.99),
        (Case(noise=0.002, misplaced=0.01), 6.0, 0.99),
        (Case(noise=0.002, height=1.15), 5.0, 0.99),
    ],
    ids=["exact", "2 mm", "5 mm", "30 % lost", "misplaced", "wrong height"],
)
def test_known_motion_comes_back_within_its_interval(case: Case, degrees: float, most: float) -> None:
    motion = measured(replace(PERSON, height=case.height * PERSON.height), NAMES, case.positions(), RATE)
    error = errors(motion)
    assert np.isfinite(error).mean() > 0.9  # three markers of a foot do not show its inversion
    rms, held = np.degrees(np.sqrt(np.nanmean(error**2))), (np.abs(error) < 1.96 * motion.spread)[np.isfinite(error)]
    print(f"{case}: {rms:.2f} deg, {held.mean():.1%} within the interval")
    assert rms < degrees
    assert 0.9 <= held.mean() <= most


def test_joints_without_markers_are_not_known() -> None:
    worn = [
        row for row, name in enumerate(NAMES) if BODY.markers[name].link in ("human_base", "waist", "torso", "head")
    ]
    motion = measured(PERSON, [NAMES[row] for row in worn], CLEAN[:, worn], RATE)
    assert {name for name in JOINTS if name.startswith(("right", "left"))} == set(motion.unknown)
    assert np.isfinite(motion.root).all()


def test_an_angle_beyond_its_range_is_not_known() -> None:
    q, elbow = TRUTH.q.copy(), JOINTS.index("right_el_flex")
    q[150:250, elbow] = -0.6
    motion = measured(PERSON, NAMES, MODEL.positions(TRUTH._replace(q=q)), RATE)
    assert np.isnan(motion.q[160:240, elbow]).all() and np.isfinite(motion.q[:140, elbow]).all()


def test_only_short_gaps_are_filled() -> None:
    positions = CLEAN.copy()
    positions[100:115, 0], positions[200:230, 0] = np.nan, np.nan
    filled = bridged(positions, RATE)
    assert np.abs(filled[100:115] - CLEAN[100:115]).max() < 1e-3
    assert np.isnan(filled[200:230, 0]).all()


def test_lost_arm_is_not_known_in_the_gap_alone() -> None:
    positions = CLEAN.copy()
    positions[150:250, [row for row, name in enumerate(NAMES) if name in ("RELB", "RFRM", "RWRA", "RWRB", "RFIN")]] = (
        np.nan
    )
    elbow = measured(PERSON, NAMES, positions, RATE).q[:, JOINTS.index("right_el_flex")]
    assert np.isnan(elbow[150:250]).all() and np.isfinite(np.r_[elbow[:150], elbow[250:]]).all()


def test_a_person_who_crosses_the_volume_is_measured_there() -> None:
    positions = CLEAN.copy()
    positions[:120], positions[280:] = np.nan, np.nan
    motion = measured(PERSON, NAMES, positions, RATE)
    assert np.isfinite(motion.root[120:280]).all() and np.isnan(motion.root[:120]).all()
    error = errors(motion)
    assert (np.abs(error) < 1.96 * motion.spread)[np.isfinite(error)].mean() > 0.9


def test_noise_of_few_markers_is_that_of_the_markers() -> None:
    links = ("waist", *(f"{side}_{joint}" for side in "lr" for joint in ("hip", "knee", "ankle")))
    worn = [row for row, name in enumerate(NAMES) if BODY.markers[name].link in links]
    positions = Case(noise=0.01, lost=0.4).positions()[:, worn]
    assert 0.007 < measured(PERSON, [NAMES[row] for row in worn], positions, RATE).noise < 0.013


def test_progress_counts_the_frames() -> None:
    calls = list[tuple[int, int]]()
    measured(PERSON, NAMES, np.tile(CLEAN, (2, 1, 1)), RATE, progress=lambda done, total: calls.append((done, total)))
    assert calls == [(400, 800), (800, 800)]


def test_points_that_are_no_person_are_refused() -> None:
    with pytest.raises(HricError, match=r"the body fits the markers within 30 mm in 0% .*Check labels, unit"):
        measured(PERSON, NAMES, np.random.default_rng(0).normal(size=CLEAN[:40].shape), RATE)


def test_trunk_without_three_markers_is_refused() -> None:
    with pytest.raises(HricError, match="2 markers are on the trunk"):
        measured(PERSON, ["C7", "T10", "RELB"], CLEAN[:, :3], RATE)
