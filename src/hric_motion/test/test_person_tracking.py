"""A real person by their markers: joints, root, what is not seen, and a body that is fitted to them."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bodies import body, subject
from numpy.testing import assert_allclose
from walking_person import RATE, Mover

from hric_core.errors import CommandError, ParameterError
from hric_core.geometry import Pose, transformed
from hric_human.body import Body, describe
from hric_human.control.kinematics import HandChain
from hric_human.control.marker_model import ROOT_MOTIONS, MarkerModel
from hric_motion.tracking import (
    BRIDGED,
    LOST,
    MEASURED,
    BodyCalibration,
    PersonEstimate,
    PersonTracker,
    StillPose,
    calibrate,
)
from hric_motion.tracking.tracker import BRIDGE, moved

Figure = Callable[[str, float, str], None]
Hide = Callable[[float, np.ndarray], None]
STEP = 2
"""Number of frames between two estimates: 60 Hz out of frames at 120 Hz."""
BODY = body(parts="upper_body")
NAMES = list(BODY.markers)
FOREARM = ("RFRM", "RWRA", "RWRB", "RFIN")


def positions_of(mover: Mover, times: np.ndarray, noise: float, offsets: dict[str, np.ndarray]) -> np.ndarray:
    exact = np.array([mover.markers(when, offsets) for when in times])
    return exact + np.random.default_rng(3).normal(0.0, noise, exact.shape)


class Followed:
    """Estimates of a tracker for a moving person, with the true motion.

    Args:
        known: body that the tracker assumes.
        mover: the moving person.
        offsets: displacement of the person's markers from their positions on the body [m].
        hide: function of a time and the marker positions, which it may change.
    """

    def __init__(
        self,
        known: Body,
        mover: Mover,
        duration: float = 5.0,
        offsets: dict[str, np.ndarray] | None = None,
        hide: Hide | None = None,
    ) -> None:
        self.times = np.arange(0.0, duration, STEP / RATE)
        frames = positions_of(mover, self.times, 5e-4, offsets or {})
        for when, positions in zip(self.times, frames, strict=True):
            if hide is not None:
                hide(when, positions)
        tracker, began = PersonTracker(known, NAMES), time.process_time()
        found = [tracker.update(when, positions) for when, positions in zip(self.times, frames, strict=True)]
        self.share = (time.process_time() - began) / duration
        self.estimates: list[PersonEstimate] = [one for one in found if one is not None]
        assert len(self.estimates) == len(self.times)
        hand = HandChain(known, "right")
        q = np.array([one.q for one in self.estimates])
        self.angles = np.degrees(np.abs(q - np.array([mover.joints(when)[0] for when in self.times])))
        self.hand = np.array([
            np.linalg.norm(transformed(one.root, hand.pose(one.q).position) - mover.hand(when))
            for one, when in zip(self.estimates, self.times, strict=True)
        ])  # fmt: skip


def hiding(*names: str, begin: float, duration: float) -> Hide:
    rows = [NAMES.index(name) for name in names]

    def hide(when: float, positions: np.ndarray) -> None:
        if begin - 1e-6 <= when < begin + duration - 1e-6:
            positions[rows] = np.nan

    return hide


def all_of(hides: list[Hide]) -> Hide:
    def hide(when: float, positions: np.ndarray) -> None:
        for one in hides:
            one(when, positions)

    return hide


def test_markers_move_with_root_and_joints_as_their_jacobian_says() -> None:
    marked, random = MarkerModel(BODY, NAMES), np.random.default_rng(0)
    q, root = random.uniform(-0.5, 0.5, len(BODY.joints)), Pose((0.3, -0.2, 0.9), (0.1, 0.2, 0.3, 0.86**0.5))
    _, J = marked.at(q.tolist(), root)
    for column in range(J.shape[2]):
        step = np.zeros(J.shape[2])
        step[column] = 1e-5
        ends = [
            marked.at((q + way[ROOT_MOTIONS:]).tolist(), moved(root, way[:ROOT_MOTIONS]))[0] for way in (step, -step)
        ]
        assert_allclose(J[:, :, column], (ends[0] - ends[1]) / 2e-5, atol=1e-8)


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_markers_with_half_a_millimetre_of_noise_give_joints_and_hand_at_60_hz(figure: Figure, speed: float) -> None:
    followed = Followed(BODY, Mover(BODY, speed))
    assert followed.angles.max() <= 2.0 and followed.hand.max() <= 5e-3
    assert {state for one in followed.estimates for state in (*one.states, one.root_state)} == {MEASURED}
    what = f"person, exact body, swings {speed:g} times as fast"
    figure(f"{what}: joint angles, largest", followed.angles.max(), "deg")
    figure(f"{what}: joint angles, rms of the worst joint", np.sqrt((followed.angles**2).mean(axis=0)).max(), "deg")
    figure(f"{what}: hand, largest", 1e3 * followed.hand.max(), "mm")
    figure(f"{what}: share of a processor at 60 Hz", followed.share, "1")


def somebody_else(seed: int) -> tuple[Mover, dict[str, np.ndarray]]:
    """Return a person who is 3 % taller than the tracker assumes, with markers displaced by 10 mm."""
    random, known = np.random.default_rng(seed), subject(parts="upper_body")
    directions = random.normal(size=(len(NAMES), 3))
    offsets = 0.01 * directions / np.linalg.norm(directions, axis=1)[:, None]
    other = describe(replace(known, height=1.03 * known.height))
    return Mover(other, seed=seed), dict(zip(NAMES, offsets, strict=True))


def still(mover: Mover, offsets: dict[str, np.ndarray], seed: int) -> np.ndarray:
    """Marker positions of the person standing upright, each joint 3 deg off (standard deviation)."""
    off = np.random.default_rng(seed).normal(0.0, np.radians(3.0), len(BODY.joints))
    low, high = np.array([joint.range for joint in BODY.joints.values()]).T
    return mover.markers(0.0, offsets, off.clip(low, high))


@pytest.mark.parametrize("seed", [0, 1])
def test_a_still_pose_fits_a_body_that_is_too_small_and_markers_that_are_off(figure: Figure, seed: int) -> None:
    mover, offsets = somebody_else(seed)
    fitted = calibrate(subject(parts="upper_body"), NAMES, still(mover, offsets, seed), {})
    before = Followed(BODY, mover, 3.0, offsets)
    after = Followed(fitted.body, mover, 3.0, offsets)
    for name, followed in (("not calibrated", before), ("calibrated", after)):
        what = f"person 3 % taller, markers 10 mm off, {name}, {seed}"
        figure(f"{what}: joint angles, rms", np.sqrt((followed.angles**2).mean()), "deg")
        figure(f"{what}: joint angles, rms of the worst joint", np.sqrt((followed.angles**2).mean(axis=0)).max(), "deg")
        figure(f"{what}: hand, rms", 1e3 * np.sqrt((followed.hand**2).mean()), "mm")
        figure(f"{what}: residual of the markers", 1e3 * np.mean([one.residual for one in followed.estimates]), "mm")
    assert (after.angles**2).mean() < 0.25 * (before.angles**2).mean()
    assert (after.hand**2).mean() < (before.hand**2).mean()
    assert after.estimates[-1].residual < 0.3 * before.estimates[-1].residual


def test_markers_lost_for_a_moment_are_bridged_and_flagged(figure: Figure) -> None:
    mover, begins = Mover(BODY, 1.5), np.arange(0.8, 5.0)
    gaps = [hiding(*FOREARM, begin=begin, duration=BRIDGE) for begin in begins]
    followed = Followed(BODY, mover, hide=all_of(gaps))
    gap = followed.times % 1.0 > 0.8 - 1e-6
    below = [row for row, name in enumerate(BODY.joints) if name.startswith(("right_el", "right_pro", "right_wr"))]
    others = [row for row, name in enumerate(BODY.joints) if not name.startswith("right")]
    states = np.array([one.states for one in followed.estimates])
    assert set(states[gap][:, below].ravel()) == {BRIDGED}
    assert set(states[~gap].ravel()) | set(states[:, others].ravel()) == {MEASURED}
    assert followed.estimates[int(np.argmax(gap))].missing == FOREARM
    assert followed.angles[:, others].max() <= 2.0 and followed.angles[~gap].max() <= 2.5
    # What it is bridged by is better than the last posture that was seen.
    true = np.array([mover.joints(when)[0] for when in followed.times])
    last = np.array([mover.joints(np.floor(when) + 0.8 - STEP / RATE)[0] for when in followed.times])
    held = np.degrees(np.abs(true - last))
    assert (followed.angles[gap][:, below] ** 2).mean() < 0.25 * (held[gap][:, below] ** 2).mean()
    figure(
        "person, forearm not seen for 0.2 s: joint angles, rms",
        np.sqrt((followed.angles[gap][:, below] ** 2).mean()),
        "deg",
    )
    figure("person, forearm not seen for 0.2 s: joint angles, largest", followed.angles[gap].max(), "deg")
    figure("person, forearm not seen for 0.2 s: hand, largest", 1e3 * followed.hand[gap].max(), "mm")


def test_one_marker_of_several_that_is_lost_leaves_the_joints_seen() -> None:
    followed = Followed(BODY, Mover(BODY), hide=hiding("RWRA", "RELB", begin=2.0, duration=1.0))
    assert {state for one in followed.estimates for state in one.states} == {MEASURED}
    assert followed.angles.max() <= 2.5


def test_what_is_not_seen_for_longer_is_lost_and_found_again() -> None:
    followed = Followed(BODY, Mover(BODY), hide=hiding(*NAMES, begin=2.0, duration=1.0))
    states = np.array([[one.root_state, *one.states] for one in followed.estimates])
    age = followed.times - 2.0 + STEP / RATE
    assert set(states[(age > 1e-6) & (age < BRIDGE + 1e-6)].ravel()) == {BRIDGED}
    assert set(states[(age > BRIDGE + 1e-6) & (followed.times < 3.0 - 1e-6)].ravel()) == {LOST}
    assert set(states[followed.times > 3.0 - 1e-6].ravel()) == {MEASURED}
    assert followed.angles[followed.times > 3.1].max() <= 2.0


def test_joints_that_no_worn_marker_shows_are_never_measured() -> None:
    worn = [name for name in NAMES if name not in ("RWRA", "RWRB", "RFIN", "RFRM")]
    tracker, mover = PersonTracker(BODY, worn), Mover(BODY, 1.0)
    rows = [NAMES.index(name) for name in worn]
    for when in np.arange(0.0, 1.0, STEP / RATE):
        estimate = tracker.update(when, np.array(mover.markers(when))[rows])
        assert estimate is not None
        states = dict(zip(BODY.joints, estimate.states, strict=True))
        assert {states[f"right_{name}"] for name in ("el_flex", "pro_sup", "wr_flex", "wr_dev")} == {LOST}
        assert {states[f"left_{name}"] for name in ("el_flex", "pro_sup", "wr_flex")} == {MEASURED}


def test_a_marker_that_is_somewhere_else_does_not_count() -> None:
    def mislabelled(when: float, positions: np.ndarray) -> None:
        if 2.0 <= when < 2.5:
            positions[NAMES.index("RELB")] += [0.0, 0.4, 0.0]

    followed = Followed(BODY, Mover(BODY), 3.0, hide=mislabelled)
    assert followed.angles.max() <= 2.5
    assert followed.estimates[round(2.2 * RATE / STEP)].missing == ("RELB",)


def test_arms_spread_at_the_singularity_of_the_shoulder_stay_seen_and_do_not_drift() -> None:
    q = np.zeros(len(BODY.joints))
    q[[list(BODY.joints).index(f"{side}_sh_abd") for side in ("right", "left")]] = np.pi / 2
    p, random = MarkerModel(BODY, NAMES).at(q.tolist(), Pose())[0], np.random.default_rng(1)
    tracker = PersonTracker(BODY, NAMES)
    for frame in range(600):
        one = tracker.update(frame / 60.0, p + random.normal(0.0, 5e-4, p.shape))
    assert one is not None and set(one.states) == {MEASURED}
    # There flexion and rotation turn about one line: their difference is the arm's rotation.
    off = np.degrees(np.array(one.q) - q)
    for side in ("right", "left"):
        flex, abd, rot = (off[list(BODY.joints).index(f"{side}_{joint}")] for joint in ("sh_flex", "sh_abd", "sh_rot"))
        assert max(abs(abd), min(abs(flex - rot), abs(flex + rot))) < 3.0 and abs(flex) < 45.0


def test_any_posture_is_found_from_its_markers_alone() -> None:
    low, high = np.array([joint.range for joint in BODY.joints.values()]).T
    marked, random = MarkerModel(BODY, NAMES), np.random.default_rng(5)
    residuals = []
    for _ in range(15):
        turn = random.normal(size=4)
        root = Pose((1.0, 2.0, 0.5), tuple((turn / np.linalg.norm(turn)).tolist()))
        one = PersonTracker(BODY, NAMES).update(0.0, marked.at(random.uniform(low, high).tolist(), root)[0])
        residuals.append(np.inf if one is None else one.residual)
    assert max(residuals) < 1e-3


def test_a_time_that_does_not_rise_begins_anew() -> None:
    tracker, p = PersonTracker(BODY, NAMES), MarkerModel(BODY, NAMES).at([0.1] * len(BODY.joints), Pose())[0]
    assert tracker.update(5.0, p) is not None
    one = tracker.update(1.0, p + np.array([3.0, 0.0, 0.0]))
    assert one is not None and one.root.position == pytest.approx((3.0, 0.0, 0.0), abs=1e-4)
    assert tracker.update(2.0, np.full_like(p, np.nan)) is not None, "the person is lost, not forgotten"
    assert PersonTracker(BODY, NAMES).update(0.0, np.full_like(p, np.nan)) is None


def test_a_body_whose_trunk_has_no_markers_is_refused() -> None:
    arm = body(parts="right_arm")
    with pytest.raises(ParameterError, match=r"1 markers are on the trunk.*valid: three or more, on a subject"):
        PersonTracker(arm, list(arm.markers))
    with pytest.raises(ParameterError, match="no markers NOSE on the body; valid: LASI"):
        PersonTracker(BODY, [*NAMES, "NOSE"])


# -- the still pose ----------------------------------------------------------------------------------------------------


def frames_of_a_still_pose() -> np.ndarray:
    p = MarkerModel(BODY, NAMES).at([0.0] * len(BODY.joints), Pose())[0]
    return p + np.random.default_rng(1).normal(0.0, 5e-4, (121, *p.shape))


def mean_of(frames: np.ndarray) -> np.ndarray:
    pose = StillPose(NAMES)
    assert [pose.add(10.0 + k / RATE, frame) for k, frame in enumerate(frames)] == [False] * (len(frames) - 1) + [True]
    return pose.mean()


def test_a_still_second_is_averaged() -> None:
    frames = frames_of_a_still_pose()
    frames[40:45, 3] = np.nan
    assert_allclose(mean_of(frames), np.nanmean(frames, axis=0))


def test_somebody_who_moves_is_refused_with_the_markers_that_moved() -> None:
    frames = frames_of_a_still_pose()
    frames[:, NAMES.index("RFIN"), 0] += np.linspace(0.0, 0.06, len(frames))
    with pytest.raises(
        CommandError, match=r"the person has moved: RFIN 3\d mm from the mean position; valid: up to 10 mm in 1 s"
    ):
        mean_of(frames)


def test_markers_that_are_missing_are_named() -> None:
    frames = frames_of_a_still_pose()
    frames[30:, NAMES.index("T10")] = np.nan
    frames[:, NAMES.index("LFIN")] = np.nan
    with pytest.raises(
        CommandError, match=r"too many frames: visible are T10 \(25%\), LFIN \(0%\); valid: visible in at least 90%"
    ):
        mean_of(frames)


def test_swapped_labels_are_named() -> None:
    p = frames_of_a_still_pose()[0]
    a, b = NAMES.index("RELB"), NAMES.index("RFIN")
    p[[a, b]] = p[[b, a]]
    with pytest.raises(CommandError, match=r"markers are not where they belong: .*RELB"):
        calibrate(subject(parts="upper_body"), NAMES, p, {})


def test_a_calibration_comes_back_from_its_file(tmp_path: Path) -> None:
    mover, offsets = somebody_else(0)
    fitted = calibrate(subject(parts="upper_body"), NAMES, still(mover, offsets, 0), {})
    fitted.save(tmp_path / "P50.yaml")
    again = BodyCalibration.load(tmp_path / "P50.yaml")
    assert again.subject.code == fitted.subject.code and again.residual == pytest.approx(fitted.residual, abs=1e-6)
    for name, marker in again.body.markers.items():
        assert_allclose(marker.p_link_marker, fitted.body.markers[name].p_link_marker, atol=1e-6)
        assert_allclose(
            again.body.segments["right_forearm"].length, fitted.body.segments["right_forearm"].length, atol=1e-5
        )
    (tmp_path / "P50.yaml").write_text((tmp_path / "P50.yaml").read_text().replace("RELB", "RELBOW"))
    with pytest.raises(ParameterError, match="RELBOW"):
        BodyCalibration.load(tmp_path / "P50.yaml")
