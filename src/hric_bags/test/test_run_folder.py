"""Run folders and files that are whole or absent."""

import json
from datetime import datetime
from pathlib import Path

import pytest

from hric_bags import files
from hric_bags.run_folder import RunFolder, RunFolderError, runs_root

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
