"""Run folders, and files that are either complete or absent."""

import errno
import json
import re
import signal
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import pytest
import yaml

from hric_bags import files
from hric_bags.run_file import held_mass
from hric_bags.run_folder import GONE, RunFolder, RunFolderError, runs_root

NOW = datetime(2024, 5, 6, 7, 8, 9)


def test_the_folder_the_bag_and_from_its_recording_on_latest_carry_experiment_and_date(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "runs", "pd_step", NOW)
    assert not (tmp_path / "runs" / "latest").exists()
    folder.become_latest()
    assert folder.path == tmp_path / "runs" / "pd_step_20240506-070809"
    assert folder.bag_path.name == "pd_step_20240506-070809.bag"
    assert (tmp_path / "runs" / "latest").resolve() == folder.path


def test_two_runs_in_one_second_get_two_folders(tmp_path: Path) -> None:
    RunFolder.create(tmp_path, "a", NOW)
    assert RunFolder.create(tmp_path, "a", NOW).path.name == "a_20240506-070809-2"


def test_a_run_is_found_by_path_name_and_latest(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "a", NOW)
    folder.write({"experiment": "a"})
    folder.update(status="completed")
    folder.become_latest()
    for given in (str(folder.path), folder.path.name, "latest"):
        assert RunFolder.open(given, tmp_path).read() == {"experiment": "a", "status": "completed"}


def test_the_writer_of_a_run_reads_what_everybody_reads(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "a", NOW)
    odd = {
        "texts": ("1e3", "yes", "a: b\n ü", "2024-05-06"),
        "numbers": [1, 1.0, 1e-9, -0.0, float("inf")],
        "of": {2: None},
    }
    folder.write({"experiment": "a", "status": "running", "parameters": odd})
    folder.update(status="completed", real_time_factor=2.5)
    assert repr(folder.read()) == repr(RunFolder.open(folder.path).read())
    folder.read()["parameters"]["texts"] = "changed"  # type: ignore[typeddict-item]
    assert repr(folder.read()) == repr(RunFolder.open(folder.path).read())
    RunFolder.open(folder.path).update(status="interrupted")
    assert folder.read()["status"] == "interrupted"


@pytest.mark.parametrize(
    ("arms", "mass"),
    [
        ({"left": {"robot": {"load": {"com": [0, 0, 0.1]}}}, "right": {"robot": {"load": {"com": [0, 0.1, 0]}}}}, 2.0),
        ({"left": {"robot": {"load": {"mass": 1.0}}}, "right": {"robot": {"load": {"mass": 0.5}}}}, 1.0),
        ({"left": {"robot": {"plant": {"payload": {"mass": 3.0}}}}, "right": {}}, 3.0),
        ({"left": {"robot": {"plant": {"payload": [{"mass": 1.0}, {"mass": 3.0}]}}}, "right": {}}, 4.0),
        ({}, 2.0),
    ],
)
def test_the_heaviest_load_or_payload_of_the_arms_counts(arms: dict[str, dict[str, object]], mass: float) -> None:
    assert held_mass({"robot": {"load": {"mass": 2.0}, "plant": {}}, "arms": arms}) == mass


def write_and_die(root: Path, number: int) -> Path:
    """Create a run whose process is ended by signal `number` while it runs; return its folder."""
    code = (
        "import os, sys; from pathlib import Path; from hric_bags.run_folder import RunFolder\n"
        "folder = RunFolder.create(Path(sys.argv[1]), 'a'); folder.write({'status': 'running', 'seed': 4})\n"
        "print(folder.path, flush=True); os.kill(os.getpid(), int(sys.argv[2]))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(root), str(number)], capture_output=True, text=True)
    assert done.returncode == -number, done.stderr
    return Path(done.stdout.strip())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSEGV])
def test_a_run_whose_process_was_killed_is_interrupted_for_whoever_reads_it_next(tmp_path: Path, number: int) -> None:
    path = write_and_die(tmp_path, number)
    assert "status: running" in (path / "run.yaml").read_text()
    run = RunFolder.open(path).read()
    assert (run["status"], run["reason"], run["seed"]) == ("interrupted", GONE, 4) and run["finished"].endswith("Z")
    assert RunFolder.open(path).read() == run == yaml.safe_load((path / "run.yaml").read_text())


def test_who_knows_more_of_the_end_says_it(tmp_path: Path) -> None:
    path = write_and_die(tmp_path, signal.SIGKILL)
    assert RunFolder(path).read("robot was killed by SIGKILL")["reason"] == "robot was killed by SIGKILL"


