"""Sweeps from end to end: file, processes, journal, table, and messages on mistakes."""

import json
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest
import sweep_folder
import yaml

from hric_core.command import perform
from hric_core.errors import HricError
from hric_sweep import definition, table, task
from hric_sweep.definition import EXAMPLE
from hric_sweep.journal import Journal, JournalError
from hric_sweep.records import RunResponse

SWEEP: dict[str, Any] = {
    "description": "gain of a short step",
    "extends": "pd_step",
    "changes": ["simulator:=mujoco", "duration:=0.3"],
    "sweep": {
        "vary": {
            "kp": {
                "paths": ["parameters.joint_pd_controller.kp"],
                "unit": "N m/rad",
                "distribution": {"kind": "uniform", "low": 40, "high": 80},
            }
        },
        "sampler": {"kind": "random"},
        "runs": 6,
        "outputs": {
            "speed": {"path": "joints.*.velocity_peak", "unit": "rad/s", "text": "of the fastest joint"},
            "error": {"path": "setpoints.*.final_error_max", "unit": "rad"},
        },
    },
}
ENOUGH = 580.0
"""Timeout for a sweep of a few short runs on a busy machine [s]."""


def written(folder: Path, **changes: Any) -> Path:
    """Write a sweep file with changes to its section `sweep`."""
    path = folder / "gains.yaml"
    path.write_text(yaml.safe_dump({**SWEEP, "sweep": {**SWEEP["sweep"], **changes}}))
    return path


