"""Collection of numbers from messages in arrays, without storing the messages. No ROS."""

from array import array
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from hric_bags.reader import FloatArray
from hric_core.geometry import Vector


def times(stamps: Iterable[float], robot_time: Callable[[float], float]) -> FloatArray:
    """Return the robot times of stamps [s], shape (n,) [s]."""
    return np.array([robot_time(stamp) for stamp in stamps])


def in_order(time: FloatArray, *values: FloatArray) -> list[FloatArray]:
    """Return times and values, arrays with a row for each time, in the order of time."""
    order = np.argsort(time, kind="stable")
    return [rows[order] for rows in (time, *values)]


def xyz(v: Any) -> Vector:
    """Return the components x, y, z of a point or vector message."""
    return v.x, v.y, v.z


def xyz_quaternion(pose: Any) -> tuple[float, ...]:
    """Return position and quaternion x y z w of a geometry_msgs/Pose."""
    q = pose.orientation
    return (*xyz(pose.position), q.x, q.y, q.z, q.w)


def stamp_of(raw: bytes) -> int:
    """Return the stamp of a serialised message that begins with a header [ns]."""
    return int.from_bytes(raw[4:8], "little") * 1_000_000_000 + int.from_bytes(raw[8:12], "little")


class Thinning:
    """Filter that drops messages whose stamps follow that of the last chosen one too closely.

    Recording times are not used, because on a busy machine messages are recorded in bursts.

    Args:
        rate: highest rate at which messages of a stream are chosen [Hz].
    """

    def __init__(self, rate: float) -> None:
        self.period, self._last = round(0.99e9 / rate), dict[Any, int]()

    def due(self, stream: Any, raw: bytes) -> bool:
        """Return True if a message of a stream is chosen; raw: serialised message that begins with a header."""
        stamp = stamp_of(raw)
        if stream in self._last and abs(stamp - self._last[stream]) < self.period:
            return False
        self._last[stream] = stamp
        return True


class RecordRows:
    """Collector of array fields of messages as rows of equal length, one value per name.

    Args:
        fields: names of the messages' array fields.

    Attributes:
        last: last message that was added; None: none was.
    """

    def __init__(self, *fields: str) -> None:
        self._fields, self._stamps = fields, array("d")
        self._values = {name: array("d") for name in fields}
        self.last: Any = None

    def add(self, stamp: float, message: Any) -> None:
        """Add a message, unless it has other names, no names or lacks values; stamp: header stamp [s]."""
        rows = {name: np.asarray(getattr(message, name), dtype=float) for name in self._values}
        names = message.name if self.last is None else self.last.name
        if not len(names) or list(message.name) != list(names) or any(len(row) != len(names) for row in rows.values()):
            return
        self._stamps.append(stamp)
        for name, values in self._values.items():
            values.frombytes(rows[name].tobytes())
        self.last = message

    def columns(self, robot_time: Callable[[float], float]) -> list[FloatArray]:
        """Return the robot times in their order, shape (n,) [s], and the values of each field, shape (n, j)."""
        n = len(self._stamps)
        width = 0 if self.last is None else -1
        values = (np.array(column).reshape(n, width) for column in self._values.values())
        return in_order(times(self._stamps, robot_time), *values)
