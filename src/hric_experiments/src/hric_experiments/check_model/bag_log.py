"""Reader of an arm's log from a bag or run folder: control log, Franka states (tau_J) or joint states."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from franka_hw_interface.arm_log import ArmLog, FloatArray, LogError
from hric_bags.export import recording
from hric_bags.export.recording import ExportSource
from hric_bags.export.table import TopicTable
from hric_bags.reader import FRANKA_TYPE, LOG_TYPE
from hric_core.errors import UnknownNameError

JOINT_TYPE = "sensor_msgs/msg/JointState"
TYPES = (LOG_TYPE, FRANKA_TYPE, JOINT_TYPE)
"""Message types with joint positions, velocities and torques, the preferred one first."""
FIELDS = {
    LOG_TYPE: ("position", "velocity", "effort"),
    FRANKA_TYPE: ("q", "dq", "tau_J"),
    JOINT_TYPE: ("position", "velocity", "effort"),
}
JOINTS = 7
_SEVENTH = re.compile(r"(.*_)?joint7")


def read_bag(source: ExportSource, topic: str = "", arm_id: str = "") -> tuple[ArmLog, str]:
    """Read the log of an arm from a bag; return the log and its topic.

    Args:
        source: bag or run.
        topic: topic of the log; empty: the control log, else the topic with most messages (`*_desired` last).
        arm_id: prefix of the joint names; empty: prefix of the only arm, or panda for Franka states (without names).

    Raises:
        HricError: the topic or the joints do not exist; the message lists those in the bag.
    """
    with recording.open_reader(source) as reader:
        kinds = {name: str(info.msgtype) for name, info in reader.topics.items() if info.msgtype in TYPES}
        counts = {name: reader.topics[name].msgcount for name in kinds}
        there = ", ".join(sorted(reader.topics))
    if topic and topic not in kinds:
        raise UnknownNameError("topic with joints", topic, kinds, source.bag.name)
    order = (
        [topic]
        if topic
        else sorted(kinds, key=lambda name: (kinds[name] != LOG_TYPE, name.endswith("_desired"), -counts[name], name))
    )
    if not order:
        raise LogError(
            f"{source.bag.name} has no control log, Franka states or joint states; topics in the bag: {there or 'none'}"
        )
    joints: set[str] = set()
    states = [name for name in order if kinds[name] == FRANKA_TYPE]
    for name in order:
        if name in states and len(states) > 1:
            raise LogError(f"{source.bag.name} has Franka states on {', '.join(states)}; choose one with --topic")
        data = recording.read(source, (name,))[name]
        arms = _arms(data, kinds[name], arm_id)
        if len(arms) == 1:
            return _log(data, arms[0], FIELDS[kinds[name]]), name
        if len(arms) > 1:
            raise LogError(f"{name} has several arms: {', '.join(arms)}; choose one with --arm-id")
        joints |= set(data.below("position"))
    expected, there = f"{arm_id or '<arm>'}_joint1 to 7", ", ".join(sorted(joints)) or "none"
    raise LogError(
        f"{', '.join(order)} has no joints {expected} with position, velocity and effort; joints in the bag: {there}"
    )


def _arms(data: TopicTable, kind: str, arm_id: str) -> list[str]:
    """Return the prefixes of the arms whose joints all have position, velocity and torque in the data."""
    if kind == FRANKA_TYPE:
        return [arm_id or "panda"]
    fields = [data.below(field) for field in FIELDS[kind]]
    arms = [(match[1] or "").removesuffix("_") for name in fields[0] if (match := _SEVENTH.fullmatch(name))]
    return [
        arm for arm in arms if arm_id in ("", arm) and all(joint in field for field in fields for joint in _names(arm))
    ]


def _names(arm: str) -> list[str]:
    return [f"{arm}_joint{i}" if arm else f"joint{i}" for i in range(1, JOINTS + 1)]


def _log(data: TopicTable, arm: str, fields: Sequence[str]) -> ArmLog:
    names = _names(arm)
    labels = [str(i) for i in range(JOINTS)] if fields[0] == "q" else names
    arrays = [_matrix(data.below(field), labels) for field in fields]
    # Messages of other nodes on this topic, such as the gripper's joint states, have no values of the arm.
    has_arm = ~np.isnan(np.hstack(arrays)).all(axis=1)
    columns = ("stamp", *(f"{field}.{label}" for field in fields for label in labels))
    row = "cycle" if data.type_name == LOG_TYPE else "message"
    q, dq, tau = (array[has_arm] for array in arrays)
    return ArmLog(tuple(names), data.time[has_arm], q, dq, tau, columns, np.flatnonzero(has_arm) + 1, row)


def _matrix(columns: Mapping[str, object], labels: Sequence[str]) -> FloatArray:
    return np.column_stack([np.asarray(columns[label], dtype=float) for label in labels])
