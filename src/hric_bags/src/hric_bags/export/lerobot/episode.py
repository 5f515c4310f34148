"""Episode of a LeRobot data set: signals of one run at an even rate."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hric_bags import run_notes
from hric_bags.export import batches
from hric_bags.export.resampling import ALMOST, SampledTopic
from hric_bags.export.table import ExportError, FloatArray, TopicTable
from hric_bags.reader import FRANKA_TYPE
from hric_bags.records.one_publisher import JOINTS
from hric_bags.records.recording import STATES_TYPE
from hric_bags.run_file import RunFile

NEEDED = (batches.CONTROL_LOG, FRANKA_TYPE, STATES_TYPE)
"""Message types from which an episode is made."""
ACTION = "action"
"""Name of the feature with the commands."""
OF_LOG = {
    "observation.state": "position",
    "observation.velocity": "velocity",
    "observation.effort": "effort",
    ACTION: "command",
}
"""Name of a feature -> columns of the control log."""
WRENCH = tuple(f"O_F_ext_hat_K.{k}" for k in range(6))
"""Columns of FrankaState with the feature observation.wrench."""
STATE_TOPIC = "/franka_state_controller/franka_states"
"""End of the topic with the state of an arm, after the name of the arm if there are several."""
WRENCH_NAMES, WRENCH_UNITS = ("fx", "fy", "fz", "tx", "ty", "tz"), ("N", "N", "N", "N m", "N m", "N m")
UNKNOWN = "task not known"
"""Task of a run without description and experiment."""


@dataclass(frozen=True)
class Feature:
    """Signals of an episode over its n frames.

    Attributes:
        names: names of the k signals.
        units: units of the signals.
        values: values, shape (n, k).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray


@dataclass(frozen=True)
class RunEpisode:
    """Signals of one run.

    Attributes:
        task: description of the experiment.
        robot: name of the robot.
        features: signals by the name of the feature, all with the same number of frames.
        notes: how the values were obtained, one sentence each.
    """

    task: str
    robot: str
    features: Mapping[str, Feature]
    notes: tuple[str, ...]

    @property
    def length(self) -> int:
        """Number of frames."""
        return len(self.features["observation.state"].values)


def of_run(tables: Mapping[str, TopicTable], run: RunFile, rate: float) -> RunEpisode:
    """Return the episode of a run; frames begin at a control cycle, and end where any of the signals ends.

    Args:
        tables: tables of the run by topic.
        run: contents of run.yaml; may be empty.
        rate: frames per second, the rate of the control log divided by a whole number [Hz].

    Raises:
        ExportError: there is no control log, or its rate is not a multiple of `rate`.
    """
    logs = [table for table in tables.values() if table.type_name == batches.CONTROL_LOG]
    if len(logs) != 1 or len(logs[0].time) < 2:
        raise ExportError(f"format lerobot needs one control log of two samples or more; the bag has {len(logs)}")
    sources = {name: (logs[0], of_log) for name, of_log in _columns_of_log(logs[0]).items()}
    commanded = _commanded(logs[0])
    if commanded is None:
        del sources[ACTION]
    arms = [
        table
        for table in tables.values()
        if table.type_name == FRANKA_TYPE and {*WRENCH} <= {one.name for one in table.columns} and len(table.time) > 1
    ]
    for table in arms:
        arm = f".{table.topic.strip('/').removesuffix(STATE_TOPIC).replace('/', '.')}" if len(arms) > 1 else ""
        sources[f"observation.wrench{arm}"] = table, list(WRENCH)
    for table in tables.values():
        columns = [column.name for column in table.columns]
        joints = [name for name in columns if name.startswith("position.")]
        if table.type_name == STATES_TYPE and JOINTS & {name.partition(".")[2] for name in joints}:
            sources[_name_of_person(table.topic)] = table, joints
    topics = {table.topic: SampledTopic(table) for table, _ in sources.values()}
    times = _grid(list(topics.values()), topics[logs[0].topic], rate, commanded)
    features = {
        name: _feature(name, topics[table.topic], table, columns, times) for name, (table, columns) in sources.items()
    }
    task = str(run.get("description") or run.get("experiment") or UNKNOWN)
    robot = (run.get("definition") or {}).get("robot") or {}
    missing = [] if arms else ["no observation.wrench: the bag has no franka_msgs/FrankaState"]
    missing += [] if commanded else ["no action: the joints have no commands of one unit"]
    added = [f"note: {note}" for note in run_notes.of_table(tables)]
    notes = (*(topic.how_old(times) for topic in topics.values()), *logs[0].notes, *missing, *added)
    return RunEpisode(task, str(robot.get("arm_id") or "unknown"), features, notes)


def _commanded(log: TopicTable) -> tuple[float, float] | None:
    """Return the first and last time with commands to all joints [s]; None: one has none, or of several units."""
    columns = [column for column in log.columns if column.name.startswith("command.")]
    rows = np.flatnonzero(np.isfinite([column.values for column in columns]).all(axis=0))
    known = all(column.unit for column in columns) and len(rows)
    return (float(log.time[rows[0]]), float(log.time[rows[-1]])) if known else None


def _columns_of_log(log: TopicTable) -> dict[str, list[str]]:
    joints = list(log.below("position"))
    return {name: [f"{field}.{joint}" for joint in joints] for name, field in OF_LOG.items()}


def _name_of_person(topic: str) -> str:
    """Return the name of the feature with the joint positions of a person, e.g. "observation.human"."""
    return f"observation.{topic.strip('/').removeprefix('hric/').rpartition('/')[0].replace('/', '.') or 'person'}"


def _feature(name: str, topic: SampledTopic, table: TopicTable, columns: list[str], times: FloatArray) -> Feature:
    values = topic.newest(columns, times)
    if len(wrong := np.argwhere(~np.isfinite(values))):
        row, column = wrong[0]
        other = "" if name == ACTION else f"; leave the topic {table.topic} out by --topics"
        raise ExportError(
            f"format lerobot: {columns[column]} of {name} is not known (NaN) at {times[row]:.3f} s; valid: known "
            f"values in every frame{other}"
        )
    if tuple(columns) == WRENCH:
        return Feature(WRENCH_NAMES, WRENCH_UNITS, values)
    units = {column.name: column.unit for column in table.columns}
    names = [column.partition(".")[2] for column in columns]
    return Feature(tuple(names), tuple(units[column] for column in columns), values)


def _grid(
    topics: list[SampledTopic], log: SampledTopic, rate: float, commanded: tuple[float, float] | None
) -> FloatArray:
    """Return the times of the frames, shape (n,) [s]; commanded: first and last time with commands."""
    step = log.rate / rate
    if abs(step - round(step)) > ALMOST or round(step) < 1:
        whole = [log.rate / k for k in (1, 2, 4, 5, 10, 20, 50, 100)]
        valid = ", ".join(f"{value:g}" for value in whole if abs(value - round(value)) < ALMOST)
        raise ExportError(f"--rate {rate:g}: valid: {log.rate:g} Hz of the control log over a whole number: {valid}")
    spans = [(topic.time[0], topic.time[-1]) for topic in topics] + [commanded or (log.time[0], log.time[-1])]
    first_row = int(np.searchsorted(log.time, max(first for first, _ in spans) - ALMOST / log.rate))
    begin = log.time[min(first_row, len(log.time) - 1)]
    end = min(last for _, last in spans)
    count = int(np.floor((end - begin) * rate + ALMOST)) + 1
    if count < 2:
        raise ExportError(f"the signals have {max(end - begin, 0.0):.3f} s in common; valid: at least two frames")
    return np.asarray(begin + np.arange(count) / rate)
