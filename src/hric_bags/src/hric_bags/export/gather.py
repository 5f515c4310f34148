"""Gathers messages of any type into a table: nested fields become columns with dotted names."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.export import units
from hric_bags.export.table import Column, Table

NAMES = ("name", "names", "joint_names", "channels", "link_names", "labelled_marker_names")
"""Fields that name the elements of the arrays beside them, where they have as many."""
LABELS = ("name", "child_frame_id")
"""Fields that name an element of an array of messages."""
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
HEADER = "std_msgs/msg/Header"
FIRST_SECOND = 1_000_000_000
"""Before this time of the bag a stamp of 0 is one; later it means that there is none [ns]."""
SINGLE = (float, int, str)
"""Python types of single values."""
Fields = Mapping[str, Sequence[str]]
"""Message type -> names of its fields, constants left out."""
Timing = Callable[[int], float]
"""Stamp [ns] -> time [s]."""


class Gatherer:
    """Rows of one topic.

    Args:
        topic, type_name: of the messages.
        fields: of all types that they contain.
        prismatic: joints whose values are metres.
    """

    def __init__(self, topic: str, type_name: str, fields: Fields, prismatic: frozenset[str] = frozenset()) -> None:
        self.topic, self.type_name = topic, type_name
        self._fields, self._prismatic = fields, prismatic
        self._plans: dict[str, tuple[str, list[tuple[str, str | None]]]] = {}
        self._stamps: list[int] = []
        self._frame = ""
        self._cells: dict[tuple[str, tuple[str, ...]], tuple[str, list[int], list[Any]]] = {}
        """(path, labels of its elements) -> unit, rows, values: single values have no labels."""

    def add(self, recorded: int, message: Any) -> None:
        """A message; recorded: when [ns]."""
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
        for field, own in fields:
            if (top and field == "header") or (names and field == naming):
                continue
            self._put(prefix + field, getattr(message, field), unit if own is None else own, names)

    def _plan(self, kind: str) -> tuple[str, list[tuple[str, str | None]]]:
        """Of a message type: the field that names others' elements, and all fields with the units that are theirs."""
        fields = self._fields[kind]
        naming = next((field for field in NAMES if field in fields), "")
        return naming, [(field, units.UNITS.get((kind, field))) for field in fields if (kind, field) != (HEADER, "seq")]

    def _put(self, path: str, value: Any, unit: str, names: tuple[str, ...]) -> None:
        if isinstance(value, SINGLE):
            self._put_cell(path, value, unit, ())
        elif isinstance(value, np.ndarray):
            if len(value):
                self._put_cell(
                    path, value, unit, names if len(names) == len(value) else tuple(map(str, range(len(value))))
                )
        elif isinstance(value, list):
            for k, item in enumerate(value):
                label = _label(item) or (names[k] if len(names) == len(value) else "") or str(k)
                self._put(f"{path}.{label}", item, unit, ())
        elif value.__msgtype__ in TIMES:
            self._put_cell(path, _nanoseconds(value) * 1e-9, "s", ())
        else:
            self._walk(f"{path}.", value, unit)

    def _put_cell(self, path: str, value: Any, unit: str, labels: tuple[str, ...]) -> None:
        cell = self._cells.get((path, labels))
        if cell is None:
            cell = self._cells[(path, labels)] = (unit, [], [])
        _, rows, values = cell
        rows.append(len(self._stamps) - 1)
        values.append(value)

    def table(self, timing: Timing, clock: str) -> Table:
        """All that was added; timing, clock: see `Table`."""
        count = len(self._stamps)
        found: dict[str, Column] = {}
        for (path, labels), (unit, rows, values) in self._cells.items():
            joined = np.concatenate(values) if labels else np.array(values)
            matrix = joined.reshape(len(rows), len(labels) or 1)
            for k, name in enumerate([f"{path}.{label}" for label in labels] or [path]):
                own = units.of_joint(unit, name.rpartition(".")[2], self._prismatic)
                found[name] = _merged(found.get(name), Column(name, own, matrix[:, k]), np.array(rows), count)
        stamps = np.array(self._stamps, dtype=np.int64)
        times = np.array([timing(stamp) for stamp in self._stamps])
        return Table(self.topic, self.type_name, self._frame, times, stamps, tuple(found.values()), clock)


def _merged(before: Column | None, column: Column, rows: npt.NDArray[np.int64], count: int) -> Column:
    """Values of some rows put among those of the others."""
    if before is None and len(rows) == count:
        return column
    text = column.values.dtype.kind == "U"
    if before is None:
        filled = np.full(count, "" if text else np.nan, dtype=object if text else float)
    else:
        filled = before.values.astype(object if text else float)
    filled[rows] = column.values
    return Column(column.name, column.unit, filled.astype(str) if text else filled)


def _label(item: Any) -> str:
    return next((found for field in LABELS if isinstance(found := getattr(item, field, None), str) and found), "")


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
