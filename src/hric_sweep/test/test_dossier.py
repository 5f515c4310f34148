"""Dossier of runs and sweeps: contents, gaps, marks, hashes, and refusals."""

import html
import json
import re
import subprocess
from pathlib import Path

import pytest
import sweep_folder

from hric_bags.run_folder import RunFolder
from hric_core.command import perform
from hric_core.errors import HricError
from hric_report import headless
from hric_run.definition import experiment
from hric_sweep.dossier import build, run_part, sweep_part


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder of the experiment contact, until shortly after the impact."""
    words = ["simulator:=mujoco", "duration:=1.6"]
    root = tmp_path_factory.mktemp("runs")
    definition = experiment.load("contact", words)
    return headless.run(definition, words, root=root, progress=False, figures=False).folder.path


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sweep_folder.write(tmp_path_factory.mktemp("sweeps") / "peak force", 100)


def page(*folders: Path) -> str:
    """Text of the page of a dossier, without tags."""
    parts = [
        sweep_part.part_of(one) if (one / "sweep.yaml").is_file() else run_part.part_of(RunFolder(one))
        for one in folders
    ]
    return html.unescape(
        re.sub(r"<style>.*?</style>|<[^>]*>", " ", build.contents(parts)["index.html"].decode(), flags=re.S)
    )


def test_page_says_that_it_assesses_no_risk(run: Path) -> None:
    assert "This dossier is not a risk assessment." in page(run)


def test_page_lists_each_missing_signal_as_gap(run: Path) -> None:
    gaps = page(run).split("7 Not assessed")[-1].split("8 Limits")[0]
    verdict = json.loads((run / "verdict.json").read_text())
    assert verdict["missing"] and all(one["signal"] in gaps for one in verdict["missing"])


def test_page_marks_limits_with_their_sources(run: Path) -> None:
    text = " ".join(page(run).split())
    assert "lower arm, wrist quasi-static 160, transient 320 limits of force [N] confirmed twice S1, S2" in text


def test_limits_of_a_users_file_are_not_known(run: Path, tmp_path: Path) -> None:
    verdict = json.loads((run / "verdict.json").read_text())
    verdict["limits"]["title"] = "limits of our works"
    folder = tmp_path / run.name
    folder.mkdir()
    for path in run.glob("*.*"):
        (folder / path.name).write_bytes(path.read_bytes())
    (folder / "verdict.json").write_text(json.dumps(verdict))
    assert 'The limits in "limits of our works" come from a file of the user' in page(folder)


def test_same_run_gives_the_same_dossier(run: Path) -> None:
    assert build.contents([run_part.part_of(RunFolder(run))]) == build.contents([run_part.part_of(RunFolder(run))])


def test_hashes_of_all_files_are_right(run: Path, tmp_path: Path) -> None:
    perform(["dossier", str(run), "--output", str(tmp_path)])
    listed = {line.split("  ")[1] for line in (tmp_path / "SHA256SUMS").read_text().splitlines()}
    files = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()} - {"SHA256SUMS"}
    assert listed == files
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=tmp_path, check=True)


def test_folder_with_other_files_is_refused(run: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(HricError, match=r"contains notes\.txt, which is not part of this dossier; valid: "):
        perform(["dossier", str(run), "--output", str(tmp_path)])
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_same_run_given_twice_is_refused(run: Path) -> None:
    with pytest.raises(HricError, match=r"2 runs or sweeps have the name .*; valid: each name once"):
        page(run, run)


def test_run_without_person_is_not_assessed(tmp_path: Path) -> None:
    words = ["simulator:=mujoco", "duration:=0.2"]
    done = headless.run(experiment.load("pd_step", words), words, root=tmp_path, progress=False, figures=False)
    part = run_part.part_of(done.folder)
    assert part.label == ("unknown", "not assessed")
    assert [gap.reason for gap in part.gaps] == ["no person was in the run"]


def test_sweep_gives_probability_with_interval(sweep: Path) -> None:
    reply = sweep_part.part_of(sweep).replies["contact"]
    assert reply.reply == "estimated"
    assert re.search(r"= 0\.\d+, 95 % interval 0\.\d+ to 0\.\d+$", reply.subject)


def test_sweep_lists_questions_without_output(sweep: Path) -> None:
    reasons = {gap.subject: gap.reason for gap in sweep_part.part_of(sweep).gaps}
    assert reasons["Was the posture within limits?"] == "no output of this sweep is about it"


def test_sweep_lists_failed_runs_as_gaps(sweep: Path) -> None:
    failed = [gap for gap in sweep_part.part_of(sweep).gaps if gap.reason.startswith("failed: ")]
    assert sum(int(gap.subject.split()[0]) for gap in failed) == sweep_part.load(sweep).count("failed") > 0
