"""Files of other programs become the motion of the person who is in them."""

from pathlib import Path

import numpy as np
import pytest
from laboratory_files import BODY, FRAMES, RATE, angles, points, write_handover, write_motive, write_mvnx, write_trc

from hric_core.errors import ParameterError
from hric_motion.formats import trials_in
from hric_motion.handovers import handover_of, is_handover
from hric_motion.trial import TrialMotion, prefixes, read, trial_motion

MEASURES = {"mass": 70.0, "height": 1.72}
GRIPS = {
    "giver": np.where(np.arange(FRAMES) < 40, 20.0, 0.1),
    "taker": np.where(np.arange(FRAMES) >= 28, 30.0, 0.2),
    "interaction": np.where(np.arange(FRAMES) < 50, 4.0, 9.0),
}


def check(result: TrialMotion, limit: float, known: float) -> None:
    """Check the error of the known angles, RMS [deg], and their smallest share [1]."""
    columns = [list(BODY.joints).index(joint) for joint in result.motion.body.joints]
    error = np.degrees(result.motion.q - angles()[:, columns])
    share = np.isfinite(error).mean()
    assert share >= known and np.sqrt(np.nanmean(error**2)) < limit


def test_bones_of_motive_give_the_motion_of_each_person(tmp_path: Path) -> None:
    file = write_motive(tmp_path / "two.csv", {"Ann": points("motive_skeleton"), "Bo": points("motive_skeleton", 1.5)})
    assert prefixes(file) == ("Ann:", "Bo:")
    result = trial_motion(file, prefix="Bo", measures=MEASURES)
    assert (result.marker_set, result.trial.rate) == ("Motive skeleton", pytest.approx(RATE))
    check(result, 4.0, 0.85)


def test_empty_cells_are_not_visible(tmp_path: Path) -> None:
    trial = read(write_motive(tmp_path / "gap.csv", {"Ann": points("motive_skeleton")}, hidden=["LFArm"]))
    gap = np.isnan(trial.markers(["Ann:LFArm"])[:, 0, 0])
    assert np.flatnonzero(gap).tolist() == list(range(20, 30))


def test_segments_of_xsens_give_the_motion(tmp_path: Path) -> None:
    result = trial_motion(write_mvnx(tmp_path / "a.mvnx", points("xsens")), measures=MEASURES)
    assert (result.marker_set, result.trial.rate, len(result.trial.positions)) == ("Xsens", RATE, FRAMES)
    check(result, 4.0, 0.85)


def test_a_session_of_opencap_has_trials_and_subject(tmp_path: Path) -> None:
    write_trc(tmp_path / "MarkerData" / "walk.trc", points("opencap"))
    (tmp_path / "sessionMetadata.yaml").write_text("mass_kg: 70.0\nheight_m: 1.72\n")
    (file,) = trials_in(tmp_path)
    result = trial_motion(file)
    assert result.marker_set == "OpenCap"
    assert (result.subject.mass, result.subject.height, result.sources["mass"]) == (70.0, 1.72, "walk.trc")
    check(result, 4.0, 0.75)  # no markers on head and fingers


def test_keypoints_are_centres_of_joints(tmp_path: Path) -> None:
    result = trial_motion(write_trc(tmp_path / "a.trc", points("keypoints")), measures=MEASURES)
    assert result.marker_set == "keypoints (HALPE_26, BODY_25)"
    assert {"right_wr_flex", "left_pro_sup"} <= set(result.motion.unknown)
    check(result, 5.0, 0.5)


def test_a_session_of_pose2sim_gives_processed_files(tmp_path: Path) -> None:
    for name in ("walk.trc", "walk_filt_butterworth.trc", "walk_filt_butterworth_LSTM.trc", "walk_2.trc"):
        write_trc(tmp_path / "pose-3d" / name, {"Hip": np.ones((FRAMES, 3))})
    assert [file.name for file in trials_in(tmp_path)] == ["walk_2.trc", "walk_filt_butterworth_LSTM.trc"]


def test_both_people_of_a_handover_move(tmp_path: Path) -> None:
    folder = write_handover(tmp_path / "handover", GRIPS)
    assert is_handover(folder) and prefixes(folder) == ("giver_", "taker_")
    check(trial_motion(folder, prefix="taker", measures=MEASURES), 4.0, 0.85)


