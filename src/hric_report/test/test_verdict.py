"""Verdict of runs: order of findings, JSON that follows its schema, and exit code."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from hric_assessment.findings import DISCLAIMER, Finding, Outcome
from hric_assessment.verdict import result
from hric_bags.run_folder import RunFolder
from hric_core.command import main, perform

SCHEMA = Path(__file__).parents[2] / "hric_assessment" / "config" / "verdict.schema.json"

NO_AREA = ("human.contact_area:=null", "--quiet")


@pytest.fixture(scope="module")
def contact(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a run in which the arm hits a forearm."""
    root = tmp_path_factory.mktemp("runs")
    assert (
        main(["run", "contact", "simulator:=mujoco", "duration:=2", *NO_AREA, "--no-figures", "--runs", str(root)]) == 0
    )
    yield (root / "latest").resolve()


def finding(outcome: Outcome, share: float | None = None) -> Finding:
    return Finding("something", outcome, "a reason", "a table", share, group="contact")


def test_a_run_leaves_a_verdict_that_keeps_its_schema(contact: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = perform(["assess", str(contact), "--contact-area", "1e-4"])
    found = json.loads((contact / "verdict.json").read_text())
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(found)
    text = capsys.readouterr().out
    assert code == 4  # the trunk is not simulated, so a low posture score may be higher
    assert text.count(DISCLAIMER) == 1
    blows = [one for one in found["findings"] if one["group"] == "contact"]
    blows.sort(key=lambda one: one["window"])
    assert blows[0]["outcome"] == "within limits"
    assert blows[-1]["outcome"] == "not assessable"  # the robot still touches when the run ends
    assert blows[0]["values"]["transient mean pressure [Pa]"] == pytest.approx(
        blows[0]["values"]["transient peak [N]"] / 1e-4
    )
    assert {one["signal"].split(" (")[0] for one in found["missing"]} == {
        "activation of the muscles",
        "objects in the hands, and the grip forces",
        "joints of the legs",
    }


def test_without_an_area_no_contact_is_within_limits(contact: Path) -> None:
    assert perform(["assess", str(contact)]) == 4
    found = json.loads((contact / "verdict.json").read_text())
    assert {one["outcome"] for one in found["findings"] if one["group"] == "contact"} == {"not assessable"}


def test_an_area_that_the_experiment_states_counts_and_is_among_the_assumptions(contact: Path, tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "stated")
    shutil.copytree(contact, folder.path)
    run = folder.read()
    folder.write(
        run | {"definition": run["definition"] | {"human": run["definition"]["human"] | {"contact_area": 1e-4}}}
    )
    perform(["assess", str(folder.path), "--only", "contact"])
    found = json.loads((folder.path / "verdict.json").read_text())
    assert all(one["values"]["contact area [m^2]"] == 1e-4 for one in found["findings"] if one["group"] == "contact")
    assert any("1 cm^2, as the experiment states" in one for one in found["assumptions"])


def test_a_run_says_before_it_starts_what_its_verdict_will_not_know(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["run", "contact", "simulator:=mujoco", "duration:=0.6", "--no-figures", "--runs", str(tmp_path)])
    assert "the verdict of this run will not decide about posture" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("share", "expected"), [(0.79, Outcome.WITHIN), (0.8, Outcome.WARNING), (1.0, Outcome.WARNING)]
)
def test_near_its_limit_a_finding_is_a_warning_that_says_why(share: float, expected: Outcome) -> None:
    found = finding(Outcome.WITHIN, share).marked_near_limit()
    assert found.outcome == expected
    reasons = [note for note in found.notes if "at least 80 % of its limit is a warning (chosen here)" in note]
    assert bool(reasons) == (expected == Outcome.WARNING)


def test_a_thinned_timeline_keeps_its_ends_and_extremes() -> None:
    random = np.random.default_rng(5)
    time, values = np.arange(100_000.0), random.normal(size=100_000)
    rows = result.thinned(time, values)
    assert len(rows) <= 2000 and rows == sorted(set(rows)) and {0, 99_999} <= set(rows)
    assert values[rows].max() == values.max() and values[rows].min() == values.min()


def test_a_recording_that_is_not_there_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"no bag nothing.bag"):
        perform(["assess", str(tmp_path / "nothing.bag")])
