"""Damage to a recording: each mutation takes a bag and gives another one in which one thing is worse.

    bag = RawBag.of(path)
    for mutation in mutations(bag, windows, seed=0):
        damaged = mutation.apply(bag)

A bag stays in memory as serialised messages, so that a mutation costs no more than the messages it changes. The law
that verdicts of such bags must keep is in `mutation_law`.

Not here: joint angles with the other sign, which are another posture that no reader can tell from a true one; and the
loss of every message of a contact on a topic that is silent while nothing touches, which leaves no trace.
"""

import math
import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from hric_bags.memory import MemoryBag, MemoryConnection

Row = tuple[MemoryConnection, int, bytes]
"""Connection, time of recording [ns], serialised message."""
Window = tuple[float, float]
"""Begin and end, time of the bag [s]."""
PEOPLE = ("/hric/human", "/hric/person")
"""Prefixes of the topics of a person."""
READ = (*PEOPLE, "/control_log", "/tf_static", "/robot_description", "/mocap", "/hric/safety/state")
"""Prefixes of the topics that a verdict reads."""
MANY = 10
"""Minimum number of messages of a topic that is thinned, cut and shifted; topics with fewer are events or latched."""
RATES = (100.0, 20.0, 5.0, 1.0)
"""Rates of throttled topics [Hz]."""
LOST = (0.05, 0.3, 0.9)
"""Shares of messages that are lost at random."""
SHIFTS = (0.2, -0.2, 5.0)
"""Times by which stamps are shifted [s]."""
CLIPPED = (0.9, 0.6, 0.3)
"""Levels at which a force is cut, as share of its peak."""
BLOW = 0.5
"""Longest duration of a blow [s]."""
MARGIN = 0.01
"""Margin by which a lost window is extended on both sides [s]."""


class RawBag(MemoryBag):
    """A bag in memory that is made of rows.

    Args:
        rows: in any order.
        connections: topics without messages included.
        like: a bag that has all types of this one, whose reader of messages is used again; None: none.
    """

    def __init__(
        self, rows: Iterable[Row], connections: Iterable[MemoryConnection], like: MemoryBag | None = None
    ) -> None:
        super().__init__()
        made: dict[int, MemoryConnection] = {}
        for connection in connections:
            made[id(connection)] = own = replace(connection, id=len(made), msgcount=0)
            self._by_topic[own.topic] = own
        self.connections = list(made.values())
        for connection, time, raw in sorted(rows, key=lambda row: row[1]):
            own = made[id(connection)]
            own.msgcount += 1
            self._messages.append((own, time, raw))
        self._first, self._deserialized = like is None, dict[tuple[str, bytes], Any]()
        if like is not None:
            self.typestore = like.typestore
        if isinstance(like, RawBag):
            self._deserialized = like._deserialized

    @classmethod
    def of(cls, path: Path) -> "RawBag":
        """Read a bag from its file."""
        with AnyReader([path]) as reader:
            made = {
                id(c): MemoryConnection(c.id, c.topic, c.msgtype, str(c.msgdef.data), c.digest)
                for c in reader.connections
            }
            return cls([(made[id(c)], time, bytes(raw)) for c, time, raw in reader.messages()], made.values())

    def deserialize(self, raw: bytes, kind: str) -> Any:
        """Return a message; those of the undamaged bag are made once, and nobody may change them."""
        if (message := self._deserialized.get((kind, raw))) is None:
            message = super().deserialize(raw, kind)
            if self._first:
                self._deserialized[kind, raw] = message
        return message

    @property
    def rows(self) -> Sequence[Row]:
        """All messages, in the order of their times."""
        return self._messages

    def times(self, topic: str) -> list[int]:
        """Times of a topic's messages [ns]."""
        return [time for connection, time, _ in self._messages if connection.topic == topic]

    def with_rows(self, rows: Iterable[Row], connections: Iterable[MemoryConnection] | None = None) -> "RawBag":
        """Return a bag of other rows; connections: None: the same ones."""
        return RawBag(rows, self.connections if connections is None else connections, self)

    def kept(self, keeps: Callable[[MemoryConnection, int], bool]) -> "RawBag":
        """Return a bag of those messages that are kept; keeps: by connection and time [ns]."""
        return self.with_rows(row for row in self._messages if keeps(row[0], row[1]))

    def edited(self, topics: Sequence[str], edit: Callable[[Any], None], share: float = 1.0, seed: int = 0) -> "RawBag":
        """Return a bag in which messages are changed; edit: changes a message; share: of the messages, at random."""
        draw = random.Random(seed).random
        return self.with_rows(
            self.changed(row, edit) if row[0].topic in topics and draw() < share else row for row in self._messages
        )

    def changed(self, row: Row, edit: Callable[[Any], None] | None) -> Row:
        """Return a row with its message changed; edit: None: not at all."""
        connection, time, raw = row
        if edit is None:
            return row
        message = super().deserialize(raw, connection.msgtype)
        edit(message)
        return connection, time, bytes(self.typestore.serialize_ros1(message, connection.msgtype))


