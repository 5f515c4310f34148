"""Files of measured stops in a verdict: they replace the assumption, and are named."""

import json
from pathlib import Path

import numpy as np
import pytest

from hric_assessment.findings import NotAssessableError
from hric_assessment.separation import stopping
from hric_assessment.separation.stopping import MEASUREMENT, StopRow, StopTable
from hric_assessment.verdict.choices import BrakingChoice
from hric_core.command import main, perform
from hric_core.errors import HricError


def table(speed: float) -> StopTable:
    rows = (StopRow(speed, 0.0, 0.21, 0.07),)
    return StopTable(title="our arm", kind=MEASUREMENT, source="us", reaction_time=0.02, stops=rows)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("runs")
    words = ["contact", "simulator:=mujoco", "duration:=1", "--quiet", "--no-figures", "--runs", str(root)]
    assert main(["run", *words]) == 0
    return (root / "latest").resolve()


def separation(run: Path, path: Path) -> dict[str, object]:
    perform(["assess", str(run), "--stop", str(path)])
    (found,) = (
        one for one in json.loads((run / "verdict.json").read_text())["findings"] if one["group"] == "separation"
    )
    return dict(found)


def test_without_a_file_the_assumption_is_named_as_one() -> None:
    assert "chosen here, since its braking is not known" in BrakingChoice().text(0.0)


def test_perception_comes_on_top_of_the_arms_own_reaction() -> None:
    stop = BrakingChoice(table(1.0)).stop(np.array([0.0, 0.5]), 0.0)
    assert stop.reaction_time == pytest.approx(0.12)
    assert np.asarray(stop.time).tolist() == [0.0, 0.21] and np.asarray(stop.distance).tolist() == [0.0, 0.07]


def test_the_terms_are_those_of_the_file_and_it_is_named(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(stopping.as_yaml(table(5.0)))
    found = separation(run, path)
    values, notes = found["values"], " ".join(found["notes"])  # type: ignore[call-overload]
    assert values["S_s [m]"] == pytest.approx(0.07)  # type: ignore[index]
    assert values["S_r [m]"] == pytest.approx(0.12 * values["v_r [m/s]"])  # type: ignore[index]
    assert values["S_h [m]"] == pytest.approx((0.12 + 0.21) * values["v_h [m/s]"])  # type: ignore[index]
    assert "our arm, with 0 kg" in notes


def test_the_table_of_the_simulation_says_in_the_finding_that_it_is_one(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "stops.yaml"
    path.write_text(stopping.as_yaml(stopping.load()))
    assert "not of a real arm's brake" in str(separation(run, path))


def test_an_arm_that_is_faster_than_the_file_is_not_assessable(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(stopping.as_yaml(table(0.001)))
    found = separation(run, path)
    assert found["outcome"] == "not assessable" and "a file of stops that includes it" in str(found["reason"])
    with pytest.raises(NotAssessableError):
        BrakingChoice(table(0.001)).stop(np.array([1.0]), 0.0)


def test_a_wrong_file_is_a_mistake(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("title: ours\n")
    with pytest.raises(HricError, match=r"own\.yaml.*"):
        perform(["assess", str(run), "--stop", str(path)])