def sweep(folder: Path, *arguments: str | Path, code: int = 0, enough: float = ENOUGH) -> str:
    """Run the command; return its output."""
    command = ["rosrun", "hric_experiments", "sweep", *map(str, arguments)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=enough, env={**os.environ, "HRIC_RUNS": str(folder / "runs")}
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def folder_of(printed: str) -> Path:
    match = re.search(r"^sweep: (.*)$", printed, re.MULTILINE)
    assert match is not None, printed
    return Path(match[1])


def test_a_sweep_leaves_a_table_with_units_and_the_same_hash_with_one_worker_and_two(tmp_path: Path) -> None:
    path = written(tmp_path)
    one, two = (folder_of(sweep(tmp_path, path, "--jobs", jobs)) for jobs in ("1", "2"))
    hashes = {sweep_folder.results_sha256(table.read(folder)) for folder in (one, two)}
    assert len(hashes) == 1
    frame = table.load_sweep(two)
    assert frame["index"].tolist() == list(range(6)) and frame["seed"].tolist() == list(range(6))
    assert frame["kp"].between(40, 80).all() and (frame["speed"] > 0).all() and (frame["failure"] == "").all()
    assert frame.attrs["columns"]["speed"] == {"role": "output", "unit": "rad/s", "text": "of the fastest joint"}
    assert frame.attrs["columns"]["wall"]["role"] == "cost"
    assert frame["id"].is_unique and (frame["state_sha256"].str.len() == 64).all()


def test_a_run_of_a_sweep_is_the_run_of_the_command_with_bag_and_page(tmp_path: Path) -> None:
    outputs = {**SWEEP["sweep"]["outputs"], "along": {"path": "path.*.largest_error", "unit": "rad"}}
    folder = folder_of(sweep(tmp_path, written(tmp_path, runs=1, outputs=outputs)))
    row = table.read(folder).to_pylist()[0]
    printed = sweep(tmp_path, "rerun", folder, row["id"])
    match = re.search(r"^run folder: (.*)$", printed, re.MULTILINE)
    assert match is not None and f"state_sha256: {row['state_sha256']}, as in the sweep" in printed
    metrics = json.loads((Path(match[1]) / "metrics.json").read_text())
    speeds = [joint["velocity_peak"] for joint in metrics["joints"].values()]
    assert row["speed"] == max(speeds) and row["error"] == metrics["setpoints"][0]["final_error_max"]
    assert 0.0 < row["along"] == metrics["path"]["joint_pd_controller"]["largest_error"]
    assert list(Path(match[1]).glob("*.bag")) and (Path(match[1]) / "report.html").is_file()


def test_a_sweep_that_was_cut_off_goes_on_to_the_same_table(tmp_path: Path) -> None:
    whole = folder_of(sweep(tmp_path, written(tmp_path)))
    expected = sweep_folder.results_sha256(table.read(whole))
    journal = whole / "runs.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join(lines[:3]) + lines[3][:20])  # the machine went off within a line
    (whole / "runs.parquet").unlink()
    sweep(tmp_path, "--resume", whole)
    assert sweep_folder.results_sha256(table.read(whole)) == expected
    again = journal.read_bytes().splitlines(keepends=True)
    assert again[:3] == lines[:3] and len(again) == 6


def test_a_sweep_is_not_gone_on_with_by_other_code(tmp_path: Path) -> None:
    folder = folder_of(sweep(tmp_path, written(tmp_path, runs=1)))
    path = folder / "sweep.yaml"
    path.write_text(path.read_text().replace(f"code: {task.code_version()}", f"code: {'f' * 64}"))
    assert "code version" in sweep(tmp_path, "--resume", folder, code=2)


def test_a_benchmark_is_resumed_by_the_command_sweep_too(tmp_path: Path) -> None:
    folder = tmp_path / "of other code"
    folder.mkdir()
    (folder / "benchmark.yaml").write_text(f"code: {'f' * 64}\n")
    with pytest.raises(HricError, match="started with code ffffffffffff, but this is code"):
        perform(["sweep", "--resume", str(folder), "--jobs", "1"])


def test_five_mistakes_are_told_at_once(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        vary={"kp": {"paths": ["parameters.nobody.kp"], "distribution": {"kind": "uniform", "low": 4, "high": 8}}},
        outputs={"error": {"path": "setpoint.0.final_error_max"}},
        exceedance={"output": "force", "above": 1.0},
        timeout=-1,
        worker=3,
    )
    with pytest.raises(HricError) as caught:
        definition.load(str(path))
    told = str(caught.value).splitlines()
    assert told[0] == "sweep gains: 5 mistakes"
    for line in ("'worker'", "parameters.nobody.kp", "'setpoint'", "'force'", "timeout is -1"):
        assert any(line in one for one in told), (line, told)
    printed = sweep(tmp_path, path, code=2)
    assert "sweep gains: 5 mistakes" in printed and "Traceback" not in printed
    assert not (tmp_path / "runs").exists()  # nothing was begun


def test_an_output_that_a_run_has_not_is_a_failure_of_that_run(tmp_path: Path) -> None:
    plan = definition.load(str(written(tmp_path, outputs={"peak": {"path": "joints.*.nothing"}})))
    response = task.run(plan.task(0, {"kp": 50.0}, "code"))
    assert response.outputs == {"peak": None} and "velocity_peak" in response.failure


def test_a_journal_belongs_to_one_sweep_at_a_time(tmp_path: Path) -> None:
    with Journal(tmp_path) as journal:
        journal.append([RunResponse("a", 0, {})])
        with pytest.raises(JournalError, match="another program"):
            Journal(tmp_path)
    with Journal(tmp_path) as journal:
        assert journal.entries == [RunResponse("a", 0, {})]


def test_a_full_disk_is_told_and_loses_nothing(tmp_path: Path) -> None:
    (tmp_path / "runs.jsonl").symlink_to("/dev/full")
    with (
        Journal(tmp_path) as journal,
        pytest.raises(JournalError, match=r"No space left.*0 finished runs are stored") as caught,
    ):
        journal.append([RunResponse("a", 0, {})])
    assert caught.value.exit_code == 3


def test_a_sweep_on_a_full_disk_ends_with_exit_code_3_and_goes_on_when_there_is_space(tmp_path: Path) -> None:
    whole = folder_of(sweep(tmp_path, written(tmp_path, runs=2)))
    expected, journal = sweep_folder.results_sha256(table.read(whole)), whole / "runs.jsonl"
    kept = journal.read_bytes().splitlines(keepends=True)
    journal.unlink()
    journal.symlink_to("/dev/full")
    printed = sweep(tmp_path, "--resume", whole, code=3)
    assert "No space left on device" in printed and f"--resume {whole}" in printed and "Traceback" not in printed
    journal.unlink()
    journal.write_bytes(kept[0])
    sweep(tmp_path, "--resume", whole)
    assert sweep_folder.results_sha256(table.read(whole)) == expected


def test_the_example_of_a_sweep_file_is_one(tmp_path: Path) -> None:
    path = tmp_path / "example.yaml"
    path.write_text(EXAMPLE)
    assert definition.load(str(path)).section.runs == 100


def test_parquet_keeps_the_definition(tmp_path: Path) -> None:
    plan = definition.load(str(written(tmp_path)))
    path = table.write(tmp_path, plan, [], None)
    meta = json.loads(pyarrow.parquet.read_schema(path).metadata[b"hric"])
    assert meta["sweep"] == plan.content and meta["estimate"] is None