@dataclass(frozen=True)
class Mutation:
    """Damage of one kind to a recording.

    Attributes:
        kind: strip, drop, cut, throttle, nan, sign, clip, second person, two publishers, swap, shift.
        name: name of the damage, with the topic.
        topics: topics that are changed, or added.
        apply: function that makes the damaged bag.
    """

    kind: str
    name: str
    topics: tuple[str, ...]
    apply: Callable[[RawBag], RawBag]

    def __str__(self) -> str:
        return self.name


def mutations(bag: RawBag, windows: Mapping[str, Window], seed: int = 0) -> list[Mutation]:
    """Return the mutations of a bag.

    Args:
        bag: bag to be damaged.
        windows: times of the findings, by their names; in these, messages are lost.
        seed: seed of all randomness, and of the choice of rates, shares, levels and shifts.
    """
    counts = {c.topic: c.msgcount for c in bag.connections if c.msgcount}
    read = [topic for topic in counts if topic.startswith(READ)]
    many = [topic for topic in read if counts[topic] >= MANY and not topic.endswith("/events")]
    kinds = {c.topic: c.msgtype for c in bag.connections}
    found = [strip(topic) for topic in read]
    for number, topic in enumerate(many):
        found += _losses(topic, windows, seed + number)
        found += [shift(topic, by, both) for by in (SHIFTS[seed % len(SHIFTS)],) for both in (False, True)]
        found += [nan(topic, field, share, seed) for field in NAN.get(kinds[topic], {}) for share in (1.0, 0.5)]
        if kinds[topic] in SIGN:
            found.append(Mutation("sign", f"sign of {topic}", (topic,), partial(_edit, topic, SIGN[kinds[topic]])))
        if kinds[topic] == CONTACTS:
            found.append(clip(topic, CLIPPED[(seed + 1) % len(CLIPPED)]))
    return found + list(_people(bag, many, kinds))


def _losses(topic: str, windows: Mapping[str, Window], seed: int) -> Iterator[Mutation]:
    yield drop(topic, LOST[(seed + 1) % len(LOST)], seed)
    for at in (1, 3):
        yield throttle(topic, RATES[(seed + at) % len(RATES)])
    for name, window in windows.items():
        yield lose(topic, name, window)
    for part in ("first", "last"):
        yield cut(topic, part, 0.4)


