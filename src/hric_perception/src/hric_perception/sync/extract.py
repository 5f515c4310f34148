"""Extraction of stamps and values from ROS messages for the synchroniser. Of ROS, only message classes are used.

A message is one sample, except for the types in `BATCHES`: their messages hold many samples, each with its own stamp.
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from hric_perception.sync.buffer import NS, Stamps, Values
from hric_perception.sync.paths import FLOATS, Leaf, PathError, PathStep

NAN = float("nan")


class NotForUsError(Exception):
    """Error of a message without the requested data, such as the joints of another robot on the same topic."""


class MalformedError(Exception):
    """Error of a message that contradicts itself; the text says how."""


class MessageSamples(NamedTuple):
    """Samples of a message.

    Attributes:
        stamps: increasing stamps, shape (n,) [ns].
        values: values, shape (n, columns).
    """

    stamps: Stamps
    values: Values


Fill = Callable[[Any, list[float]], None]
"""Function (message, row) that appends some values of the message to the row. It raises NotForUsError."""


def row_reader(leaves: Sequence[Leaf]) -> Callable[[Any], list[float]]:
    """Return a function that reads the numbers at `leaves` of a message as a list."""
    parts = _fills([(leaf, leaf.steps) for leaf in leaves])

    def read(message: Any) -> list[float]:
        row: list[float] = []
        for part in parts:
            part(message, row)
        return row

    return read


_Path = tuple[Leaf, tuple[PathStep, ...]]


def _fills(paths: Sequence[_Path]) -> list[Fill]:
    """Return one reader for each group of consecutive paths that begin with the same field."""
    groups = groupby(paths, lambda path: (path[1][0].field, path[1][0].element is None, len(path[1]) == 1))
    return [_fill(field, plain, last, list(group)) for (field, plain, last), group in groups]


def _fill(field: str, plain: bool, last: bool, group: list[_Path]) -> Fill:
    if plain and last:
        count = len(group)
        return lambda message, row: row.extend([float(getattr(message, field))] * count)
    if plain:
        inner = _fills([(leaf, steps[1:]) for leaf, steps in group])
        return lambda message, row: _each(inner, getattr(message, field), row)
    if last:
        return _numbers(field, [steps[0] for _, steps in group])
    return _elements(field, group)


def _each(parts: list[Fill], message: Any, row: list[float]) -> None:
    for part in parts:
        part(message, row)


def _numbers(field: str, steps: list[PathStep]) -> Fill:
    """Return a reader of elements of a list of numbers; it raises NotForUsError if one is missing."""
    find = _finder(steps)

    def fill(message: Any, row: list[float]) -> None:
        values = getattr(message, field)
        try:
            row.extend([values[index] for index in find(message)])
        except (IndexError, ValueError):
            raise NotForUsError(f"{field} has {len(values)} elements") from None

    return fill


def _finder(steps: Sequence[PathStep]) -> Callable[[Any], list[int]]:
    """Return a function that finds named elements in a message's list of names, cached while the list is unchanged.

    The function raises ValueError if a name does not exist.
    """
    fixed = [step.element for step in steps if isinstance(step.element, int)]
    if len(fixed) == len(steps):
        return lambda message: fixed
    known: list[str] = []
    indices: list[int] = []
    lists = steps[0].names

    def find(message: Any) -> list[int]:
        nonlocal known, indices
        names = getattr(message, lists)
        if names != known:
            indices = [step.element if isinstance(step.element, int) else names.index(step.element) for step in steps]
            known = list(names)
        return indices

    return find


def _elements(field: str, group: list[_Path]) -> Fill:
    """Return a reader of elements of a list of messages.

    A missing or untracked element gives NaN: the source works, but does not see that object.
    """
    parts = []
    for step, paths in groupby(group, lambda path: path[1][0]):
        inside = list(paths)
        lost = [NAN if leaf.kind in FLOATS else 0.0 for leaf, _ in inside]
        parts.append((_chooser(field, step), _fills([(leaf, steps[1:]) for leaf, steps in inside]), lost))

    def fill(message: Any, row: list[float]) -> None:
        for choose, inner, lost in parts:
            element = choose(message)
            if element is None or not getattr(element, "tracking_valid", True):
                row += lost
            else:
                _each(inner, element, row)

    return fill


def _chooser(field: str, step: PathStep) -> Callable[[Any], Any]:
    """Return a function that finds one element of a message's list of messages; None if it is missing."""
    if isinstance(step.element, str) and not step.names:
        name = step.element
        return lambda message: next((element for element in getattr(message, field) if element.name == name), None)
    find = _finder([step])

    def choose(message: Any) -> Any:
        try:
            return getattr(message, field)[find(message)[0]]
        except (ValueError, IndexError):
            return None

    return choose


def chunk_reader(leaves: Sequence[Leaf], where: str) -> Callable[[Any], MessageSamples]:
    """Return a function that splits a SampleChunk into samples.

    Raises:
        PathError: a leaf is not a channel of `data`.
    """
    find = _finder(_columns(leaves, ("data",), where))

    def read(message: Any) -> MessageSamples:
        width = len(message.channels)
        count, rest = divmod(len(message.data), width) if width else (0, 1)
        if rest or not 0.0 < message.rate < float("inf"):
            raise MalformedError(f"a chunk has {len(message.data)} values of {width} channels at {message.rate:g} Hz")
        offsets = np.rint(np.arange(count) * (NS / message.rate)).astype(np.int64)
        values = np.asarray(message.data, np.float64).reshape(count, width)
        return MessageSamples(stamp_of(message) + offsets, values[:, _indices(find, message)])

    return read


def log_reader(leaves: Sequence[Leaf], where: str) -> Callable[[Any], MessageSamples]:
    """Return a function that splits a ControlLog into samples.

    Raises:
        PathError: a leaf is not a joint's value in each control cycle.
    """
    steps = _columns(leaves, ("position", "velocity", "effort", "command_raw", "command"), where)
    groups = [
        (field, list(range(len(steps))), _finder(list(group)))
        for field, group in groupby(steps, lambda step: step.field)
    ]

    def read(message: Any) -> MessageSamples:
        times = np.asarray(message.time)
        joints = len(message.joint_names)
        if len(times) == 0 or any(len(getattr(message, field)) != len(times) * joints for field, _, _ in groups):
            raise MalformedError(f"the numbers of values do not fit {len(times)} cycles of {joints} joints")
        stamps = stamp_of(message) + np.rint((times - times[0]) * NS).astype(np.int64)
        values = [
            np.asarray(getattr(message, field)).reshape(-1, joints)[:, _indices(find, message)]
            for field, _, find in groups
        ]
        return MessageSamples(stamps, np.hstack(values))

    return read


def _columns(leaves: Sequence[Leaf], valid: tuple[str, ...], where: str) -> list[PathStep]:
    for leaf in leaves:
        if len(leaf.steps) != 1 or leaf.steps[0].field not in valid:
            raise PathError(f"{where}: {leaf} is not one value per sample; valid: elements of {', '.join(valid)}")
    return [leaf.steps[0] for leaf in leaves]


def _indices(find: Callable[[Any], list[int]], message: Any) -> list[int]:
    try:
        return find(message)
    except ValueError:
        raise NotForUsError("a requested name is missing") from None


def stamp_of(message: Any) -> int:
    """Return the stamp of a message's header [ns]."""
    stamp = message.header.stamp
    return int(stamp.secs * NS + stamp.nsecs)


BATCHES = {"hric_msgs/SampleChunk": chunk_reader, "hric_msgs/ControlLog": log_reader}
"""Message type with many samples per message -> function that makes its reader."""
