"""Files of OpenSim, read back by OpenSim's own readers, and its tools run on them."""

from pathlib import Path

import export_bags
import numpy as np
import opensim
import pytest
from export_bags import FRAMES, HIDDEN, MARKERS_BODY, PLATE_ORIGIN, PRESSED, WEIGHT, Truth

from hric_bags.export import exporting, frames, inverse_dynamics, inverse_kinematics, loads, recording
from hric_bags.export.exporting import ExportRequest
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.trial.opensim_text import read_storage
from hric_report import headless
from hric_run.definition import experiment

R_GROUND_BASE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""Rotation from the base to OpenSim's ground: z of the base points along y of the ground."""
TORQUE_BOUND = 0.002
"""Largest error of pd_step's inverse dynamics against the logged torque, as in INTERFACE.md [N m]."""


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    return export_bags.write(tmp_path_factory.mktemp("bag") / "made_up.bag")


@pytest.fixture(scope="module")
def folder(truth: Truth) -> Path:
    """An export in all formats of OpenSim."""
    request = ExportRequest(("trc", "mot", "sto", "external_loads"), load_body="foot")
    exporting.export(recording.find(str(truth.bag)), request, truth.bag.parent / "out")
    return truth.bag.parent / "out"


def test_loads_that_are_read_back_equal_those_written(truth: Truth, folder: Path) -> None:
    source = recording.find(str(truth.bag))
    tables = recording.read(source, ("/hric/perception/force_plate/left/samples", "/tf_static"))
    plate = tables["/hric/perception/force_plate/left/samples"]
    load = loads.of_plate(plate, frames.of_run("", tables, {}), "foot")
    storage = read_storage(folder / "external_loads" / "external_loads.mot")
    assert np.array_equal(storage.time, load.time)
    assert all(np.array_equal(storage.columns[name], values) for name, values in load.columns.items())


def test_coordinates_that_are_read_back_equal_the_log(truth: Truth, folder: Path) -> None:
    storage = read_storage(folder / "mot" / "control_log.mot")
    time, position, _ = truth.log
    assert storage.degrees and np.abs(storage.time - time).max() < 1e-9
    np.testing.assert_allclose(np.radians(np.column_stack(list(storage.columns.values()))), position, rtol=1e-14)


def markers(path: Path) -> tuple[opensim.TimeSeriesTableVec3, list[np.ndarray]]:
    """Return OpenSim's table of a .trc file, and its markers, shape (n, 3) each."""
    table = opensim.TimeSeriesTableVec3(str(path))
    columns = [table.getDependentColumnAtIndex(k) for k in range(table.getNumColumns())]
    return table, [np.array([column[i].to_numpy() for i in range(table.getNumRows())]) for column in columns]


def seen_markers(truth: Truth) -> np.ndarray:
    """Return the marker positions in the stream's frame, shape (3, n, 3) [m]; NaN: not visible."""
    found = np.array([truth.p + truth.R @ point for point in MARKERS_BODY])
    found[1, list(HIDDEN)] = np.nan
    return found


def test_opensim_reads_the_markers_and_where_one_was_not_seen(truth: Truth, folder: Path) -> None:
    table, found = markers(folder / "trc" / "hric.perception.mocap.trc")
    assert set(table.getColumnLabels()) == {"hand_1", "hand_2", "hand_3"}
    assert table.getTableMetaDataString("Units") == "m" and float(
        table.getTableMetaDataString("DataRate")
    ) == pytest.approx(240.0, rel=1e-5)
    assert np.array(table.getIndependentColumn()) == pytest.approx(np.arange(FRAMES) / 240.0, abs=1e-9)
    # A stream with y up is already in the axes of OpenSim's ground.
    for label, positions in zip(table.getColumnLabels(), found, strict=True):
        np.testing.assert_allclose(positions, seen_markers(truth)[int(label[-1]) - 1], rtol=0.0, atol=1e-15)


def test_markers_in_the_robots_base_are_rotated_to_y_up(tmp_path: Path) -> None:
    truth = export_bags.write(tmp_path / "made_up.bag", mocap_frame="base")
    exporting.export(recording.find(str(truth.bag)), ExportRequest(("trc",)), tmp_path)
    _, found = markers(tmp_path / "trc" / "hric.perception.mocap.trc")
    np.testing.assert_allclose(found[0], seen_markers(truth)[0] @ R_GROUND_BASE.T, rtol=0.0, atol=1e-15)