def _people(bag: RawBag, many: Sequence[str], kinds: Mapping[str, str]) -> Iterator[Mutation]:
    topics = tuple(c.topic for c in bag.connections if c.topic.startswith(PEOPLE))
    named = tuple(topic for topic in topics if kinds[topic] in NAMES)
    for name in sorted({topic[: topic.index("/", len("/hric/"))] for topic in topics}):
        own = tuple(topic for topic in topics if topic.startswith(f"{name}/"))
        beside = f"a calm second person beside {name}"
        yield Mutation("second person", beside, (f"{name}2",), partial(_second, name, own))
        for mixed in {own, tuple(topic for topic in own if kinds[topic] == STATES and topic in many)} - {()}:
            text = f"messages of somebody else on {', '.join(mixed)}"
            yield Mutation("two publishers", text, mixed, partial(_interleaved, mixed))
    for topic in named:
        yield Mutation("swap", f"left and right of {topic}", (topic,), partial(_swapped, (topic,)))
    if named:
        yield Mutation("swap", "left and right of all topics", named, partial(_swapped, named))


# -- what is lost ------------------------------------------------------------------------------------------------------


def strip(topic: str) -> Mutation:
    """Leave a topic out, as a recorder does that was not asked for it."""

    def apply(bag: RawBag) -> RawBag:
        rows = (row for row in bag.rows if row[0].topic != topic)
        return bag.with_rows(rows, [c for c in bag.connections if c.topic != topic])

    return Mutation("strip", f"no {topic}", (topic,), apply)


def drop(topic: str, share: float, seed: int) -> Mutation:
    """Lose a share of the messages at random."""

    def apply(bag: RawBag) -> RawBag:
        draw = random.Random(seed).random
        return bag.kept(lambda connection, _: connection.topic != topic or draw() >= share)

    return Mutation("drop", f"{100.0 * share:g} % of {topic} lost", (topic,), apply)


def lose(topic: str, name: str, window: Window) -> Mutation:
    """Lose all messages of a window; name: of the window."""
    begin, end = round((window[0] - MARGIN) * 1e9), round((window[1] + MARGIN) * 1e9)

    def apply(bag: RawBag) -> RawBag:
        return bag.kept(lambda connection, time: connection.topic != topic or not begin <= time <= end)

    return Mutation("drop", f"{topic} lost during {name} ({window[0]:.3f} to {window[1]:.3f} s)", (topic,), apply)


def cut(topic: str, part: str, share: float) -> Mutation:
    """Lose the first or the last share of the bag's time."""

    def apply(bag: RawBag) -> RawBag:
        at = bag.start_time + bag.duration * (share if part == "first" else 1.0 - share)
        return bag.kept(lambda connection, time: connection.topic != topic or (time > at) == (part == "first"))

    return Mutation("cut", f"{part} {100.0 * share:g} % of the time without {topic}", (topic,), apply)


def throttle(topic: str, rate: float) -> Mutation:
    """Keep no more messages than a rate [Hz] allows."""
    period = round(1e9 / rate)

    def apply(bag: RawBag) -> RawBag:
        last = -period

        def keeps(connection: MemoryConnection, time: int) -> bool:
            nonlocal last
            if connection.topic != topic:
                return True
            if time - last < period:
                return False
            last = time
            return True

        return bag.kept(keeps)

    return Mutation("throttle", f"{topic} at {rate:g} Hz", (topic,), apply)


# -- what is wrong -----------------------------------------------------------------------------------------------------

CONTACTS, STATES = "hric_msgs/msg/RegionContacts", "sensor_msgs/msg/JointState"
TORQUES, GRIPS, LOG = "hric_msgs/msg/JointTorque", "hric_msgs/msg/HumanGrip", "hric_msgs/msg/ControlLog"
ROOT, TRACKING = "geometry_msgs/msg/PoseStamped", "hric_msgs/msg/PersonTracking"


def _edit(topic: str, edit: Callable[[Any], None], bag: RawBag) -> RawBag:
    return bag.edited((topic,), edit)


def _set(value: float, *fields: str) -> Callable[[Any], None]:
    """Return an edit that sets fields, in arrays all values; nested fields are written with a dot."""

    def edit(message: Any) -> None:
        for field in fields:
            *inner, last = field.split(".")
            owner = message
            for name in inner:
                owner = getattr(owner, name)
            present = getattr(owner, last)
            setattr(owner, last, np.full_like(present, value) if isinstance(present, np.ndarray) else value)

    return edit


