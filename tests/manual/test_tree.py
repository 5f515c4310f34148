"""Restoration of the workspace after a page of the manual, without loss of existing files."""

import subprocess
from pathlib import Path

import pytest
from manual_tree import TreeError, kept_clean


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    root = tmp_path / "clone"
    (root / "src/robot").mkdir(parents=True)
    (root / "src/robot/arm.py").write_text("joints = 7\n")
    (root / ".gitignore").write_text("/runs/\n/build/\n")
    run = ["git", "-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], ["commit", "-qm", "begin"]):
        subprocess.run([*run, *command], cwd=root, check=True)
    for name in ("old", "older"):
        (root / "runs" / name).mkdir(parents=True)
    (root / "runs/latest").symlink_to("old")
    (root / "mine.txt").write_text("notes\n")
    return root


def test_what_a_page_makes_is_moved_away_and_the_rest_stays(clone: Path, tmp_path: Path) -> None:
    with kept_clean(clone, tmp_path / "kept"):
        (clone / "src/my_controller/src").mkdir(parents=True)
        (clone / "src/my_controller/src/law.py").write_text("")
        (clone / "panda.urdf").write_text("")
        (clone / "build").mkdir()
    assert (tmp_path / "kept/src/my_controller/src/law.py").exists()
    assert (tmp_path / "kept/panda.urdf").exists()
    assert sorted(entry.name for entry in (clone / "src").iterdir()) == ["robot"]
    assert (clone / "mine.txt").exists()
    assert (clone / "build").exists()


def test_new_runs_are_moved_away_and_the_latest_is_again_the_one_before(clone: Path, tmp_path: Path) -> None:
    with kept_clean(clone, tmp_path / "kept"):
        (clone / "runs/new").mkdir()
        (clone / "runs/latest").unlink()
        (clone / "runs/latest").symlink_to("new")
    assert (tmp_path / "kept/runs/new").is_dir()
    assert sorted(entry.name for entry in (clone / "runs").iterdir()) == ["latest", "old", "older"]
    assert (clone / "runs/latest").readlink() == Path("old")


def test_a_page_that_fails_leaves_no_more_than_one_that_passes(clone: Path, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), kept_clean(clone, tmp_path / "kept"):
        (clone / "my_study").mkdir()
        (clone / "my_study/a.yaml").write_text("")
        raise ZeroDivisionError
    assert not (clone / "my_study").exists()


def test_a_page_does_not_begin_where_its_files_are_already(clone: Path, tmp_path: Path) -> None:
    (clone / "scene.yaml").write_text("of the user")
    with pytest.raises(TreeError, match=r"move away first: scene\.yaml"), kept_clean(clone, tmp_path, ["scene.yaml"]):
        pytest.fail("it began")
    assert (clone / "scene.yaml").read_text() == "of the user"


def test_a_page_that_changes_a_file_of_the_workspace_is_an_error_that_names_it(clone: Path, tmp_path: Path) -> None:
    with pytest.raises(TreeError, match=r"src/robot/arm\.py"), kept_clean(clone, tmp_path / "kept"):
        (clone / "src/robot/arm.py").write_text("joints = 6\n")
