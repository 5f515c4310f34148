"""Table of one topic: one row per sample, one column per value."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_core.errors import HricError

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


class ExportError(HricError):
    """Error for data that cannot be exported; the message states what is available."""


@dataclass(frozen=True)
class TopicColumn:
    """Column of a table: one value of a topic over time.

    Attributes:
        name: path of the field with labels of joints, channels and bodies, e.g. "position.panda_joint1".
        unit: unit of the values; empty: text, or not known.
        values: numbers, booleans or text, shape (n,); NaN where a sample has no such number, "" for text.
    """

    name: str
    unit: str
    values: npt.NDArray[Any]


@dataclass(frozen=True)
class TopicTable:
    """Table of n samples of a topic.

    Attributes:
        topic: absolute topic name.
        type_name: message type as rosbags writes it, e.g. "sensor_msgs/msg/JointState".
        frame: frame_id of the messages' headers; empty: none.
        time: times of measurement, shape (n,) [s], on the clock that `clock` names.
        stamp: stamps of the samples as in the bag, shape (n,) [ns].
        columns: columns in the order of the message definition.
        clock: event at which `time` is 0.
        notes: sentences for the reader of an exported file.
    """

    topic: str
    type_name: str
    frame: str
    time: FloatArray
    stamp: IntArray
    columns: tuple[TopicColumn, ...]
    clock: str = ""
    notes: tuple[str, ...] = ()

    @property
    def rate(self) -> float:
        """Samples per second over the whole table [Hz]; 0: fewer than two, or all at one time."""
        span = float(np.ptp(self.time)) if len(self.time) > 1 else 0.0
        return (len(self.time) - 1) / span if span > 0.0 else 0.0

    @property
    def name(self) -> str:
        """File name without extension: the topic with "." for "/"."""
        return self.topic.strip("/").replace("/", ".")

    def named(self) -> dict[str, TopicColumn]:
        """Return time, stamp and all columns by their names in a file; a name in use gets the prefix "field."."""
        columns = {"time": TopicColumn("time", "s", self.time), "stamp": TopicColumn("stamp", "ns", self.stamp)}
        for column in self.columns:
            name = column.name
            while name in columns or name == ABOUT:
                name = f"field.{name}"
            columns[name] = column
        return columns

    def column(self, name: str) -> TopicColumn | None:
        """Return a column by its name; None: there is none."""
        return next((column for column in self.columns if column.name == name), None)

    def below(self, path: str) -> dict[str, FloatArray]:
        """Return the values of the columns whose names begin with `path` and a dot, by the rest of their names."""
        start = f"{path}."
        return {column.name[len(start) :]: column.values for column in self.columns if column.name.startswith(start)}

    def about(self) -> dict[str, object]:
        """Return the description that is written into files: topic, type, frame, axes, rate, clock, units, notes."""
        return {
            "topic": self.topic,
            "type": self.type_name,
            "frame": self.frame,
            "axes": AXES,
            "rate": round(self.rate, 6),
            "time": f"seconds since {self.clock}; stamp: nanoseconds as in the bag",
            "units": {name: column.unit for name, column in self.named().items()},
            "notes": list(self.notes),
        }

    def about_text(self) -> str:
        """Return the description that is written into files as JSON on one line."""
        return json.dumps(self.about())


ABOUT = "about"
"""Name of the description in a .npz file."""
AXES = "right-handed, those of the frame; z up where the frame is the robot's base or world (REP 103)"


class Export:
    """Export format of another package, a plugin `hric_bags::Export` that writes one file per topic.

    The plugin's name is the name of the format and the extension of its files.
    """

    def write(self, table: TopicTable, path: Path) -> None:
        """Write the table of a topic to a new file.

        Raises:
            ExportError: the topic does not suit the format.
        """
        raise NotImplementedError