def _of_contacts(edit: Callable[[Any], None]) -> Callable[[Any], None]:
    def edit_all(message: Any) -> None:
        for contact in (*message.touching, *message.ended):
            edit(contact)

    return edit_all


def _one_joint(message: Any) -> None:
    message.position = np.array([math.nan, *message.position[1:]])


NAN: dict[str, dict[str, Callable[[Any], None]]] = {
    CONTACTS: {
        "force": _of_contacts(_set(math.nan, "force")),
        "peak": _of_contacts(_set(math.nan, "peak")),
        "force and peak": _of_contacts(_set(math.nan, "force", "peak")),
        "begin": _of_contacts(_set(math.nan, "begin")),
        "duration": _of_contacts(_set(math.nan, "duration")),
    },
    STATES: {"position": _set(math.nan, "position"), "position of one joint": _one_joint},
    TORQUES: {"torque": _set(math.nan, "torque", "strength_share")},
    GRIPS: {"force": _set(math.nan, "wrench.force.x", "wrench.force.y", "wrench.force.z")},
    LOG: {
        "position": _set(math.nan, "position"),
        "velocity": _set(math.nan, "velocity"),
        "time": _set(math.nan, "time"),
    },
    ROOT: {"position": _set(math.nan, "pose.position.x", "pose.position.y")},
    TRACKING: {"root": _set(math.nan, "root.position.x", "root.position.y", "root.position.z")},
}
"""Edits that set a value to NaN, by type of message and name of the value."""


def nan(topic: str, field: str, share: float, seed: int) -> Mutation:
    """Make a field NaN in a share of the messages, at random."""

    def apply(bag: RawBag) -> RawBag:
        kind = next(c.msgtype for c in bag.connections if c.topic == topic)
        return bag.edited((topic,), NAN[kind][field], share, seed)

    return Mutation("nan", f"NaN as {field} of {100.0 * share:g} % of {topic}", (topic,), apply)


def _negative(*fields: str) -> Callable[[Any], None]:
    def edit(message: Any) -> None:
        for field in fields:
            setattr(message, field, -getattr(message, field))

    return edit


def _negative_wrench(message: Any) -> None:
    for vector in (message.wrench.force, message.wrench.torque):
        _negative("x", "y", "z")(vector)


SIGN: dict[str, Callable[[Any], None]] = {
    CONTACTS: _of_contacts(_negative("force", "peak", "impulse")),
    TORQUES: _negative("torque", "strength_share"),
    GRIPS: _negative_wrench,
    LOG: _negative("effort"),
}


def clip(topic: str, level: float) -> Mutation:
    """Cut the force of each blow at a share of its peak, as a sensor at the end of its range does. What is held longer
    is left: a force clipped to a constant looks like a constant force."""

    def apply(bag: RawBag) -> RawBag:
        peaks: dict[tuple[str, str, float], float] = {}

        def note(contact: Any) -> None:
            key = contact.link, contact.other, contact.begin
            peak = math.inf if contact.duration > BLOW else contact.peak
            peaks[key] = max(peaks.get(key, 0.0), peak if peak > 0.0 else 0.0)

        def edit(contact: Any) -> None:
            top = level * peaks[contact.link, contact.other, contact.begin]
            contact.force, contact.peak = min(contact.force, top), min(contact.peak, top)

        for connection, _, raw in bag.rows:
            if connection.topic == topic:
                _of_contacts(note)(bag.deserialize(raw, connection.msgtype))
        return bag.edited((topic,), _of_contacts(edit))

    return Mutation("clip", f"forces of {topic} cut at {100.0 * level:g} % of their peaks", (topic,), apply)


