"""Replayed trials: labels, units, force plates, events and axes as in the c3d file that a run replayed.

run.yaml describes the file under `trials`; an anonymised run has no such description, and then the names are those of
the messages.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hric_bags.export.frames import MOCAP, FixedFrames
from hric_bags.export.table import FloatArray, TopicTable
from hric_bags.export.trial.c3d_plates import C3dPlate
from hric_bags.run_file import RunFile
from hric_core.geometry.messages import rotation
from hric_core.geometry.transforms import R_YUP_ZUP, homogeneous, inverse
from hric_core.trial.c3d import VOLTS
from hric_core.trial.description import labels_of
from hric_core.trial.events import TrialEvent

START_TYPE = "std_msgs/msg/Header"
"""Message type of the topic that has the start of a replayed trial."""
START = "/human/start"
"""Ending of the name of that topic."""
NUMBERED = "Marker"
"""Beginning of the names that Motive gives to the markers of a rigid body, before their number."""
KEPT = {2: 6, 4: 6}
"""Types of force plates whose channels follow from the load, with their number; others are written as type 2."""


@dataclass(frozen=True)
class ReplayedTrial:
    """Trial that a run replayed.

    Attributes:
        name: name of the file.
        about: description of the file, from `hric_core.trial.description`.
        human: settings of the emulated human who replays the markers; empty: none.
        T_base_lab: pose of the laboratory, z up, in the base of the robot, shape (4, 4).
        plate: (id of the plate in the run, its number in the file); None: no plate is replayed.
        muscles: label in the file, by channel of the EMG in the run.
        begin: robot time at which the trial begins, unless a topic has it [s].
    """

    name: str
    about: Mapping[str, Any]
    human: Mapping[str, Any]
    T_base_lab: FloatArray
    plate: tuple[str, int] | None
    muscles: Mapping[str, str]
    begin: float

    @property
    def axes(self) -> str:
        """Text on the axes of the file."""
        return f"axes of the replayed trial {self.name}, {self.about['up']} up"

    def label(self, streamed: str) -> str | None:
        """Return the label in the file of a marker "body/number" of the stream; None: it is not in the file."""
        body, _, member = streamed.rpartition("/")
        bodies = {str(self.human.get("name", "hand")): self.human.get("labels"), **(self.human.get("bodies") or {})}
        number = member.removeprefix(NUMBERED)
        if body not in bodies or not number.isdecimal():
            return None
        labels = bodies[body] or labels_of(self.about["labels"], body)
        return str(labels[int(number) - 1]) if 0 < int(number) <= len(labels) else None

    def T_file_ground(self, frames: FixedFrames, table: TopicTable | None) -> FloatArray:
        """Return the pose of OpenSim's ground in the axes of the file, shape (4, 4).

        Args:
            frames: frames of the run.
            table: motion capture; None: there is none, and the laboratory is taken for the root of the robot.
        """
        turned = homogeneous(R_YUP_ZUP)
        known = table is not None and table.frame.lstrip("/") != MOCAP
        T_ground_lab = frames.in_ground(table.frame)[0] @ self.T_base_lab if known and table is not None else turned
        return (turned if self.about["up"] == "y" else np.eye(4)) @ inverse(T_ground_lab)

    def recorded_plate(self, name: str, load: FloatArray) -> tuple[C3dPlate, FloatArray, list[str]] | None:
        """Return a plate as in the file, with its signals and the labels of its channels; None: it is not replayed.

        Args:
            name: id of the plate in the run.
            load: load on the plate about the middle of its surface, z up, shape (n, 6) [N, N m].
        """
        source = self.about["plates"].get(self.plate[1]) if self.plate is not None and self.plate[0] == name else None
        if source is None:
            return None
        kind, origin = int(source["type"]), np.array(source.get("origin", (0.0, 0.0, 0.0)))
        signals = -load.reshape(-1, 2, 3) * [1.0, source["flip"], source["flip"]]
        signals[:, 1] -= np.cross(signals[:, 0], -origin if origin[2] > 0 else origin)
        signals[:, 1] /= source["moment"] if kind in KEPT else 1e-3
        wrench, rows = signals.reshape(-1, 6), [number - 1 for number in source["channels"]]
        labels, units = ([self.about[key][row] for row in rows] for key in ("channels", "units"))
        if kind not in KEPT:
            kind, units, labels = 2, ["N"] * 3 + ["Nmm"] * 3, []
        matrix = np.array(source["calibration"]) if kind == 4 else np.eye(6)
        plate = C3dPlate(name, kind, np.array(source["corners"]), origin, matrix, tuple(units), self.axes)
        return plate, np.linalg.solve(matrix, wrench.T).T, labels

    def unit(self, channel: str) -> tuple[str, float]:
        """Return the unit of an EMG channel in the file, and the size of that unit [V]."""
        unit = str(self.about["units"][self.about["channels"].index(channel)])
        return unit, VOLTS[unit.lower()]

    def events(self, tables: Mapping[str, TopicTable]) -> list[TrialEvent]:
        """Return the events of the file, at robot times [s]."""
        begin = self.begin
        for table in tables.values():
            stamps = table.column("stamp")
            if table.type_name == START_TYPE and table.topic.endswith(START) and stamps is not None:
                begin = float(table.time[-1] + stamps.values[-1] - 1e-9 * table.stamp[-1])
        return [TrialEvent(begin + time, label, context) for time, label, context in self.about["events"]]


def of_run(run: RunFile) -> ReplayedTrial | None:
    """Return the trial whose markers, force plate or EMG a run replayed; None: there is none.

    Sensors that replay another file than the markers are not part of it, nor are those beside a simulated person.
    """
    definition: Mapping[str, Any] = run.get("definition") or {}
    mocap, plate, emg = ({**(definition.get(key) or {})} for key in ("mocap", "force_plate", "emg"))
    human, load, activation = (
        replays if replays.get("program") == "c3d" else {}
        for replays in (
            mocap.get("human") or {},
            (plate.get("emulated") or {}).get("load") or {},
            (emg.get("emulated") or {}).get("activation") or {},
        )
    )
    first = human if mocap else load or activation
    name = Path(str(first.get("path", ""))).name
    if (about := (run.get("trials") or {}).get(name)) is None:
        return None
    pose = mocap.get("base_from_mocap") or {}
    load, activation = (
        replays if Path(str(replays.get("path"))).name == name else {} for replays in (load, activation)
    )
    channels = emg.get("channels") or () if activation else ()
    return ReplayedTrial(
        name,
        about,
        human,
        homogeneous(rotation(*pose.get("xyzw", (0.0, 0.0, 0.0, 1.0))), pose.get("xyz", (0.0, 0.0, 0.0))),
        (str((plate.get("driver") or {}).get("id", "1")), int(load.get("plate", 1))) if load else None,
        dict(zip(channels, activation.get("channels") or channels, strict=True)),
        float(first.get("begin") or 0.0),
    )
