"""Detection of two publishers on one topic, and of a clock that goes back, from the bytes of all messages. No ROS."""

from array import array
from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from hric_bags.reader import BagError, FloatArray
from hric_bags.records.rows import stamp_of
from hric_human.body.joints import joints
from hric_human.body.subject import PARTS

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
WINDOW = 200
"""Number of successive messages that are examined together (project default)."""
BLOCK = 5 * WINDOW
"""Number of messages that are stored before they are examined (project default)."""
FASTEST_JOINT = 150.0
"""Largest joint velocity of a person [rad/s]; a baseball pitcher's shoulder has 122 rad/s (unconfirmed)."""
FASTEST_AXIS = 20.0
"""Largest joint velocity of an arm [rad/s]; small industrial wrists have 12.6 rad/s (unconfirmed)."""
BACK_IN_TIME = 0.5
"""Largest time by which a stamp may be older than the newest one of its publisher [s] (project default, unconfirmed).

Drivers on a busy machine swap messages by less; a clock that is set back, or a second run, moves the stamps by more.
"""
STEP = 1e-3
"""Minimum time between two poses from which a speed is computed [s], so that equal stamps do not give infinity."""
SWITCHES, BACK = 3, 0.25
"""Limits for jumps of a joint away and back in the next message, as of two mixed sources.

One source makes at most SWITCHES of them within WINDOW messages. A joint is back if it is nearer to its position before
than the share BACK of the jump [1] (project defaults, unconfirmed).
"""
MANY_PAIRS = 20
"""Largest number of successive pairs of close stamps that jitter can explain (project default, unconfirmed)."""
ARM_JOINTS = 4
"""Minimum number of joints of an arm; a gripper on the same topic has fewer (project default, unconfirmed)."""
JOINTS = frozenset(joint.name for joint in joints(PARTS["whole_body"]))
"""Names of the joints of human bodies, as `hric_human` describes them."""
PERSONS = "two persons in one namespace cannot be told apart; valid: a namespace for each, such as hric/human2"
ARMS = "two arms on one topic cannot be told apart; valid: a topic for each"


def publishers(connections: Iterable[Any]) -> list[str]:
    """Return the names of the nodes that publish some connections, as far as the bag has them."""
    return sorted({name for c in connections if (name := getattr(getattr(c, "ext", None), "callerid", None))})


def check_names(topic: str, names: Iterable[str]) -> None:
    """Raise BagError if the names in a message of a topic are not unique."""
    counted = list(names)
    if double := sorted({name for name in counted if counted.count(name) > 1}):
        raise BagError(f"{topic}: {', '.join(double)} twice in one message; valid: each name once")


class RisingStamps:
    """Checker of the stamps of each publisher: a clock that is set back, or a second run, is refused."""

    def __init__(self) -> None:
        self._newest: dict[tuple[str, ...], int] = {}

    def note(self, connection: Any, raw: bytes) -> None:
        """Check the next serialised message, which begins with a header. Raises BagError."""
        stream, stamp = (connection.topic, *publishers([connection])), stamp_of(raw)
        newest = self._newest.get(stream, stamp)
        if stamp < newest - 1e9 * BACK_IN_TIME:
            raise BagError(
                f"{connection.topic}: the stamps go back from {1e-9 * newest:.3f} to {1e-9 * stamp:.3f} s, as if a "
                "clock was set back or a run started again; valid: the bag of one run, such as `rosbag filter` makes"
            )
        self._newest[stream] = max(stamp, newest)


