"""Provenance of a run for run.yaml: versions, git revision, arguments; without names of machine, user and folders."""

import contextlib
import math
import os
import platform
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from hric_bags import run_folder
from hric_bags.run_file import RunFile
from hric_control.limits import load_limits
from hric_core import plugins
from hric_core.node import Node
from hric_core.trial.c3d import PROGRAMS as RECORDED
from hric_core.trial.description import replayed_trials
from hric_core.urdf import ONE_COORDINATE, read
from hric_run.definition.experiment import Experiment, package_path, to_dict

DISTRIBUTIONS = (
    "numpy",
    "panda-python",
    "pylibfranka",
    "scipy",
    "xacro",
    "rosbags",
    "matplotlib",
)
ROS_PACKAGES = ("rospy", "rosbag", "roslaunch", "kdl_parser")
HRIC_PACKAGES = (
    *("hric_core", "hric_dynamics", "hric_control", "hric_controllers", "hric_human", "hric_motion"),
    *("hric_assessment", "hric_perception", "hric_bags", "hric_run", "hric_analysis", "hric_report", "hric_sweep"),
    *("hric_supervisor", "hric_measurements", "hric_gym", "hric_msgs", "hric_experiments", "mocap_natnet"),
    *("franka_hw_interface", "franka_real", "franka_sim", "ur_robot", "urdf_to_osim", "panda_description"),
)
NOT_RECORDED = ("robot_description", "roslaunch", "run_id", "rosdistro", "rosversion")
"""Names of parameters on the parameter server that are not recorded: they are no settings, or name the machine."""


def head(
    folder: run_folder.RunFolder,
    definition: Experiment,
    overrides: Sequence[str],
    tree: Mapping[str, object],
    entries: RunFile,
) -> RunFile:
    """Return the contents of run.yaml at the start of a run.

    Args:
        folder: run folder.
        definition: experiment of the run.
        overrides: overrides of the experiment on the command line.
        tree: all parameters of the run.
        entries: further keys, which differ between live and headless runs.
    """
    code_versions, code_revision = _code()
    values, trials = replayed_trials(to_dict(definition))
    return {
        "experiment": definition.name,
        "description": definition.description,
        **entries,
        "status": run_folder.RUNNING,
        "started": run_folder.iso_now(),
        "finished": None,
        "arguments": neutral(list(overrides)),
        "bag": folder.bag_path.name,
        "definition": neutral(values),
        **({"trials": trials} if trials else {}),
        "parameters": parameters(tree),
        "versions": code_versions,
        "revision": code_revision,
        "platform": platform_info(),
    }


@cache
def _code() -> tuple[dict[str, str], dict[str, str | bool] | None]:
    """Return versions and git revision; they are read once per process, when the code is loaded."""
    return versions(), revision()


def versions() -> dict[str, str]:
    """Return the versions of the software on which results depend, by name; packages not installed are left out."""
    import rospkg

    result = {"python": platform.python_version()}
    folders = dict.fromkeys([*plugins.packages_path().split(os.pathsep), *rospkg.get_ros_paths()])
    pack = rospkg.RosPack(list(folders))
    engines = plugins.engines()
    for name in (*DISTRIBUTIONS, *engines):
        with contextlib.suppress(metadata.PackageNotFoundError):
            result[name] = metadata.version(name)
    for name in (*ROS_PACKAGES, *HRIC_PACKAGES, *(info.package for info in engines.values())):
        with contextlib.suppress(rospkg.ResourceNotFound):
            result[name] = ElementTree.parse(Path(pack.get_path(name)) / "package.xml").findtext("version", "").strip()
    return result


def revision(folder: Path | None = None) -> dict[str, str | bool] | None:
    """Return the workspace's git commit, and as `dirty` True if tracked files differ from it; None without git."""
    folder = folder or package_path()
    if (commit := _git(folder, "rev-parse", "HEAD")) is None:
        return None
    return {"commit": commit, "dirty": bool(_git(folder, "status", "--porcelain", "--untracked-files=no"))}


def _git(folder: Path, *arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=10, check=False
        )
    except (FileNotFoundError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def platform_info() -> dict[str, str | int | None]:
    """Return operating system, processor type, number of cores and byte order of this machine."""
    return {
        "system": platform.system(),
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        "byte_order": sys.byteorder,
    }


def neutral(value: Any) -> Any:
    """Return data in which the workspace folder is replaced by $HRIC_WS and the home folder by ~.

    The path of a recorded trial is replaced by the name of the file.
    """
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
    workspace = str(run_folder.workspace())
    home = os.path.expanduser("~")
    return [(workspace, "$HRIC_WS")] + ([(home, "~")] if home not in ("/", "~") else [])


def _without_folder(values: Mapping[str, object]) -> dict[str, object]:
    """Return a mapping; if its `program` replays a recorded file, `path` is replaced by the name of the file."""
    path = values.get("path")
    return (
        {**values, "path": Path(path).name}
        if values.get("program") in RECORDED and isinstance(path, str)
        else dict(values)
    )


def parameters(tree: Mapping[str, object]) -> dict[str, object]:
    """Return a parameter tree without URDFs, ROS's own parameters and names of the machine.

    The path of a recorded trial is replaced by the name of the file.
    """
    recorded = _without_folder({key: value for key, value in tree.items() if key not in NOT_RECORDED})
    return {key: parameters(value) if isinstance(value, Mapping) else neutral(value) for key, value in recorded.items()}


FIELDS = ("lower", "upper", "velocity", "effort", "effort_rate")


def joint_limits(
    urdf_xml: str, node: Node | None, joint_names: Sequence[str] | None = None
) -> dict[str, dict[str, float]]:
    """Return the limits per joint, from the URDF and the `joint_limits` parameters of the robot.

    Args:
        urdf_xml: URDF of the robot.
        node: node of the robot's namespace; None: only the limits in the URDF are used.
        joint_names: names of joints; None: all joints that move independently.

    Returns:
        By joint name the finite ones of lower, upper [rad], velocity [rad/s], effort [N m], effort_rate [N m/s].
    """
    if joint_names is None:
        joints = read(urdf_xml).joints.values()
        joint_names = [joint.name for joint in joints if joint.type in ONE_COORDINATE and joint.mimic is None]
    return {
        limits.name: {field: value for field in FIELDS if math.isfinite(value := float(getattr(limits, field)))}
        for limits in (load_limits(urdf_xml, node, joint_names) if joint_names else ())
    }
