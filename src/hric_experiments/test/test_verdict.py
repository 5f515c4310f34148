"""The verdict of runs: findings from the worst on, in JSON that keeps its schema, and the exit code."""

import json
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from hric_assessment.findings import DISCLAIMER, Finding, Outcome
from hric_assessment.verdict import Verdict, command, result
from hric_experiments import cli

SCHEMA = Path(__file__).parents[2] / "hric_assessment" / "config" / "verdict.schema.json"


@pytest.fixture(scope="module")
def contact(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The arm meets a forearm."""
    root = tmp_path_factory.mktemp("runs")
    assert (
        cli.main(["run", "contact", "simulator:=mujoco", "duration:=2", "--quiet", "--no-figures", "--runs", str(root)])
        == 0
    )
    yield (root / "latest").resolve()


def finding(outcome: Outcome, share: float | None = None) -> Finding:
    return Finding("something", outcome, "a reason", "a table", share, group="contact")


def verdict(*findings: Finding) -> Verdict:
    about = {"name": "a", "kind": "bag", "experiment": None, "begin": 0.0, "end": 1.0}
    return Verdict(about, {"title": "a", "edition": "b"}, None, (), result.ranked(findings))


def test_a_run_leaves_a_verdict_that_keeps_its_schema(contact: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = command.main([str(contact), "--contact-area", "1e-4"])
    found = json.loads((contact / "verdict.json").read_text())
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(found)
    text = capsys.readouterr().out
    assert code == 4  # the trunk is not simulated, so a low posture score may be higher
    assert text.count(DISCLAIMER) == len(found["findings"]) + 1
    blows = [one for one in found["findings"] if one["group"] == "contact"]
    assert blows and all(one["outcome"] == "within limits" for one in blows)
    assert blows[0]["values"]["transient mean pressure [Pa]"] == pytest.approx(
        blows[0]["values"]["transient peak [N]"] / 1e-4
    )
    assert {one["signal"].split(" (")[0] for one in found["missing"]} == {
        "activation of his muscles",
        "what his hands hold, and with which force",
        "joints of the legs",
    }


def test_without_an_area_no_contact_is_within_limits(contact: Path) -> None:
    assert command.main([str(contact)]) == 4
    found = json.loads((contact / "verdict.json").read_text())
    assert {one["outcome"] for one in found["findings"] if one["group"] == "contact"} == {"not assessable"}


@pytest.mark.parametrize(
    ("outcomes", "expected", "code"),
    [
        ((Outcome.WITHIN,), Outcome.WITHIN, 0),
        ((Outcome.WITHIN, Outcome.WARNING), Outcome.WARNING, 0),
        ((Outcome.WARNING, Outcome.NOT_ASSESSABLE, Outcome.WITHIN), Outcome.NOT_ASSESSABLE, 4),
        ((Outcome.NOT_ASSESSABLE, Outcome.ABOVE, Outcome.WITHIN), Outcome.ABOVE, 1),
        ((), Outcome.NOT_ASSESSABLE, 4),
    ],
)
def test_the_worst_finding_is_the_outcome_and_the_exit_code(
    outcomes: tuple[Outcome, ...], expected: Outcome, code: int
) -> None:
    found = verdict(*map(finding, outcomes))
    assert (found.outcome, found.exit_code) == (expected, code)
    assert not outcomes or found.findings[0].outcome == expected


@pytest.mark.parametrize(
    ("share", "expected"), [(0.79, Outcome.WITHIN), (0.8, Outcome.WARNING), (1.0, Outcome.WARNING)]
)
def test_near_its_limit_a_finding_is_a_warning_that_says_why(share: float, expected: Outcome) -> None:
    found = result.warned(finding(Outcome.WITHIN, share))
    assert found.outcome == expected
    assert any("80 % of a limit on (chosen here)" in note for note in found.notes) == (expected == Outcome.WARNING)


def test_a_thinned_timeline_keeps_its_ends_and_extremes() -> None:
    random = np.random.default_rng(5)
    time, values = np.arange(100_000.0), random.normal(size=100_000)
    rows = result.thinned(time, values)
    assert len(rows) <= 2000 and rows == sorted(set(rows)) and {0, 99_999} <= set(rows)
    assert values[rows].max() == values.max() and values[rows].min() == values.min()


def test_a_recording_that_is_not_there_is_a_mistake(tmp_path: Path) -> None:
    with pytest.raises(Exception, match=r"no bag nothing.bag"):
        command.main([str(tmp_path / "nothing.bag")])
