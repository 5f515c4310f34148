"""Reader of the joint positions of an episode in a LeRobot data set, version 2 or 3."""

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet

from hric_bags import foreign
from hric_core.errors import HricError
from hric_core.parameters import number
from hric_experiments.episode.replay import FloatArray, JointPositions

STATE = "observation.state"
"""Name of the feature with the measured state of the robot in LeRobot data sets."""
ARM = 7
"""Number of joints of a Panda."""
LARGEST = 2.0 * np.pi
"""Largest accepted absolute joint position [rad]; larger values are degrees or other quantities (project default)."""
FPS = number(minimum=0.1, maximum=1000.0, unit="Hz")
"""Accepted rate of frames; project default, unconfirmed."""
TOLERANCE = 0.25
"""Largest accepted deviation of a frame from even times, relative to the time between frames [1] (project default)."""
SETTLING = 1.0
"""Time of an experiment after the end of the trajectory [s]; project default, unconfirmed."""
START = 0.5
"""Robot time at which the trajectory starts [s]; project default, unconfirmed."""
CONTROLLER = "position_joint_trajectory_controller"
PANDA = re.compile("panda|franka|fr3", re.IGNORECASE)
"""Pattern of a type of robot with the kinematics of the Panda."""
_JOINT = re.compile(r"(?:^|[^a-z])(?:joint|j|q)_?(\d)(?:\.pos(?:ition)?)?$")
"""Pattern of a signal's name that is a joint position: it ends with joint, j or q and a number."""
_OTHER = re.compile("vel|acc|tau|torque|effort|force|delta")
"""Pattern in the name of a feature or signal that is another quantity of a joint."""


@dataclass(frozen=True)
class DatasetEpisode:
    """Episode of a data set.

    Attributes:
        task: description of the task; "": not known.
        motion: joint positions of the arm.
        rate: frames per second [Hz].
        robot: type of the robot, as the data set has it; "": not known.
    """

    task: str
    motion: JointPositions
    rate: float
    robot: str

    def experiment(self, name: str, trajectory: str) -> dict[str, object]:
        """Return the contents of an experiment file that replays the episode.

        Args:
            name: name of the episode.
            trajectory: name of the file next to it with the joint positions.
        """
        return {
            "description": f"{name}: {self.task}".rstrip(": "),
            "robot": {
                "hw": "franka_sim/FrankaHWSim",
                "arm_id": "panda",
                "q_start": [float(q) for q in self.motion.positions[0]],
            },
            "controllers": ["joint_state_controller", "franka_state_controller", CONTROLLER],
            "replay": {"trajectory_file": trajectory, "controller": CONTROLLER, "at": START},
            "duration": round(START + float(self.motion.time[-1]) + SETTLING, 3),
        }


def read(
    dataset: Path, number: int, joints: Sequence[str], feature: str = STATE, signals: Sequence[str] = ()
) -> DatasetEpisode:
    """Read the joint positions of an episode.

    Args:
        dataset: folder of the data set, with meta/info.json.
        number: number of the episode.
        joints: names of the robot's joints.
        feature: feature with the joint positions [rad].
        signals: names or indices of the signals in the feature, one per joint in order; empty: the signals whose names
            end with joint, j or q and a number.

    Raises:
        HricError: there is no such data set, episode or feature, or its values cannot be joint positions.
    """
    try:
        return _read(dataset, number, joints, feature, signals)
    except HricError:
        raise
    except Exception as error:  # a file of other programs may raise any error
        text = " ".join(str(error).split())[:200]
        known = not isinstance(error, KeyError)
        reason = f"{type(error).__name__}: {text}" if known else f"{text} is missing or not known"
        raise HricError(f"{dataset} is not a LeRobot data set of version 2 or 3: {reason}") from error