def test_opensim_reads_coordinates_in_degrees(truth: Truth, folder: Path) -> None:
    table = opensim.TimeSeriesTable(str(folder / "mot" / "control_log.mot"))
    assert table.getTableMetaDataString("inDegrees") == "yes" and list(table.getColumnLabels()) == ["j1", "j2", "j3"]
    column = table.getDependentColumn("j3").to_numpy()
    np.testing.assert_allclose(column, np.degrees(truth.log[1][:, 2]), rtol=1e-15, atol=0.0)
    assert np.array_equal(np.array(table.getIndependentColumn()), truth.log[0])


def test_opensim_reads_signals_bit_for_bit(truth: Truth, folder: Path) -> None:
    table = opensim.TimeSeriesTable(str(folder / "sto" / "hric.perception.emg.raw.sto"))
    assert np.array_equal(table.getDependentColumn("triceps").to_numpy(), truth.emg[:, 1])
    assert "biceps V" in table.getTableMetaDataString("units") and float(
        table.getTableMetaDataString("DataRate")
    ) == pytest.approx(2000.0)


def test_a_known_weight_on_a_plate_is_a_load_at_its_point_upwards_in_the_ground(folder: Path) -> None:
    table = opensim.TimeSeriesTable(str(folder / "external_loads" / "external_loads.mot"))
    values = {name: table.getDependentColumn(name).to_numpy() for name in table.getColumnLabels()}
    p_base = PLATE_ORIGIN + np.array([*PRESSED, 0.0])
    for k, axis in enumerate("xyz"):
        assert values[f"left_force_v{axis}"] == pytest.approx(WEIGHT if axis == "y" else 0.0, abs=1e-12)
        assert values[f"left_force_p{axis}"] == pytest.approx((R_GROUND_BASE @ p_base)[k], abs=1e-12)
        assert values[f"left_torque_{axis}"] == pytest.approx(0.0, abs=1e-12)
    loads = opensim.ExternalLoads(str(folder / "external_loads" / "external_loads.xml"), True)
    assert loads.getSize() == 1 and loads.get(0).get_applied_to_body() == "foot"


@pytest.mark.parametrize("frame", ["mocap", "base"])
def test_inverse_kinematics_of_a_free_body_finds_the_poses_of_the_stream(tmp_path: Path, frame: str) -> None:
    truth = export_bags.write(tmp_path / "made_up.bag", mocap_frame=frame)
    solution = inverse_kinematics.solve(recording.find(str(truth.bag)), output=tmp_path / "ik")
    assert (solution.body, solution.frames, solution.markers) == ("hand", FRAMES, 3)
    assert solution.partial == len(HIDDEN) and len(solution.position_error) == FRAMES - len(HIDDEN)
    assert solution.position_error.max() < 1e-6 and solution.angle_error.max() < 1e-5


def test_inverse_kinematics_of_a_body_without_markers_is_refused(
    truth: Truth, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inverse_kinematics", str(truth.bag), "--body", "foot", "--output", str(tmp_path)]) == 2
    message = capsys.readouterr().err
    assert "no body 'foot' with 3 labelled markers" in message and "hand (3)" in message and message.count("\n") == 1


def test_inverse_kinematics_whose_markers_cannot_be_written_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = export_bags.write(tmp_path / "made_up.bag")
    (tmp_path / "made_up_export").mkdir()
    (tmp_path / "made_up_export" / "trc").write_text("in the way")
    assert main(["inverse_kinematics", str(truth.bag), "--output", str(tmp_path / "ik")]) == 1
    message = capsys.readouterr().err
    assert "cannot write" in message and message.count("\n") == 1


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    overrides = ("duration:=2.0", "friction:=identified")
    definition = experiment.load("pd_step", overrides)
    return headless.run(
        definition, overrides, root=tmp_path_factory.mktemp("runs"), progress=False, figures=False
    ).folder


def test_inverse_dynamics_of_a_run_is_the_torque_that_it_logged(run: RunFolder) -> None:
    dynamics = inverse_dynamics.solve(recording.find(str(run.path)))
    worst = np.abs(dynamics.error).max()
    print(f"largest error {worst:.5f} N m, largest torque {np.abs(dynamics.logged).max():.1f} N m")
    assert len(dynamics.joint_names) == 7 and dynamics.rotor_inertia == (0.0,) * 7
    assert np.abs(dynamics.logged).max() > 10.0 and worst < TORQUE_BOUND
    assert np.array_equal(np.array(opensim.TimeSeriesTable(str(dynamics.file)).getIndependentColumn()), dynamics.time)


def test_inverse_dynamics_of_a_bag_by_itself_is_refused(truth: Truth, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inverse_dynamics", str(truth.bag)]) == 2
    assert "needs the robot's description" in capsys.readouterr().err
