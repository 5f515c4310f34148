"""Muscle load of a recorded motion: from a run, and from a c3d file with the markers of the same run."""

from dataclasses import replace
from pathlib import Path

import ezc3d
import numpy as np
import opensim
import pytest
import yaml
from numpy.testing import assert_allclose

from hric_analysis import human_opensim
from hric_bags.records import human_record
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_core.trial.plates import TrialPlate
from hric_human.muscles import MuscleSet, find
from hric_human.muscles.after_run import MuscleLoad
from hric_report import headless as runner
from hric_report import muscle_load
from hric_report.muscle_load import MuscleLoadError, MuscleLoadResult
from hric_run.definition import experiment

ARM26 = Path(__file__).parents[2] / "hric_human" / "test" / "arm26" / "arm26.osim"
ENDS = 0.3
"""Duration at both ends of a record where filters and splines have errors [s]."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def run(runs: Path) -> Path:
    """Return a run in which a person guides the robot's hand in front of cameras."""
    return led(runs)


@pytest.fixture(scope="module")
def by_muscles(runs: Path) -> Path:
    """Return the same run with a person moved by muscles."""
    return led(runs, "human.drive:=muscle")


def led(runs: Path, *more: str) -> Path:
    packaged = experiment.find("guided_collection")
    content = yaml.safe_load(packaged.read_text())
    seen = runs / "seen.yaml"
    seen.write_text(yaml.safe_dump({key: content[key] for key in content if key not in ("force_plate", "sync")}))
    overrides = ["simulator:=mujoco", "duration:=3", *more]
    made = runner.run(experiment.load(str(seen), overrides), overrides, root=runs, progress=False, figures=False)
    return made.folder.path


@pytest.fixture(scope="module")
def c3d(run: Path) -> Path:
    return exported(run)


def exported(run: Path) -> Path:
    assert main(["export", str(run), "--format", "c3d", "--quiet"]) == 0
    (path,) = (run / "export").rglob("*.c3d")
    return path


@pytest.fixture(scope="module")
def recorded(run: Path) -> MuscleLoadResult:
    return muscle_load.of_run(muscle_load.described_by(str(run)))


def with_noise(path: Path, folder: Path) -> Path:
    """Return the same markers with 0.5 mm of noise."""
    file = ezc3d.c3d(str(path))
    points = file["data"]["points"]
    points[:3] += np.random.default_rng(1).normal(0.0, 0.5, points[:3].shape)
    del file["data"]["meta_points"]
    file.write(str(folder / "noisy.c3d"))
    return folder / "noisy.c3d"


def rms(a: MuscleLoad, b: MuscleLoad) -> float:
    """Return the RMS of the difference of the activations."""
    first, last = max(a.time[0], b.time[0]) + ENDS, min(a.time[-1], b.time[-1]) - ENDS
    time = np.arange(first, last, 0.01)
    assert len(time) > 150

    def at(load: MuscleLoad) -> FloatArray:
        return np.array([np.interp(time, load.time, column) for column in load.activation.T])

    return float(np.sqrt(np.mean((at(a) - at(b)) ** 2)))


def test_joint_torque_after_a_run_is_what_the_run_logged(run: Path, recorded: MuscleLoadResult) -> None:
    record, load = muscle_load.described_by(str(run)).record, recorded.load
    assert record is not None
    inside = (load.time > ENDS) & (load.time < load.time[-1] - ENDS)
    for j, name in enumerate(load.joints):
        logged = np.interp(load.time[inside], record.torque_time, record.torque[:, record.joints.index(name)])
        assert_allclose(load.torque[inside, j], logged, atol=0.02)
    assert any("external forces act on the links: r_wrist" in note for note in recorded.notes)
    assert any("joint torques differ from those recorded in the run by" in note for note in recorded.notes)