class RecordedJointStates:
    """Checker of the joint states on one topic: they must come from one person, or one arm.

    Args:
        topic: absolute name of the topic.
    """

    def __init__(self, topic: str) -> None:
        self._topic, self._count = topic, 0
        self._bodies: dict[bytes, _Body] = {}
        self._last = b""
        self._changes: deque[int] = deque(maxlen=SWITCHES + 1)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all joints."""
        return tuple(dict.fromkeys(name for body in self._bodies.values() for name in body.names))

    def note(self, connection: Any, raw: bytes) -> None:
        """Check the next serialised message.

        Raises:
            BagError: the messages come from two bodies, or a name occurs twice.
        """
        begin = 16 + _integer(raw, 12)
        if raw[begin : begin + len(self._last)] != self._last or not self._last:
            self._change(_names(raw, begin))
        body = self._bodies[self._last]
        body.nodes[getattr(getattr(connection, "ext", None), "callerid", None) or ""] = None
        if len(body.nodes) > 1 or body.add(raw, begin + len(self._last)):
            self._check(body)
        self._count += 1

    def end(self) -> None:
        """Check the messages that were not examined yet. Raises BagError as `note`."""
        for body in self._bodies.values():
            self._check(body)

    def _change(self, block: bytes) -> None:
        """Switch to messages with other joint names, and check if they may alternate; block: serialised names."""
        if self._last:
            self._changes.append(self._count)
        self._last = block
        if block not in self._bodies:
            self._bodies[block] = body = _Body(block)
            check_names(self._topic, body.names)
        bodies = self._bodies.values()
        if any(body.person for body in bodies):
            if len(self._changes) > SWITCHES and self._changes[-1] - self._changes[0] < WINDOW:
                raise BagError(f"{self._topic}: its messages alternate between different joint names; {PERSONS}")
        else:
            arms = [set(body.names) for body in bodies if len(body.names) >= ARM_JOINTS]
            if any(not arms[0] & other for other in arms[1:]):
                raise BagError(f"{self._topic}: some messages have {min(arms[0])}, others no joint of this arm; {ARMS}")

    def _check(self, body: "_Body") -> None:
        persons = any(other.person for other in self._bodies.values())
        nodes = {name for other in self._bodies.values() for name in other.nodes} if persons else body.nodes
        named = sorted(name for name in nodes if name)
        why = f"two publishers, {' and '.join(named)}" if len(named) > 1 else body.mixed()
        if why:
            raise BagError(f"{self._topic}: {why}; {PERSONS if persons else ARMS}")


class _Body:
    """Collector of joint states with one list of joint names; block: the names as serialised."""

    def __init__(self, block: bytes) -> None:
        self.names, at = list[str](), 4
        while at < len(block):
            end = at + 4 + _integer(block, at)
            self.names.append(block[at + 4 : end].decode(errors="replace"))
            at = end
        self.person = bool(JOINTS & set(self.names))
        self.nodes: dict[str, None] = {}
        self._numbers, self._stamps, self._positions = array("q"), array("d"), array("d")

    def add(self, raw: bytes, at: int) -> bool:
        """Add a message whose positions begin at byte `at`; return True once BLOCK messages are stored."""
        if _integer(raw, at) == len(self.names):  # else it is refused or left out by its reader
            self._numbers.append(_integer(raw, 0))
            self._stamps.append(_integer(raw, 4) + 1e-9 * _integer(raw, 8))
            self._positions.frombytes(raw[at + 4 : at + 4 + 8 * len(self.names)])
        return len(self._stamps) >= BLOCK

    def mixed(self) -> str:
        """Return evidence that two publishers alternate, else ""; drop all but the last WINDOW messages."""
        numbers, stamps = np.array(self._numbers), np.array(self._stamps)
        positions = np.array(self._positions).reshape(len(stamps), len(self.names))
        for values, width in ((self._numbers, 1), (self._stamps, 1), (self._positions, positions.shape[-1])):
            del values[: max(len(stamps) - WINDOW, 0) * width]
        if numbers.any() and (at := _many(np.diff(numbers) <= 0)) is not None:
            return f"repeated sequence numbers, from {stamps[at]:.3f} s on"
        if (at := _many(_away_and_back(stamps, positions, FASTEST_JOINT if self.person else FASTEST_AXIS))) is not None:
            return f"poses of another body than before and after, from {stamps[at]:.3f} s on"
        steps = np.diff(stamps)
        pairs = steps[:-1] < 0.5 * steps[1:]
        for paired in (pairs[::2], pairs[1::2]):
            ends = np.flatnonzero(np.diff(np.concatenate([[False], paired, [False]])))
            if (ends[1::2] - ends[::2] > MANY_PAIRS).any():
                return "stamps that come in pairs"
        return ""


def _away_and_back(stamps: FloatArray, positions: FloatArray, fastest: float) -> BoolArray:
    """Return a mask, shape (n - 2,), of poses that jump faster than `fastest` [rad/s] and back in the next message."""
    if len(stamps) < 3 or not positions.size:
        return np.zeros(0, dtype=bool)
    steps = np.maximum(np.diff(stamps)[:-1], STEP)
    with np.errstate(invalid="ignore"):
        away = np.abs(positions[1:-1] - positions[:-2]).max(axis=1)
        back = np.abs(positions[2:] - positions[:-2]).max(axis=1)
        return np.asarray((away > fastest * steps) & (back < BACK * away))


def _many(events: BoolArray) -> int | None:
    """Return the first index from which over SWITCHES events are within WINDOW messages; None: there is none."""
    at = np.flatnonzero(events)
    near = np.flatnonzero(at[SWITCHES:] - at[: max(len(at) - SWITCHES, 0)] < WINDOW)
    return int(at[near[0]]) if len(near) else None


def _integer(raw: bytes, at: int) -> int:
    return int.from_bytes(raw[at : at + 4], "little")


def _names(raw: bytes, begin: int) -> bytes:
    """Return the serialised names of a message; begin: their first byte."""
    at = begin + 4
    for _ in range(_integer(raw, begin)):
        at += 4 + _integer(raw, at)
    return bytes(raw[begin:at])