def test_a_run_that_cannot_be_written_any_more_is_read_as_interrupted(tmp_path: Path) -> None:
    path = write_and_die(tmp_path, signal.SIGKILL)
    read = f"from hric_bags.run_folder import RunFolder as R; print(R.open('{path}').read()['status'])"
    script = 'mount --bind "$1" "$1" && mount -o remount,ro,bind "$1" && exec "$2" -c "$3"'
    command = ["unshare", "--mount", "--map-root-user", "sh", "-c", script, "-", str(path), sys.executable, read]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "interrupted\n", done.stderr
    assert "status: running" in (path / "run.yaml").read_text()


def test_a_run_that_is_being_made_stays_running_for_everybody_until_it_says_how_it_ended(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "a")
    folder.write({"status": "running"})
    folder.update(seed=4)
    assert RunFolder(folder.path).read() == folder.read() == {"status": "running", "seed": 4}
    folder.update(status="completed")
    assert RunFolder(folder.path).read()["status"] == "completed"


def test_a_failure_is_noted_also_where_there_is_no_room_for_it(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "a")
    folder.write({"status": "running"})
    with pytest.raises(files.FileError, match="No space left"), folder.filled():
        raise files.cannot_write(folder.path / "a.bag", OSError(errno.ENOSPC, "No space left on device"))
    assert folder.read()["status"] == "failed" and "cannot write" in folder.read()["error"]


def test_ctrl_c_while_a_run_is_filled_ends_it_as_interrupted(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "pd_step")
    folder.write({"status": "running"})
    with pytest.raises(KeyboardInterrupt), folder.filled():
        raise KeyboardInterrupt
    assert folder.read()["status"] == "interrupted" and "error" not in folder.read()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("definition: [1]", "definition is [1]; valid: a mapping"),
        ("definition: {human: yes}", "definition.human is True; valid: a mapping"),
        ("parameters: {robot: {plant: {time_step: fast}}}", "plant.time_step is 'fast'; valid: a number above 0"),
        ("parameters: {robot: {plant: {time_step: 0}}}", "plant.time_step is 0; valid: a number above 0"),
        ("definition: {human: {contact_area: .nan}}", "contact_area is nan; valid: a number above 0"),
    ],
)
def test_an_entry_of_another_kind_is_refused_with_its_key(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "run.yaml").write_text(text)
    with pytest.raises(RunFolderError, match=re.escape(f"run.yaml: {words}" if words[0] == "d" else words)):
        RunFolder(tmp_path).read()


@pytest.mark.parametrize("name", ["/etc/passwd", "../other/other.bag"])
def test_a_bag_outside_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(RunFolderError, match=r"run\.yaml: bag is .*; valid: name of a file in this folder"):
        RunFolder(tmp_path).bag_of({"bag": name})


def test_a_file_that_is_no_bag_is_not_called_missing(tmp_path: Path) -> None:
    (tmp_path / "cut.mcap").write_bytes(b"")
    with pytest.raises(RunFolderError, match=r"cut\.mcap is no run folder and no bag: its content is not that"):
        RunFolder.open(tmp_path / "cut.mcap", tmp_path)


def test_a_missing_run_names_those_that_exist(tmp_path: Path) -> None:
    RunFolder.create(tmp_path, "a", NOW).write({})
    with pytest.raises(RunFolderError, match=r"no run folder 'b'.*a_20240506-070809$"):
        RunFolder.open("b", tmp_path)


def test_a_root_that_cannot_be_written_is_refused_without_a_traceback(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RunFolderError, match=r"cannot make a run folder in .*file"):
        RunFolder.create(tmp_path / "file", "a")


def test_the_root_is_the_given_one_then_the_environment_then_the_workspace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HRIC_RUNS", str(tmp_path / "env"))
    assert runs_root(str(tmp_path / "given")) == tmp_path / "given"
    assert runs_root() == tmp_path / "env"
    monkeypatch.delenv("HRIC_RUNS")
    monkeypatch.setenv("HRIC_WS", str(tmp_path / "ws"))
    assert runs_root() == tmp_path / "ws" / "runs"


def test_a_file_that_cannot_be_written_leaves_the_old_one_and_no_rest(tmp_path: Path) -> None:
    path = tmp_path / "metrics.json"
    files.write_json(path, {"a": 1.0})
    with pytest.raises(ValueError, match="JSON"):
        files.write_json(path, {"a": float("nan")})
    with pytest.raises(TypeError):
        files.write_text(path, 3)  # type: ignore[arg-type]
    assert json.loads(path.read_text()) == {"a": 1.0}
    assert list(tmp_path.iterdir()) == [path]