def test_without_the_grip_the_torque_would_be_another(run: Path, recorded: MuscleLoadResult) -> None:
    described = muscle_load.described_by(str(run))
    assert described.record is not None
    described.record.grips.clear()
    alone = muscle_load.of_run(described).load
    assert np.abs(alone.torque - recorded.load.torque).max() > 0.5


def test_a_c3d_of_a_run_gives_what_the_run_gives(run: Path, c3d: Path, recorded: MuscleLoadResult) -> None:
    found = muscle_load.of_c3d(c3d, muscle_load.described_by(str(run)))
    assert rms(found.load, recorded.load) <= 1e-4
    assert "7 markers" in found.notes[0]


def test_a_c3d_with_noise_gives_it_within_two_hundredths(
    run: Path, c3d: Path, recorded: MuscleLoadResult, tmp_path: Path
) -> None:
    found = muscle_load.of_c3d(with_noise(c3d, tmp_path), muscle_load.described_by(str(run)))
    error = rms(found.load, recorded.load)
    print(f"activation with 0.5 mm of noise: {error:.5f} RMS")
    assert 1e-5 < error <= 0.02


def test_a_run_and_its_c3d_give_the_activations_that_moved_them(by_muscles: Path, tmp_path: Path) -> None:
    moved = human_record.read(RunFolder(by_muscles).bag_path, float)
    assert moved is not None and moved.muscles is not None
    described = muscle_load.described_by(str(by_muscles))
    noisy = with_noise(exported(by_muscles), tmp_path)
    for found, bound in ((muscle_load.of_run(described), 1e-3), (muscle_load.of_c3d(noisy, described), 0.02)):
        load = found.load
        inside = (load.time > ENDS) & (load.time < load.time[-1] - ENDS)
        given = [np.interp(load.time, moved.muscles.time, column) for column in moved.muscles.activation.T]
        logged = np.array(given)[[moved.muscles.names.index(name) for name in load.names]].T
        error = float(np.sqrt(np.mean((load.activation - logged)[inside] ** 2)))
        print(f"activation after the run against that in the run: {error:.1e} RMS")
        assert error <= bound and np.ptp(logged[inside], axis=0).max() > 0.03


def test_a_c3d_that_begins_later_is_loaded_at_the_times_of_the_run(
    run: Path, c3d: Path, recorded: MuscleLoadResult, tmp_path: Path
) -> None:
    file = ezc3d.c3d(str(c3d))
    rate = file["parameters"]["POINT"]["RATE"]["value"][0]
    late = round(0.5 * rate)
    file["data"]["points"] = file["data"]["points"][:, :, late:]
    del file["data"]["meta_points"]
    file.add_parameter("HRIC", "START_TIME", [late / rate])
    file.write(str(tmp_path / "late.c3d"))
    found = muscle_load.of_c3d(tmp_path / "late.c3d", muscle_load.described_by(str(run))).load
    assert found.time[0] == pytest.approx(0.5)
    assert rms(found, recorded.load) <= 1e-3


def test_opensim_opens_its_files_and_has_the_forces_in_its_ground(
    run: Path, recorded: MuscleLoadResult, tmp_path: Path
) -> None:
    paths = {path.stem: path for path in muscle_load.write(recorded, tmp_path)}
    assert {"activation", "force", "torque", "joint_reactions"} <= set(paths)
    load = recorded.load
    activation = opensim.TimeSeriesTable(str(paths["activation"]))
    assert tuple(activation.getColumnLabels()) == load.names
    assert_allclose(activation.getMatrix().to_numpy(), load.activation)
    reactions = opensim.TimeSeriesTable(str(paths["joint_reactions"]))
    forward, up, right = (
        reactions.getDependentColumn(f"right_shoulder_on_distal_in_ground_f{axis}").to_numpy() for axis in "xyz"
    )
    assert_allclose(np.stack([forward, -right, up], axis=1), load.contact["right_shoulder"])
    height = reactions.getDependentColumn("right_shoulder_on_distal_in_ground_py").to_numpy()
    described = muscle_load.described_by(str(run))
    assert_allclose(height, described.settings.root(described.body).position[2])


