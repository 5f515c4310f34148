"""Conversion of messages of any type to a table, in which nested fields become columns with dotted names."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.export import units
from hric_bags.export.table import TopicColumn, TopicTable

NAMES = ("name", "names", "joint_names", "channels", "link_names", "labelled_marker_names")
"""Fields with names for the elements of a message's other arrays, if these have as many elements."""
LABELS = ("name", "child_frame_id")
"""Fields with the name of one element of an array of messages."""
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
HEADER = "std_msgs/msg/Header"
FIRST_SECOND = 1_000_000_000
"""Recording time [ns] before which a stamp of 0 is valid; later it means that a message has no stamp."""
SINGLE = (float, int, str)
"""Python types of single values."""
Fields = Mapping[str, Sequence[str]]
"""Message type -> names of its fields, without constants."""
Timing = Callable[[int], float]
"""Function from stamp [ns] to time [s]."""


class Gatherer:
    """Collector of the messages of one topic as rows of a table.

    Args:
        topic, type_name: name and message type of the topic.
        fields: fields of all message types that the messages contain.
        prismatic: names of prismatic joints, whose values are in metres.
    """

    def __init__(self, topic: str, type_name: str, fields: Fields, prismatic: frozenset[str] = frozenset()) -> None:
        self.topic, self.type_name = topic, type_name
        self._fields, self._prismatic = fields, prismatic
        self._plans: dict[str, tuple[str, list[tuple[str, str | None]]]] = {}
        self._stamps = array("q")
        self._frame = ""
        self._cells: dict[tuple[str, tuple[str, ...]], tuple[str, array[int], Any, Any]] = {}
        """(path, labels of the elements) -> unit, rows, values, data type; single values have no labels and type."""

    def add(self, recorded: int, message: Any) -> None:
        """Add a message; recorded: recording time [ns]."""
        stamped = getattr(getattr(message, "header", None), "__msgtype__", "") == HEADER
        stamp = _nanoseconds(message.header.stamp) if stamped else 0
        self._stamps.append(stamp if stamp or (stamped and recorded < FIRST_SECOND) else recorded)
        if not self._frame and stamped:
            self._frame = str(message.header.frame_id)
        self._walk("", message, "", top=True)

    def _walk(self, prefix: str, message: Any, unit: str, top: bool = False) -> None:
        kind = message.__msgtype__
        if kind not in self._plans:
            self._plans[kind] = self._plan(kind)
        naming, fields = self._plans[kind]
        named = getattr(message, naming) if naming else ()
        names = tuple(map(str, named)) if isinstance(named, list) else ()
        for field, field_unit in fields:
            if (top and field == "header") or (names and field == naming):
                continue
            self._put(prefix + field, getattr(message, field), unit if field_unit is None else field_unit, names)

    def _plan(self, kind: str) -> tuple[str, list[tuple[str, str | None]]]:
        """Return the field of a message type with names for elements, and all fields with their units."""
        fields = self._fields[kind]
        naming = next((field for field in NAMES if field in fields), "")
        return naming, [(field, units.UNITS.get((kind, field))) for field in fields if (kind, field) != (HEADER, "seq")]

    def _put(self, path: str, value: Any, unit: str, names: tuple[str, ...]) -> None:
        labels: tuple[str, ...] = ()
        if isinstance(value, np.ndarray):
            if not (count := len(value)):
                return
            labels = names if len(names) == count else _numbers(count)
        elif isinstance(value, list):
            for k, item in enumerate(value):
                label = _label(item) or (names[k] if len(names) == len(value) else "") or str(k)
                self._put(f"{path}.{label}", item, unit, ())
            return
        elif not isinstance(value, SINGLE):
            if value.__msgtype__ not in TIMES:
                self._walk(f"{path}.", value, unit)
                return
            value, unit = _nanoseconds(value) * 1e-9, "s"
        cell = self._cells.get((path, labels))
        if cell is None:
            kind, values = (value.dtype, bytearray()) if labels else (None, array("d") if type(value) is float else [])
            cell = self._cells[(path, labels)] = (unit, array("q"), values, kind)
        cell[1].append(len(self._stamps) - 1)
        if labels:
            cell[2].extend(value.tobytes())
        else:
            cell[2].append(value)

    def table(self, timing: Timing, clock: str) -> TopicTable:
        """Return the table of all messages; timing: function from stamps to times; clock: event at time 0."""
        count = len(self._stamps)
        columns: dict[str, TopicColumn] = {}
        for (path, labels), (unit, rows, values, kind) in self._cells.items():
            joined = np.frombuffer(values, kind) if labels else np.array(values)
            matrix = joined.reshape(len(rows), len(labels) or 1)
            for k, name in enumerate([f"{path}.{label}" for label in labels] or [path]):
                column_unit = units.of_joint(unit, name.rpartition(".")[2], self._prismatic)
                columns[name] = _merged(
                    columns.get(name), TopicColumn(name, column_unit, matrix[:, k]), np.array(rows), count
                )
        stamps = np.array(self._stamps)
        times = np.array([timing(stamp) for stamp in self._stamps])
        return TopicTable(self.topic, self.type_name, self._frame, times, stamps, tuple(columns.values()), clock)


def _merged(before: TopicColumn | None, column: TopicColumn, rows: npt.NDArray[np.int64], count: int) -> TopicColumn:
    """Return a column of `count` rows that has new values in `rows`, and earlier ones, or NaN or "", in the others."""
    if before is None and len(rows) == count:
        return column
    text = column.values.dtype.kind == "U"
    if before is None:
        filled = np.full(count, "" if text else np.nan, dtype=object if text else float)
    else:
        filled = before.values.astype(object if text else float)
    filled[rows] = column.values
    return TopicColumn(column.name, column.unit, filled.astype(str) if text else filled)


@cache
def _numbers(count: int) -> tuple[str, ...]:
    return tuple(map(str, range(count)))


def _label(item: Any) -> str:
    return next((text for field in LABELS if isinstance(text := getattr(item, field, None), str) and text), "")


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
