"""Digest of a bag as hashes and a few values per topic and field, and comparison of a bag with a stored digest.

The digest of a topic covers all fields of its messages and the robot time at which they were written, except for the
sequence number of the header and the fields in `LEFT_OUT`. A field is the sequence of its values in all messages, in
order: `wrench.force.x`, or `position` with all joints of all cycles; `states.length` is the length of a list.

For each field the digest contains `count` and `kind`. A constant field has its `value`. Other fields have `sum`
(exactly rounded, of finite values), `min`, `max`, `last` (values of the last message, at most 7), and for up to 8
blocks of equal size the hashes (`blocks`, 8 digits each) and first values (`samples`), all in full precision.
`compare` compares a stored digest with a bag in one of two ways:

- exactly: the hashes of all blocks must be equal, which also locates the first difference to within a block;
- with tolerance: values within `TOLERANCE` (`DERIVED_TOLERANCE`) * max(1, largest magnitude of the field), sums within
  this times the count, 32-bit floats within one unit in the last place; integers, texts and counts must be equal.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from rosbags.highlevel import AnyReader

from hric_bags.memory import FIRST

LEFT_OUT = {
    "/robot_description data": "names folders of the machine; what it says acts in the states",
    "*/controller_manager/statistics controller.*time.*": "how long the controllers took, by the wall clock",
    "*/controller_manager/statistics controller.*overrun*": "likewise",
}
"""Fields that are left out, as patterns of topic and field, with the reason. Their topics and times are compared."""
TOLERANCE = 1e-12
"""Tolerance for other processors or libraries, relative to the largest magnitude of a field if that is above 1."""
DERIVED = ("*effort*", "*command*", "*tau*", "*dd*", "*force*", "*torque*", "*wrench*", "*F_ext*", "*depths*", "*jerk*")
DERIVED_TOLERANCE = 1e-8
"""Tolerance of fields that are computed from positions with gains up to 1e4 or by division by the cycle of 1 ms.

