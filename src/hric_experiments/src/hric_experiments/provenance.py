"""What ran: versions, revision and arguments, without names of the machine, its user or his folders."""

from __future__ import annotations

import contextlib
import os
import platform
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from hric_experiments import config
from mocap_natnet.trial import PROGRAM as RECORDED

DISTRIBUTIONS = ("numpy", "pybullet", "opensim", "panda-python", "pylibfranka", "scipy", "xacro", "rosbags", "matplotlib")
ROS_PACKAGES = ("rospy", "rosbag", "roslaunch", "kdl_parser")
HRIC_PACKAGES = (
    "hric_control",
    "hric_controllers",
    "hric_experiments",
    "hric_perception",
    "mocap_natnet",
    "franka_hw_interface",
    "franka_real",
    "franka_sim",
    "opensim_ros_control",
    "pybullet_ros_control",
    "urdf_to_osim",
    "panda_description",
    "hric_msgs",
)
NOT_RECORDED = ("robot_description", "roslaunch", "run_id", "rosdistro", "rosversion")
"""Parameters of the master that are no settings of the run, or that name the machine."""


def versions() -> dict[str, str]:
    """Versions of what a result depends on; a package that is not installed is left out."""
    result = {"python": platform.python_version()}
    for name in DISTRIBUTIONS:
        try:
            result[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return {**result, **_ros_versions()}


def _ros_versions() -> dict[str, str]:
    import rospkg

    pack = rospkg.RosPack()
    result = {}
    for name in (*ROS_PACKAGES, *HRIC_PACKAGES):
        with contextlib.suppress(rospkg.ResourceNotFound):
            result[name] = ElementTree.parse(Path(pack.get_path(name)) / "package.xml").findtext("version", "").strip()
    return result


def revision(folder: Path | None = None) -> dict[str, Any] | None:
    """Git commit of the workspace and whether files differ from it; None when it is not under git."""
    folder = folder or config.package_path()
    commit = _git(folder, "rev-parse", "HEAD")
    if commit is None:
        return None
    changes = _git(folder, "status", "--porcelain", "--untracked-files=no")
    return {"commit": commit, "dirty": bool(changes)}


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=10, check=False)
    except (FileNotFoundError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def platform_info() -> dict[str, Any]:
    """Kind of machine, without its name."""
    return {"system": platform.system(), "machine": platform.machine(), "cores": os.cpu_count(), "byte_order": sys.byteorder}


def neutral(value: Any) -> Any:
    """The same data with the workspace's folder written as $HRIC_WS and the home folder as ~; of a recorded trial the file's name alone."""
    if isinstance(value, str):
        for folder, name in _folders():
            value = value.replace(folder, name)
        return value
    if isinstance(value, Mapping):
        return {str(key): neutral(item) for key, item in _without_folder(value).items()}
    if isinstance(value, list | tuple):
        return [neutral(item) for item in value]
    return value


def _folders() -> list[tuple[str, str]]:
    workspace = os.environ.get("HRIC_WS") or str(config.package_path().parents[1])
    home = os.path.expanduser("~")
    return [(workspace, "$HRIC_WS")] + ([(home, "~")] if home not in ("/", "~") else [])


def _without_folder(values: Mapping[str, Any]) -> dict[str, Any]:
    """A program that replays a trial, without the folder of its file."""
    path = values.get("path")
    return {**values, "path": Path(path).name} if values.get("program") == RECORDED and isinstance(path, str) else dict(values)


def parameters(tree: Mapping[str, Any]) -> dict[str, Any]:
    """A parameter tree without descriptions, bookkeeping of ROS and names of the machine; of a recorded trial the file's name alone."""
    kept = {key: value for key, value in tree.items() if key not in NOT_RECORDED}
    kept = _without_folder(kept)
    return {key: parameters(value) if isinstance(value, Mapping) else neutral(value) for key, value in kept.items()}