def shift(topic: str, by: float, both: bool) -> Mutation:
    """Shift the stamps of a topic; both: its times of recording, too, as if it had happened then."""

    def apply(bag: RawBag) -> RawBag:
        shifted = bag.edited((topic,), partial(_shifted, by))
        if not both:
            return shifted
        late = round(by * 1e9)
        return bag.with_rows(
            ((c, max(0, time + late), raw) if c.topic == topic else (c, time, raw) for c, time, raw in shifted.rows),
            shifted.connections,
        )

    what = "stamps and times" if both else "stamps"
    return Mutation("shift", f"{what} of {topic} by {by:+g} s", (topic,), apply)


def _shifted(by: float, message: Any) -> None:
    if not hasattr(message, "header"):
        return
    stamp = message.header.stamp
    seconds, nanoseconds = divmod(max(0, stamp.sec * 10**9 + stamp.nanosec + round(by * 1e9)), 10**9)
    message.header.stamp = type(stamp)(sec=seconds, nanosec=nanoseconds)


# -- who it is ---------------------------------------------------------------------------------------------------------


def _calm_contacts(message: Any) -> None:
    message.touching, message.ended = [], []


def _bent(message: Any) -> None:
    message.position = message.position + 1.0


CALM: dict[str, Callable[[Any], None]] = {
    STATES: _set(0.0, "position", "velocity", "effort"),
    TORQUES: _set(0.0, "torque", "strength_share"),
    CONTACTS: _calm_contacts,
}
"""Messages of a person who hangs the arms and whom nothing touches."""
OTHER = {**CALM, STATES: _bent}
"""Messages of a person whom nothing touches, in another posture than the first: two who hold the same one, or nearly,
are one for any reader."""
LATER = 2_500_000
"""Delay of the second publisher's messages after those of the first [ns]."""


def _second(name: str, topics: Sequence[str], bag: RawBag) -> RawBag:
    """Return a bag in which a person's topics occur again below another name."""
    own = {c.topic: c for c in bag.connections if c.topic in topics}
    other = {topic: replace(c, topic=f"{name}2{topic.removeprefix(name)}") for topic, c in own.items()}
    rows = [bag.changed(row, CALM.get(row[0].msgtype)) for row in bag.rows if row[0].topic in other]
    added = [(other[connection.topic], time, raw) for connection, time, raw in rows]
    return bag.with_rows([*bag.rows, *added], [*bag.connections, *other.values()])


def _interleaved(topics: Sequence[str], bag: RawBag) -> RawBag:
    """Return a bag with messages of another person on the same topics."""

    def other(row: Row) -> Row:
        connection, time, raw = bag.changed(row, OTHER.get(row[0].msgtype))
        return bag.changed((connection, time + LATER, raw), partial(_shifted, 1e-9 * LATER))

    return bag.with_rows([*bag.rows, *(other(row) for row in bag.rows if row[0].topic in topics)])


def _other_side(name: str) -> str:
    for left, right in (("left_", "right_"), ("l_", "r_"), ("::l_", "::r_")):
        for ours, other in ((left, right), (right, left)):
            if (name.startswith(ours) and not ours.startswith("::")) or (ours.startswith("::") and ours in name):
                return name.replace(ours, other, 1)
    return name


def _swap_names(message: Any) -> None:
    message.name = [_other_side(name) for name in message.name]


def _swap_link(contact: Any) -> None:
    contact.link = _other_side(contact.link)


def _swap_holder(message: Any) -> None:
    message.holder = _other_side(message.holder)


NAMES: dict[str, Callable[[Any], None]] = {
    STATES: _swap_names,
    TORQUES: _swap_names,
    CONTACTS: _of_contacts(_swap_link),
    GRIPS: _swap_holder,
}
"""Edits that swap left and right in names of joints and links; flags, such as that of the dominant side, stay."""


def _swapped(topics: Sequence[str], bag: RawBag) -> RawBag:
    found = copy(bag)
    kinds = {c.topic: c.msgtype for c in bag.connections}
    for topic in topics:
        found = found.edited((topic,), NAMES[kinds[topic]])
    return found
