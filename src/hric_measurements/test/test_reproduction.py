"""Command `reproduce`: published experiments, data sets of the user, results and pages."""

from pathlib import Path

import h5py
import pytest
import yaml

from hric_core.command import main
from hric_core.errors import HricError
from hric_measurements.reproduction import dataset, definition, results
from hric_measurements.reproduction.definition import MeasuredValue
from hric_measurements.reproduction.results import ReproducedValue, ReproductionOutcome

QUICK = "elbow_of_women"
"""Experiment that needs no simulation over time."""
DOCUMENT = Path(__file__).parents[3] / "docs" / "reproduction.md"


def value(simulated: float | None, **measured: float) -> ReproducedValue:
    return ReproducedValue("torque", MeasuredValue(text="torque", unit="N m", **measured), simulated)


def write_experiment(folder: Path) -> Path:
    """Write an experiment whose measured values are a column of a data set; return its path."""
    content = yaml.safe_load((definition.FOLDER / f"{QUICK}.yaml").read_text())
    content["data"] = "one row per person"
    content["quantities"] = {"flexion": {"text": "flexion", "unit": "N m", "column": "torque"}}
    path = folder / "measured_torques.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize("name", definition.names())
def test_shipped_experiment_names_source_and_simulation(name: str) -> None:
    experiment = definition.load(name)
    assert callable(experiment.simulation)
    assert experiment.source
    assert experiment.quantities


@pytest.mark.parametrize("name", definition.names())
def test_manual_shows_every_shipped_quantity(name: str) -> None:
    page, experiment = DOCUMENT.read_text(), definition.load(name)
    for quantity in experiment.quantities.values():
        assert f"| {name} | {quantity.text} |" in page


def test_command_without_name_lists_experiments(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce"]) == 0
    assert set(definition.names()) <= set(capsys.readouterr().out.split())


def test_result_has_page_and_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", QUICK, "--out", str(tmp_path)]) == 0
    assert "40.5 +- 8.3 N m" in capsys.readouterr().out
    assert "published spread" in (tmp_path / f"{QUICK}.html").read_text()
    assert f"| {QUICK} |" in (tmp_path / "reproduction.md").read_text()


def test_finished_experiment_is_not_simulated_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["reproduce", QUICK, "--out", str(tmp_path)])
    path = tmp_path / f"{QUICK}.json"
    path.write_text(path.read_text().replace('"flexion": 42', '"flexion": 99'))
    capsys.readouterr()
    main(["reproduce", QUICK, "--out", str(tmp_path)])
    assert "99.5" in capsys.readouterr().out


def test_changed_code_invalidates_finished_results(tmp_path: Path) -> None:
    experiment = definition.load(QUICK)
    results.store(tmp_path / "kept.json", "before", results.Reproduction(QUICK, experiment, {"flexion": 1.0}))
    assert results.restore(tmp_path / "kept.json", "after") is None


def test_damaged_result_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "kept.json").write_text("{")
    with pytest.raises(HricError, match=r"kept\.json"):
        results.restore(tmp_path / "kept.json", "key")


@pytest.mark.parametrize(
    ("simulated", "measured", "outcome"),
    [
        (9.0, {"mean": 10.0, "sd": 1.0}, ReproductionOutcome.WITHIN),
        (8.9, {"mean": 10.0, "sd": 1.0}, ReproductionOutcome.OUTSIDE),
        (3.0, {"low": 1.0, "high": 3.0}, ReproductionOutcome.WITHIN),
        (10.0, {"mean": 10.0}, ReproductionOutcome.NO_SPREAD),
        (None, {"mean": 10.0, "sd": 1.0}, ReproductionOutcome.NO_DATA),
    ],
)
def test_outcome_compares_with_published_spread(
    simulated: float | None, measured: dict[str, float], outcome: ReproductionOutcome
) -> None:
    assert value(simulated, **measured).outcome is outcome


def test_bar_shows_spread_mean_and_simulation() -> None:
    assert results.bar(value(15.0, mean=10.0, sd=2.0)) == "........[.+.]..o....."


def test_data_set_gives_mean_deviation_and_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "torques.csv").write_text("torque\n40\n42\n44\n")
    command = ["reproduce", str(write_experiment(tmp_path)), "--data", str(tmp_path / "torques.csv")]
    assert main(command) == 0
    assert "42 +- 2 N m" in capsys.readouterr().out


def test_hdf5_gives_the_columns_of_its_root(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "torques.h5", "w") as file:
        file["torque"] = [40.0, 42.0]
        file["image"] = [[0.0]]
    assert {name: list(column) for name, column in dataset.read(tmp_path / "torques.h5").items()} == {
        "torque": [40.0, 42.0]
    }


def test_missing_data_set_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", str(write_experiment(tmp_path))]) == 0
    assert "1 no data set" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "expected"),
    [("force\n1\n", "no column torque"), ("torque\nmuch\n", "columns of numbers"), ("torque\n", "is empty")],
)
def test_unsuitable_data_set_is_refused_with_its_fault(
    text: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "torques.csv").write_text(text)
    command = ["reproduce", str(write_experiment(tmp_path)), "--data", str(tmp_path / "torques.csv")]
    assert main(command) == 2
    assert expected in capsys.readouterr().err


def test_data_for_an_experiment_without_data_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", QUICK, "--data", "torques.csv"]) == 2
    assert "without --data" in capsys.readouterr().err


def test_quantity_without_any_value_is_refused() -> None:
    with pytest.raises(HricError, match="mean"):
        MeasuredValue(text="torque")


def test_folder_without_its_data_set_is_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", str(write_experiment(tmp_path)), "--data", str(tmp_path)]) == 0
    assert "1 no data set" in capsys.readouterr().out