def _read(dataset: Path, number: int, joints: Sequence[str], feature: str, signals: Sequence[str]) -> DatasetEpisode:
    info = json.loads((dataset / "meta" / "info.json").read_text())
    if not re.match(r"v[23]\.", version := str(info["codebase_version"])):
        raise HricError(f"{dataset.name} has version {version}; valid: LeRobot data sets of version 2 or 3")
    fps, about = FPS.checked(info["fps"], f"{dataset.name}: fps"), info["features"]
    numeric = sorted(name for name in about if str(about[name].get("dtype")).startswith("float"))
    if feature not in numeric:
        raise HricError(f"no feature {feature!r} in {dataset.name}; valid: {', '.join(numeric) or 'none'}")
    columns = _columns(_flat(about[feature], feature), about[feature]["shape"], signals, len(joints), feature)
    table = _table(dataset / _file(dataset, info, number), number, feature)
    values = _values(table, feature, about[feature]["shape"])[:, columns]
    wrong_rows = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(values) < 2 or len(wrong_rows):
        which = f", and frame {wrong_rows[0]} is not finite" if len(wrong_rows) else ""
        raise HricError(
            f"episode {number} of {dataset.name} has {len(values)} frames{which}; valid: at least 2, all finite"
        )
    units = about[feature].get("units")  # hric export writes them, LeRobot does not
    width = int(np.prod(about[feature]["shape"]))
    if units and (not isinstance(units, list) or len(units) != width):
        raise HricError(f"{feature} has the units {units}; valid: a list with {width}, or none")
    wrong = next((f" {units[column]}" for column in columns if units[column] != "rad"), "") if units else ""
    if np.abs(values).max() > LARGEST or wrong:
        raise HricError(
            f"{feature} reaches {np.abs(values).max():.4g}{wrong}; valid: joint positions in rad, from {-LARGEST:.4g} "
            f"to {LARGEST:.4g}; are these degrees, or no joint positions?"
        )
    _check_times(table, fps, f"episode {number} of {dataset.name}")
    time = np.arange(len(values)) / fps
    robot = str(info.get("robot_type") or "")
    return DatasetEpisode(_task(dataset, table), JointPositions(tuple(joints), time, values), fps, robot)


def _values(table: Any, feature: str, shape: Sequence[int]) -> FloatArray:
    """Return the values of a feature, shape (frames, signals). Raises HricError if a frame has not all signals."""
    rows, width = table[feature].to_pylist(), int(np.prod(shape))
    if different := {np.size(row) for row in rows} - {width}:
        raise HricError(f"{feature} has a frame with {min(different)} values; valid: {width}, by its shape")
    return np.array(rows, dtype=float).reshape(len(rows), width)


def _check_times(table: Any, fps: float, where: str) -> None:
    """Raise HricError if frames are missing, repeated, or not at even times; where: name of the episode."""
    for name, rate in (("index", 1.0), ("frame_index", 1.0), ("timestamp", fps)):
        if name in table.column_names:
            times = np.array(table[name].to_pylist(), dtype=float)
            late = rate * (times - times[0]) - np.arange(len(times))
            if len(wrong := np.flatnonzero(~(np.abs(late) < TOLERANCE))):
                k = wrong[0]
                raise HricError(
                    f"{where}: {name} of frame {k} is {times[k]:g}; valid: {times[0] + k / rate:g}, since the frames "
                    f"are {fps:g} per second, none missing or repeated"
                )


