"""Provenance of a run: parameters, versions, revision."""

from pathlib import Path

import pytest

from hric_run import provenance


def test_what_is_recorded_names_no_folder_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HRIC_WS", "/home/someone/ws")
    monkeypatch.setenv("HOME", "/home/someone")
    tree = {
        "a": ["/home/someone/ws/src/x.urdf"],
        "roslaunch": {"uris": {"host_pc__1": "http://pc:1"}},
        "b": {"robot_description": "<robot/>", "c": "/home/someone/x"},
    }
    assert provenance.parameters(tree) == {"a": ["$HRIC_WS/src/x.urdf"], "b": {"c": "~/x"}}


def test_versions_name_python_the_libraries_ros_and_our_packages() -> None:
    found = provenance.versions()
    assert {"python", "numpy", "pybullet", "rospy", "hric_experiments"} <= set(found)
    assert all(isinstance(version, str) and version for version in found.values())


def test_versions_name_every_package_with_python_of_a_run() -> None:
    sources = Path(__file__).parents[2]
    ours = {path.parent.name for path in sources.glob("*/src/*/__init__.py")}
    without = {"controller_manager", "hric_skin", "hric_view"}  # tools, and what only shows
    assert ours - without <= set(provenance.versions())


def test_the_revision_is_a_commit_or_nothing(tmp_path: Path) -> None:
    assert provenance.revision(tmp_path) is None
    found = provenance.revision()
    assert found is None or (len(found["commit"]) == 40 and isinstance(found["dirty"], bool))