These amplify the rounding errors of positions. Measured with the vector code of BLAS, numpy and the C library disabled:
up to 4e-9.
"""
BLOCKS = 8
"""Maximum number of blocks of a field."""
BLOCK_DIGITS = 8
"""Number of hexadecimal digits of the hash of a block."""
MOST_LAST = 7
BAG_TIME = "bag_time"
"""Field of each topic: robot time at which each message was written [ns]; FIRST in a bag stands for 0."""
Digest = dict[str, Any]
"""Digest of a topic (`type`, `messages`, `sha256`, `fields`), or of a field (see the docstring of the module)."""


@dataclass(frozen=True)
class Field:
    """All values of a field in all messages of a topic.

    Attributes:
        values: values in order, shape (n,): floats, integers or texts.
        ends: index after the last value of each message, shape (messages,).
    """

    values: npt.NDArray[Any]
    ends: npt.NDArray[np.int64]

    @property
    def is_text(self) -> bool:
        """True if the values are texts."""
        return self.values.dtype.kind == "U"

    @property
    def kind(self) -> str:
        """Type of the values, such as float64, or text."""
        return "text" if self.is_text else self.values.dtype.name

    def data(self, begin: int = 0, end: int | None = None) -> bytes:
        """Return the bytes of a range of values, independent of the machine."""
        part = self.values[begin:end]
        if self.is_text:
            return json.dumps(part.tolist()).encode()
        return part.astype(part.dtype.newbyteorder("<")).tobytes()


@dataclass(frozen=True)
class Topic:
    """All messages of a topic: type, and fields by name."""

    type: str
    fields: Mapping[str, Field]

    @property
    def times(self) -> npt.NDArray[np.int64]:
        """Robot time of each message, shape (messages,) [ns]."""
        return self.fields[BAG_TIME].values

    def sha256(self, names: Sequence[str]) -> str:
        """Return a hash of these fields: names, values, and number of values in each message."""
        digest = hashlib.sha256()
        for name in sorted(names):
            field = self.fields[name]
            digest.update(f"{name}\0{field.kind}\0".encode())
            digest.update(field.ends.astype("<i8").tobytes())
            digest.update(field.data())
        return digest.hexdigest()


@dataclass(frozen=True)
class Mismatch:
    """A difference between a stored digest and a bag.

    Attributes:
        time: robot time of the first message that may differ [s].
        text: topic, field, and first value that differs.
    """

    time: float
    text: str


def read(bag: Path) -> dict[str, Topic]:
    """Read all topics of a bag, without the fields in `LEFT_OUT`."""
    messages: dict[str, list[dict[str, list[Any]]]] = {}
    types: dict[str, str] = {}
    with AnyReader([bag]) as reader:
        for connection, time, raw in reader.messages():
            values: dict[str, list[Any]] = {BAG_TIME: [np.int64(0 if time == FIRST else time)]}
            _flatten(reader.deserialize(raw, connection.msgtype), "", values)
            messages.setdefault(connection.topic, []).append(values)
            types[connection.topic] = connection.msgtype
    return {topic: Topic(types[topic], _gather(topic, found)) for topic, found in messages.items()}


def _flatten(value: Any, name: str, values: dict[str, list[Any]]) -> None:
    """Append a value of a message, with all subfields, to the lists of values by field name."""
    if is_dataclass(value):
        for field in fields(value):
            if field.name not in ("__msgtype__", "seq"):
                _flatten(getattr(value, field.name), f"{name}.{field.name}".lstrip("."), values)
    elif isinstance(value, np.ndarray):
        values.setdefault(name, []).extend(value)
    elif isinstance(value, list):
        values.setdefault(f"{name}.length", []).append(np.int64(len(value)))
        for item in value:
            _flatten(item, name, values)
    else:
        values.setdefault(name, []).append(value)


def _gather(topic: str, messages: Sequence[Mapping[str, list[Any]]]) -> dict[str, Field]:
    names = dict.fromkeys(name for message in messages for name in message)
    result = {}
    for name in names:
        if any(fnmatchcase(f"{topic} {name}", pattern) for pattern in LEFT_OUT):
            continue
        parts = [message.get(name, []) for message in messages]
        ends = np.cumsum([len(part) for part in parts], dtype=np.int64)
        result[name] = Field(np.array([value for part in parts for value in part]), ends)
    return result


def _starts(count: int) -> list[int]:
    """Return the first index of each block."""
    blocks = min(count, BLOCKS)
    return [count * block // blocks for block in range(blocks)]


def _blocks(field: Field) -> list[str]:
    starts = _starts(len(field.values))
    pairs = zip(starts, [*starts[1:], None], strict=True) if starts else ()
    return [hashlib.sha256(field.data(begin, end)).hexdigest()[:BLOCK_DIGITS] for begin, end in pairs]


def describe(topic: Topic) -> Digest:
    """Return the digest of a topic."""
    return {
        "type": topic.type,
        "messages": len(topic.times),
        "sha256": topic.sha256(list(topic.fields)),
        "fields": {name: _describe_field(field) for name, field in topic.fields.items()},
    }


def _describe_field(field: Field) -> Digest:
    values, count = field.values, len(field.values)
    result: Digest = {"count": count}
    if not count:
        return result
    result["kind"] = field.kind
    if len(np.unique(values)) == 1:
        return result | {"value": values[0].item()}
    if not field.is_text:
        result |= {"sum": _sum(values), "min": values.min().item(), "max": values.max().item()}
    begin = int(field.ends[-2]) if len(field.ends) > 1 else 0
    result["last"] = values[max(begin, count - MOST_LAST) :].tolist()
    result["samples"] = [values[start].item() for start in _starts(count)]
    return result | {"blocks": "".join(_blocks(field))}


def _sum(values: npt.NDArray[Any]) -> Any:
    """Return the exactly rounded sum of the finite values, which does not depend on their order."""
    return math.fsum(values[np.isfinite(values)].tolist()) if values.dtype.kind == "f" else sum(map(int, values))


def compare(listed: Mapping[str, Digest], found: Mapping[str, Topic], *, exact: bool) -> list[Mismatch]:
    """Return the differences in the listed topics and fields, the earliest first; other topics and fields are ignored.

    Args:
        listed: stored digest of each topic.
        found: topics of the bag.
        exact: compare hashes; else within the tolerance.
    """
    result = []
    for name, digest in listed.items():
        if name not in found:
            text = f"topic {name} is missing; listed: {digest['messages']} messages of {digest['type']}"
            result.append(Mismatch(0.0, text))
            continue
        topic = found[name]
        if topic.type != digest["type"]:
            result.append(Mismatch(0.0, f"topic {name} is of type {topic.type}; listed: {digest['type']}"))
        own = [_compare_field(name, field, wanted, topic, exact) for field, wanted in digest["fields"].items()]
        differing = [mismatch for mismatch in own if mismatch is not None]
        if exact and not differing and topic.sha256(list(digest["fields"])) != digest["sha256"]:
            text = f"topic {name}: its values are as listed, but its messages have other numbers of them"
            differing.append(Mismatch(0.0, text))
        result += differing
    return sorted(result, key=lambda mismatch: mismatch.time)


def _compare_field(topic: str, name: str, listed: Digest, now: Topic, exact: bool) -> Mismatch | None:
    """Return the first difference of a field; None if there is none."""
    place = f"topic {topic}, field {name}"
    if name not in now.fields:
        return Mismatch(0.0, f"{place}: is missing; listed: {listed['count']} values")
    field = now.fields[name]
    found = _describe_field(field)
    for key in ("count", "kind"):
        if found.get(key) != listed.get(key):
            index, told = _first_known(listed, field, _equal)
            text = f"{place}: {key} was {listed.get(key)}, is {found.get(key)}; {told or 'no listed value differs'}"
            return Mismatch(_time(now, field, index), text)
    if not listed["count"] or json.dumps(found) == json.dumps(listed):
        return None
    if exact or not str(listed["kind"]).startswith("float"):
        begin, end = _first_block(listed, found)
        _, told = _first_known(listed, field, _equal)
        text = f"{place}: first differs between values {begin} and {end - 1} of {listed['count']}"
        return Mismatch(_time(now, field, begin), f"{text}; {told or 'no listed value differs'}")
    return _first_beyond(place, listed, found, field, now)


def _equal(a: Any, b: Any) -> bool:
    """Return True if two values are bitwise equal, also for NaN."""
    return json.dumps(a) == json.dumps(b)


def _first_block(listed: Digest, found: Digest) -> tuple[int, int]:
    """Return start and end index of the first block whose hash differs."""
    count, starts = listed["count"], _starts(listed["count"])
    if "blocks" not in listed or "blocks" not in found:
        return 0, count
    pieces = [slice(k * BLOCK_DIGITS, (k + 1) * BLOCK_DIGITS) for k in range(len(starts))]
    block = next(k for k, piece in enumerate(pieces) if listed["blocks"][piece] != found["blocks"][piece])
    return starts[block], [*starts[1:], count][block]


def _first_beyond(place: str, listed: Digest, found: Digest, field: Field, now: Topic) -> Mismatch | None:
    """Return the difference of the first stored value of a float field that exceeds the tolerance."""
    extremes = [listed[key] for key in ("value", "min", "max") if key in listed]
    scale = max([1.0, *(abs(value) for value in extremes if math.isfinite(value))])
    name = place.rpartition(" ")[2]
    tolerance = DERIVED_TOLERANCE if any(fnmatchcase(name, pattern) for pattern in DERIVED) else TOLERANCE
    bound = scale * (2.0**-23 if listed["kind"] == "float32" else tolerance)
    index, told = _first_known(listed, field, lambda a, b: _equal(a, b) or abs(a - b) <= bound)
    for key, factor in (("min", 1), ("max", 1), ("sum", listed["count"])):
        before, after = (digest.get(key, digest.get("value", 0.0) * factor) for digest in (listed, found))
        if not told and not _equal(before, after) and not abs(before - after) <= factor * bound:
            told = f"its {key} was {before!r}, is {after!r}"
    return Mismatch(_time(now, field, index), f"{place}: {told}; allowed: {bound:.1e}") if told else None


def _first_known(listed: Digest, field: Field, alike: Callable[[Any, Any], bool]) -> tuple[int, str]:
    """Return index and description of the first stored value that differs; 0 and an empty text if none differs."""
    count, last = listed["count"], listed.get("last", [])
    if "value" in listed:
        known = dict.fromkeys(range(count), listed["value"])
    else:
        known = dict(zip(_starts(count), listed.get("samples", []), strict=True))
        known |= {count - len(last) + k: value for k, value in enumerate(last)}
    for index, value in known.items():
        if index < len(field.values) and not alike(value, field.values[index].item()):
            return index, f"value {index} was {value!r}, is {field.values[index].item()!r}"
    return 0, ""


def _time(topic: Topic, field: Field, index: int) -> float:
    """Return the robot time of the message with a value [s]."""
    message = min(int(np.searchsorted(field.ends, index, side="right")), len(topic.times) - 1)
    return float(topic.times[message]) * 1e-9