def test_the_command_prints_tables_and_leaves_files(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["muscle_load", str(run), "--fatigue"]) == 0
    printed = capsys.readouterr().out
    for words in ("(model estimate)", "right_delt_scap_d", "right_el_flex", "right_shoulder ", "NOT REPRODUCED"):
        assert words in printed
    assert (run / "muscle_load" / "activation.sto").is_file()


def test_the_command_takes_the_muscles_of_a_users_model(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert main(["muscle_load", str(run), "--muscles", str(ARM26), "--output", str(tmp_path)]) == 0
    assert "muscles: arm26, 6 of them" in capsys.readouterr().out
    labels = opensim.TimeSeriesTable(str(tmp_path / "activation.sto")).getColumnLabels()
    assert {"right_BRA", "right_sh_abd+", "right_pro_sup-"} <= set(labels)
    assert main(["muscle_load", str(run), "--muscles", "nobody"]) == 2
    assert "--muscles is 'nobody'; valid: delft" in capsys.readouterr().err


def test_human_osim_of_a_run_with_muscles_has_them_with_the_same_moment_arms(run: Path, tmp_path: Path) -> None:
    person = muscle_load.described_by(str(run))
    muscles = MuscleSet(person.body, find("delft", "anatomy"))
    section = RunFolder.open(str(run)).read()["definition"]["human"] | {"drive": "muscle"}
    assert person.record is not None
    human_opensim.write(tmp_path, section, person.record, person.gravity)
    model = opensim.Model(str(tmp_path / human_opensim.MODEL))
    state = model.initSystem()
    q = dict(zip(person.record.joints, person.record.position[-1].tolist(), strict=True))
    for name, angle in q.items():
        model.getCoordinateSet().get(name).setValue(state, angle, False)
    model.realizePosition(state)
    ours = muscles.at([q[name] for name in person.body.joints], [0.0] * len(q))
    assert model.getMuscles().getSize() == muscles.muscle_count == 34
    for k in np.flatnonzero(muscles.is_muscle):
        path = opensim.Muscle.safeDownCast(model.getForceSet().get(muscles.names[k])).getPath()
        for column, joint in enumerate(muscles.joints):
            if ours.arms[k, column]:
                coordinate = model.getCoordinateSet().get(list(person.body.joints)[joint])
                assert path.computeMomentArm(state, coordinate) == pytest.approx(ours.arms[k, column], abs=1e-9)


def test_what_is_missing_is_one_error_that_names_what_is_needed(
    run: Path, c3d: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["muscle_load", str(c3d)]) == 2
    assert "add --person RUN|EXPERIMENT.yaml" in capsys.readouterr().err
    assert main(["muscle_load", str(run), "--person", str(run)]) == 2
    assert "--person and --plate are for a c3d file" in capsys.readouterr().err
    assert main(["muscle_load", str(c3d), "--person", str(run), "--plate", "3=r_wrist"]) == 2
    assert "has no force plate 3; valid: none" in capsys.readouterr().err
    assert main(["muscle_load", str(c3d), "--person", str(run), "--plate", "r_wrist"]) == 2
    assert "--plate is 'r_wrist'; valid: N=LINK" in capsys.readouterr().err
    assert main(["muscle_load", "nowhere", "--runs", str(tmp_path)]) == 2
    assert "no run folder 'nowhere'" in capsys.readouterr().err
    file = ezc3d.c3d(str(c3d))
    labels = file["parameters"]["POINT"]["LABELS"]
    labels["value"] = [name.replace("body", "thing").replace("_R", "_Q") for name in labels["value"]]
    file.write(str(tmp_path / "other.c3d"))
    with pytest.raises(
        HricError, match=r"has no marker of the body; valid: markers of one body, some of RSHO, .* thing_QSHO"
    ):
        muscle_load.of_c3d(tmp_path / "other.c3d", muscle_load.described_by(str(run)))


def test_what_is_beyond_the_range_of_muscle_paths_is_left_out(recorded: MuscleLoadResult, tmp_path: Path) -> None:
    load, n = recorded.load, len(recorded.load.time)
    outside = np.arange(n) < n // 2
    known = replace(load, outside={"right": outside}, activation=np.where(outside[:, None], 0.9, load.activation))
    paths = {path.stem: path for path in muscle_load.write(replace(recorded, load=known), tmp_path)}
    table = opensim.TimeSeriesTable(str(paths["activation"]))  # which its matrix does not keep
    written = table.getMatrix().to_numpy()
    assert np.isnan(written[outside]).all() and np.isfinite(written[~outside]).all()
    printed = muscle_load.render(replace(recorded, load=known))
    assert "0.900" not in printed and "right_delt_scap_d" in printed
    nothing = muscle_load.render(replace(recorded, load=replace(load, outside={"right": np.ones(n, np.bool_)})))
    assert "right_delt_scap_d" not in nothing and "right_el_flex" in nothing


def test_a_plate_presses_the_link_back_where_it_lies() -> None:
    """Force plate on a wall with z along -y of the laboratory; force of 30 N, 2 cm above its centre."""
    T = np.array([[1.0, 0.0, 0.0, 0.4], [0.0, 0.0, -1.0, 0.8], [0.0, 1.0, 0.0, 1.1], [0.0, 0.0, 0.0, 1.0]])
    about_middle = np.array([0.0, 0.0, -30.0, 0.02 * -30.0, 0.0, 0.0])
    plate = TrialPlate(2, 100.0, T, (0.4, 0.6), np.tile(about_middle, (50, 1)))
    load = muscle_load.plate_load(plate, "r_wrist", np.array([0.0, 0.1]))
    assert_allclose(load.force, np.tile([0.0, -30.0, 0.0], (2, 1)))
    pressed = np.array([0.4, 0.8, 1.12])
    assert_allclose(load.torque + np.cross(load.point - pressed, load.force), 0.0, atol=1e-12)


def test_a_stray_marker_is_left_out_and_lost_markers_are_told(
    run: Path, c3d: Path, recorded: MuscleLoadResult, tmp_path: Path
) -> None:
    file = ezc3d.c3d(str(c3d))
    points, labels = file["data"]["points"], file["parameters"]["POINT"]["LABELS"]["value"]
    stray, lost = ([label[-4:] for label in labels].index(name) for name in ("RELB", "RFRM"))
    points[0, stray, 60], points[:3, lost, 100:150] = 5e4, np.nan
    del file["data"]["meta_points"]
    file.write(str(tmp_path / "stray.c3d"))
    found = muscle_load.of_c3d(tmp_path / "stray.c3d", muscle_load.described_by(str(run)))
    notes = "; ".join(found.notes)
    assert "RELB in 1 of " in notes
    assert "NOT KNOWN: the motion is interpolated where markers are lost; longest gaps: RFRM 0.42 s" in notes
    assert rms(found.load, recorded.load) < 0.01


def test_markers_elsewhere_are_refused(run: Path, c3d: Path, tmp_path: Path) -> None:
    file = ezc3d.c3d(str(c3d))
    file["data"]["points"][0] += 1000.0
    del file["data"]["meta_points"]
    file.write(str(tmp_path / "moved.c3d"))
    with pytest.raises(MuscleLoadError, match=r"mm from those of .* valid: up to 50 mm, in the same laboratory"):
        muscle_load.of_c3d(tmp_path / "moved.c3d", muscle_load.described_by(str(run)))


def test_an_experiment_without_a_human_is_refused() -> None:
    packaged = experiment.find("pd_step")
    with pytest.raises(MuscleLoadError, match=r"pd_step.yaml has no human"):
        muscle_load.described_by(str(packaged))
