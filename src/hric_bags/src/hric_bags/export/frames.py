"""Transforms from frames of messages to OpenSim's ground: y up, x as in the root link of the converted robot."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hric_bags.export.table import FloatArray, TopicTable
from hric_bags.run_file import RunFile
from hric_core.geometry.messages import rotation
from hric_core.geometry.transforms import R_YUP_ZUP, homogeneous, inverse
from hric_core.urdf import read

STATIC = "tf2_msgs/msg/TFMessage"
MOCAP = "mocap"
"""Frame of motion capture data that are not transformed to the robot's base; it has the axes of the stream."""


@dataclass
class FixedFrames:
    """Known frames that do not move, with their poses.

    Attributes:
        root: link that is fixed in OpenSim's ground; empty: not known.
        parents: frame -> (parent frame, pose in it, shape (4, 4)).
        mocap_up: axis of the mocap stream that points up, "y" or "z".
    """

    root: str = ""
    parents: dict[str, tuple[str, FloatArray]] = field(default_factory=dict)
    mocap_up: str = "y"

    def in_ground(self, frame: str) -> tuple[FloatArray, str]:
        """Return the pose of a frame in OpenSim's ground, shape (4, 4), and a text on how it was found."""
        frame = frame.lstrip("/")
        turned = homogeneous(R_YUP_ZUP)
        T_root_frame = self._in_root(frame)
        if T_root_frame is not None:
            return (
                turned @ T_root_frame,
                f"frame {frame} of the bag, by transforms to {self.root}, turned from z up to y up",
            )
        if frame == MOCAP and self.mocap_up == "y":
            return np.eye(4), "axes of the stream, which has y up"
        return (
            turned,
            f"frame {frame or '(unnamed)'} of the bag, assumed z up and equal to the robot's root, turned to y up",
        )

    def _in_root(self, frame: str) -> FloatArray | None:
        if not self.root or not frame:
            return None
        ancestors, root_ancestors = self._ancestors(frame), self._ancestors(self.root)
        common = next((name for name in ancestors if name in root_ancestors), None)
        return None if common is None else inverse(root_ancestors[common]) @ ancestors[common]

    def _ancestors(self, frame: str) -> dict[str, FloatArray]:
        """Return a frame and all its ancestors, each with the pose of `frame` in it, shape (4, 4)."""
        ancestors = {frame: np.eye(4)}
        name, T = frame, np.eye(4)
        while name in self.parents and self.parents[name][0] not in ancestors:
            name, T_parent = self.parents[name]
            T = T_parent @ T
            ancestors[name] = T
        return ancestors


def of_run(urdf: str, tables: Mapping[str, TopicTable], run: RunFile) -> FixedFrames:
    """Return the fixed frames of a run, from its URDF, static transforms and motion capture settings.

    Args:
        urdf: URDF of the robot; may be empty.
        tables: tables of the bag by topic, of which that of /tf_static is used.
        run: contents of run.yaml; may be empty.
    """
    known = (run.get("parameters") or {}).get("natnet_client") or {}
    frames = FixedFrames(mocap_up=str(known.get("up_axis", "y")))
    if urdf:
        _read_urdf(urdf, frames)
    for topic, table in tables.items():
        if topic.endswith("tf_static") and table.type_name == STATIC:
            _read_transforms(table, frames)
    if not frames.root and frames.parents:
        frames.root = next(parent for parent, _ in frames.parents.values() if parent not in frames.parents)
    return frames


def _read_urdf(urdf: str, frames: FixedFrames) -> None:
    robot = read(urdf)
    for joint in robot.joints.values():
        if joint.type == "fixed":
            frames.parents[joint.child] = (joint.parent, joint.T_parent_joint)
    frames.root = robot.root


def _read_transforms(table: TopicTable, frames: FixedFrames) -> None:
    for column in table.columns:
        start, _, end = column.name.rpartition(".header.")
        if end != "frame_id":
            continue
        rows = np.flatnonzero(column.values != "")
        if len(rows):
            child = start.removeprefix("transforms.").lstrip("/")
            R = rotation(*(_value(table, f"{start}.transform.rotation.{axis}", rows[-1]) for axis in "xyzw"))
            p = [_value(table, f"{start}.transform.translation.{axis}", rows[-1]) for axis in "xyz"]
            frames.parents[child] = (str(column.values[rows[-1]]).lstrip("/"), homogeneous(R, p))


def _value(table: TopicTable, name: str, row: int) -> float:
    column = table.column(name)
    return float(column.values[row]) if column is not None else 0.0