def _file(dataset: Path, info: dict[str, Any], number: int) -> str:
    """Return the path, in the data set, of the Parquet file with the frames of an episode.

    Args:
        dataset: folder of the data set; version 3 has the path in meta/episodes.
        info: content of meta/info.json.
        number: number of the episode.
    """
    count = int(info["total_episodes"])
    if not 0 <= number < count:
        raise HricError(f"no episode {number} in {dataset.name}; valid: 0 to {count - 1}")
    keys = {"episode_index": number, "episode_chunk": number // int(info["chunks_size"])}
    paths = sorted((dataset / "meta" / "episodes").rglob("*.parquet"))
    for path in paths:
        rows = pyarrow.parquet.read_table(path, columns=["episode_index", "data/chunk_index", "data/file_index"])
        for row in rows.to_pylist():
            if row["episode_index"] == number:
                keys |= {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
    if "file_index" not in keys and (paths or "{file_index" in str(info["data_path"])):
        raise HricError(f"{dataset.name} does not list episode {number} in meta/episodes")
    return str(info["data_path"]).format(**keys)


def _table(path: Path, number: int, feature: str) -> Any:
    columns, chosen = [feature, "episode_index", "index", "task_index"], [("episode_index", "=", number)]
    try:
        present = set(pyarrow.parquet.read_schema(path).names)
        if missing := sorted(set(columns) - present):
            raise ValueError(f"no column {', '.join(missing)}")
        columns += sorted({"frame_index", "timestamp"} & present)
        return pyarrow.parquet.read_table(path, columns=columns, filters=chosen).sort_by("index")
    except (OSError, ValueError) as error:
        reason = f"cannot read {path}: {' '.join(str(error).split())[:200]}"
        raise HricError(foreign.describe(path) or reason) from error


def _flat(about: dict[str, Any], feature: str) -> list[str]:
    """Return the names of the signals of a feature; empty: the data set has no names.

    about: description of the feature in meta/info.json; older data sets have groups of names there.
    """
    names = about.get("names") or []
    groups = list(names.values()) if isinstance(names, dict) else [names]
    if not all(isinstance(group, list) for group in groups):
        raise HricError(f"{feature}: names are {str(names)!r:.80}; valid: a list of names, or groups of lists")
    return [str(name) for group in groups for name in group]


def _columns(names: list[str], shape: Sequence[int], signals: Sequence[str], count: int, feature: str) -> list[int]:
    """Return the indices of the joint positions among the signals of a feature, in the order of the joints.

    Args:
        names: names of the signals; empty: none.
        shape: shape of the feature.
        signals: names or indices that the user has given (--signals); empty: find them by name.
        count: number of joints.
        feature: name of the feature, for error messages.
    """
    width = int(np.prod(shape))
    listed = ", ".join(names) or f"{width} signals without names"
    if names and len(names) != width:  # it is not known which signal a name belongs to
        names, listed = [], f"{len(names)} names for {width} signals"
    if not signals:
        found = [(int(match[1]), k) for k, name in enumerate(names) if (match := _JOINT.search(name.lower()))]
        numbers, chosen = [key for key, _ in sorted(found)], [k for _, k in sorted(found)]
        other = any(_OTHER.search(f"{feature} {names[k]}".lower()) for k in chosen)
        if other or numbers not in (list(range(count)), list(range(1, count + 1))):
            raise HricError(
                f"{feature} has {listed}; these names do not show the {count} joints; list them in order with --signals"
            )
        return chosen
    if len(signals) != count:
        raise HricError(f"--signals has {len(signals)} signals; valid: {count}, one per joint")
    for signal in signals:
        if (same := names.count(signal)) > 1:
            raise HricError(f"{signal!r} names {same} signals of {feature}; valid: an index below {width}")
        if not same and not (signal.isdecimal() and int(signal) < width):
            raise HricError(f"no signal {signal!r} in {feature}; valid: {listed}, or an index below {width}")
    indices = [names.index(signal) if signal in names else int(signal) for signal in signals]
    if len({*indices}) < count:
        raise HricError(f"--signals names a signal twice: {', '.join(signals)}; valid: {count} different ones")
    return indices


def _task(dataset: Path, frames: Any) -> str:
    """Return the text of the task of an episode, given its frames; "": not known."""
    index, path = frames["task_index"][0].as_py(), dataset / "meta" / "tasks.parquet"
    if path.is_file():
        import pandas

        table = pandas.read_parquet(path)
        tasks = dict(zip(table["task_index"], table.get("task", table.index), strict=True))
    else:
        lines = path.with_suffix(".jsonl")
        entries = [json.loads(line) for line in lines.read_text().splitlines() if line] if lines.is_file() else []
        tasks = {entry["task_index"]: entry["task"] for entry in entries}
    text = tasks.get(index)
    return " ".join(text.split()) if isinstance(text, str) else ""