def test_wrenches_of_a_handover_give_overlap_and_force(tmp_path: Path) -> None:
    found = handover_of(read(write_handover(tmp_path / "handover", GRIPS)))
    assert found is not None
    assert (found.overlap, found.force_max) == (pytest.approx(12 / 120.0), pytest.approx(4.0))
    assert (found.grip_giver, found.grip_taker) == (pytest.approx(20.0), pytest.approx(30.0))


def test_a_grip_without_a_wrench_is_not_known(tmp_path: Path) -> None:
    found = handover_of(read(write_handover(tmp_path / "handover", {"giver": GRIPS["giver"]})))
    assert found is not None
    assert (found.overlap, found.force_max, found.grip_taker) == (None, None, None)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y\n1,2\n", "is not a file of Motive: its first line"),
        ("a.csv", "Format Version,1.23,Length Units,Feet\n", "has lengths in Feet"),
        ("a.csv", "Format Version,1.23,Coordinate Space,Local\n", "Local coordinates; valid: .* Global"),
        ("a.csv", "Format Version,1.23\n\n,Type,Bone\nFrame,Time (Seconds),X\n", "no complete head"),
        ("a.csv", "Format Version,1.23\n,Type,Bone\n,Name,A\n,,Position\nFrame,T,X\n0,0.0,p\n", "line 6: could not"),
        ("a.mvnx", "<mvnx><subject frameRate='60'>", "is not a complete .mvnx file"),
        ("a.mvnx", "<mvnx><frames/></mvnx>", "has 0 positions of 0 frames for 23 segments"),
    ],
)
def test_a_damaged_file_is_one_clear_error(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ParameterError, match=message):
        read(tmp_path / name)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "60.0,Export Frame Rate,60.0",
            "60.0,Export Frame Rate,120.0",
            "a rate of 120.0 Hz is stated, but there are 60",
        ),
        ('frameRate="60"', 'frameRate="inf"', "a rate of inf Hz is stated, but"),
        ('frameRate="60"', 'frameRate="-60"', "a rate of -60 Hz is stated, but"),
        ('index="30"', 'index="31"', "frame 31 follows frame 29; valid: all frames in turn"),
        ("DataRate\tCameraRate\tUnits\n60", "DataRate\tCameraRate\tUnits\n60000", "a rate of 60000 Hz is stated"),
    ],
)
def test_times_that_contradict_the_stated_rate_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    file = write_mvnx(tmp_path / "a.mvnx", points("xsens"))
    if "Export" in old:
        file = write_motive(tmp_path / "a.csv", {"A": points("motive_skeleton")})
    elif "DataRate" in old:
        file = write_trc(tmp_path / "a.trc", points("opencap"))
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(ParameterError, match=message):
        read(file)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Export Frame Rate", "Total Exported Frames,999,Export Frame Rate"),
        ("\tUnits\n60\t60\tm\n", "\tUnits\tNumFrames\n60\t60\tm\t999\n"),
    ],
    ids=["Motive", "trc"],
)
def test_frames_that_the_head_states_and_the_file_lacks_are_told(tmp_path: Path, old: str, new: str) -> None:
    if "Export" in old:
        file = write_motive(tmp_path / "a.csv", {"A": points("motive_skeleton")})
    else:
        file = write_trc(tmp_path / "a.trc", points("opencap"))
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    assert read(file).left_out == ("939 of the 999 frames stated in the header: the file does not contain them",)


def test_a_session_with_a_wrong_mass_is_refused(tmp_path: Path) -> None:
    file = write_trc(tmp_path / "MarkerData" / "walk.trc", {"Hip": np.ones((FRAMES, 3))})
    (tmp_path / "sessionMetadata.yaml").write_text("mass_kg: 7000\n")
    with pytest.raises(ParameterError, match=r"mass_kg is 7000; valid: 30\.0 to 200\.0 kg"):
        read(file)


def test_a_folder_without_trials_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"has no trials; valid: a folder of OpenCap"):
        trials_in(tmp_path)


def test_files_of_a_handover_have_equal_lengths(tmp_path: Path) -> None:
    folder = write_handover(tmp_path / "handover", GRIPS)
    file = folder / "giver_hip_pose_saved.csv"
    file.write_text("\n".join(file.read_text().splitlines()[:-1]) + "\n")
    with pytest.raises(ParameterError, match="valid: all the same number"):
        read(folder)
