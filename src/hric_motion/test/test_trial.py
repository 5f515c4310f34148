"""Files of a laboratory become the motion of a person: labels, subject, static trial, vertical axis."""

from pathlib import Path

import ezc3d
import numpy as np
import pytest

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray
from hric_human.body import Subject, describe
from hric_motion.marker_sets import marker_sets
from hric_motion.postures import BodyPostures, MarkerPostures
from hric_motion.trial import TrialMotion, prefixes, trial_motion

RATE, FRAMES = 50.0, 80
SPORTS = marker_sets()["qualisys_sports"]
BODY = describe(Subject(code="S07", mass=70.0, height=1.72, sex="male", parts="whole_body"))
NAMES = tuple(dict.fromkeys(SPORTS.known.values()))
JOINTS = list(BODY.joints)
LABELS = {marker: label for label, marker in SPORTS.known.items()}
INNER = ("LKneeIn", "RKneeIn", "LAnkleIn", "RAnkleIn")


def truth(span: float) -> BodyPostures:
    """Return a motion of all joints; span: share of half their range in which they move [1]."""
    t, q = np.arange(FRAMES) / RATE, np.zeros((FRAMES, len(JOINTS)))
    for column, joint in enumerate(BODY.joints.values()):
        low, high = joint.range
        middle, wave = (
            np.clip(0.2, low + 0.1, high - 0.1),
            np.sin(2.0 * np.pi * (0.6 + 0.1 * (column % 5)) * t + column),
        )
        q[:, column] = np.clip(middle + 0.5 * span * (high - low) * wave, low + 0.02, high - 0.02)
    R = np.tile(np.eye(3), (FRAMES, 1, 1))
    return BodyPostures(R, np.column_stack([0.3 * t, 0.0 * t, np.full(FRAMES, 1.0)]), q)


def markers(span: float) -> FloatArray:
    noise = 0.001 * np.random.default_rng(2).normal(size=(FRAMES, len(NAMES), 3))
    return MarkerPostures(BODY, NAMES, tuple(SPORTS.extra.values())).positions(truth(span)) + noise


def write(path: Path, columns: dict[str, FloatArray], height: float = 0.0) -> Path:
    """Write positions by label, shape (n, 3) each [m], as a c3d file that states z up; height: of the subject [mm]."""
    file = ezc3d.c3d()
    points = 1e3 * np.stack(list(columns.values()), axis=1).transpose(2, 1, 0)
    file["data"]["points"] = np.vstack([points, np.ones((1, *points.shape[1:]))])
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(columns)
    file.add_parameter("POINT", "UNITS", ["mm"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    if height:
        file.add_parameter("PROCESSING", "Height", [height])
    file.write(str(path))
    return path


def standing(names: tuple[str, ...], up: str = "z") -> dict[str, FloatArray]:
    """Return markers of the upright body in a laboratory whose vertical axis is y or z."""
    p = MarkerPostures(BODY, names).positions(truth(0.0))
    return {name: p[:, k] if up == "z" else p[:, k][:, [1, 2, 0]] for k, name in enumerate(names)}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> TrialMotion:
    """Return the motion of person A of two in a file without inner markers, with a static trial that has them."""
    folder, moving, still = tmp_path_factory.mktemp("trial"), markers(0.6), markers(0.02)
    columns = {f"A:{LABELS[name]}": moving[:, k] for k, name in enumerate(NAMES) if name not in INNER}
    columns |= {f"B:{LABELS[name]}": moving[:, k] + 2.0 for k, name in enumerate(NAMES[:6])}
    columns["A:RKneeAngles"] = moving[:, 0]
    static = write(folder / "static.c3d", {f"A:{LABELS[name]}": still[:, k] for k, name in enumerate(NAMES)})
    motion = write(folder / "motion.c3d", columns, height=1720.0)
    assert prefixes(motion) == ("A:", "B:")
    return trial_motion(motion, static, prefix="A", measures={"mass": 70.0})


def test_a_motion_comes_back_from_labels_of_another_set(result: TrialMotion) -> None:
    error = np.degrees(result.motion.q - truth(0.6).q)
    assert result.marker_set == "Qualisys sports"
    assert np.isfinite(error).mean() > 0.9 and np.sqrt(np.nanmean(error**2)) < 3.0


def test_markers_of_the_static_trial_alone_are_used(result: TrialMotion) -> None:
    assert set(INNER) <= set(result.motion.names)


def test_each_measure_says_where_it_is_from(result: TrialMotion) -> None:
    assert result.sources == {"mass": "option", "height": "motion.c3d", "sex": "P50_male"}
    assert (result.subject.mass, result.subject.height) == (70.0, 1.72)


def test_assumptions_and_what_is_left_out_are_notes(result: TrialMotion) -> None:
    assert "assumed: sex male, of P50_male, as no option and no file states it" in result.notes
    assert "1 computed points: A:RKneeAngles" in result.notes


def test_several_people_are_refused_with_their_prefixes(tmp_path: Path) -> None:
    names = NAMES[:12]
    columns = {f"{who}:{LABELS[name]}": np.ones((3, 3)) for who in ("Ann", "Bo") for name in names}
    with pytest.raises(ParameterError, match=r"markers of 2 people; .*'Ann:' \(12 markers\), 'Bo:' \(12 markers\)"):
        trial_motion(write(tmp_path / "two.c3d", columns))


def test_an_unknown_set_is_refused_with_the_nearest(tmp_path: Path) -> None:
    file = write(tmp_path / "odd.c3d", {name: np.ones((3, 3)) for name in ("LASI", "RASI", "P1", "P2")})
    with pytest.raises(ParameterError, match=r"Plug-in Gait is the nearest, with 2 of 4 labels \(LASI, RASI\), 2 of"):
        trial_motion(file)


def test_a_trc_file_with_z_up_is_refused(tmp_path: Path) -> None:
    columns = standing(tuple(BODY.markers), up="z")
    head = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tUnits", f"{RATE:g}\tm"]
    rows = [
        "\t".join([f"{k + 1}", f"{k / RATE}", *(f"{v:.6f}" for p in columns.values() for v in p[k])]) for k in (0, 1)
    ]
    names = "Frame#\tTime\t" + "\t\t\t".join(columns)
    (tmp_path / "a.trc").write_text("\n".join([*head, names, "\t\tX1", *rows]) + "\n")
    with pytest.raises(ParameterError, match=r"with y up, the head is .*state up: z"):
        trial_motion(tmp_path / "a.trc")


def test_a_file_of_another_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"valid: a \.c3d, \.xdf, \.trc, \.csv or \.mvnx file"):
        trial_motion(tmp_path / "walk.txt")


def test_a_marker_that_no_body_can_have_is_left_out_and_named(tmp_path: Path) -> None:
    columns = {LABELS[name]: markers(0.2)[:, k] for k, name in enumerate(NAMES)}
    label = LABELS["LFIN"] if "LFIN" in LABELS else next(iter(columns))
    columns[label] = columns[label].copy()
    columns[label][40] += 50.0
    result = trial_motion(write(tmp_path / "stray.c3d", columns))
    assert any(f"{label} in 1 of {FRAMES} frames" in note for note in result.notes)
    assert np.nanmax(result.motion.residual) < 0.02
