"""Decisions and events of the safety supervisor of a human-robot collaboration in a run. No ROS."""

from array import array
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from hric_bags.parts import Bag
from hric_bags.reader import FloatArray, opened, seconds

STATE_TYPE, EVENT_TYPE = "hric_msgs/msg/SafetyState", "hric_msgs/msg/SafetyEvent"
TYPES = (STATE_TYPE, EVENT_TYPE)
FREE, SLOWED, STOPPED = "free", "slowed", "stopped"
STATES = (FREE, SLOWED, STOPPED)
"""States of the supervisor; `SafetyRecord.state` has indices into this tuple."""


class SafetyEvent(NamedTuple):
    """Event that the supervisor noticed or caused.

    Attributes:
        time: robot time [s].
        kind, text: as in hric_msgs/SafetyEvent.
        separation, margin: distance at that time, and this minus the protective distance [m]; NaN if not known.
    """

    time: float
    kind: str
    text: str
    separation: float
    margin: float


@dataclass(frozen=True)
class SafetyRecord:
    """Record of n decisions of a supervisor.

    Attributes:
        mode: mode of the supervisor.
        time: robot time, shape (n,) [s].
        state: state as index into STATES, shape (n,), integers.
        fault: True if a fault made a decision impossible, shape (n,), booleans.
        violation: True if the arm moved closer than permitted, shape (n,), booleans.
        scale: requested speed scale, shape (n,) [1].
        separation, protective: smallest distance, and protective distance S_p of the body part with the smallest
            margin, shape (n,) [m]; NaN with a fault.
        margin: smallest margin of all body parts, separation minus S_p, shape (n,) [m].
        latency: time from a pose to the control cycle that applied the decision on it, shape (n,) [s]; NaN if none did.
        events: events in the order of time.
    """

    mode: str
    time: FloatArray
    state: np.ndarray
    fault: np.ndarray
    violation: np.ndarray
    scale: FloatArray
    separation: FloatArray
    protective: FloatArray
    margin: FloatArray
    latency: FloatArray
    events: tuple[SafetyEvent, ...]

    def share(self, state: str) -> float:
        """Return the share of the time from first to last decision in which the supervisor was in a state [1]."""
        return self._share(self.state == STATES.index(state))

    @property
    def share_unknown(self) -> float:
        """Share of the time from first to last decision in which the separation was not known [1]."""
        return self._share(np.isnan(self.separation))

    def _share(self, chosen: np.ndarray) -> float:
        if len(self.time) < 2:
            return float(np.mean(chosen))
        period = np.diff(self.time)
        return float(period[chosen[:-1]].sum() / period.sum())

    def stretches(self, state: str) -> list[tuple[float, float]]:
        """Return begin and end of each time interval in a state [s]; the last one ends with the record."""
        return self._stretches(self.state == STATES.index(state))

    @property
    def violations(self) -> list[tuple[float, float]]:
        """Begin and end of each time interval in which the arm moved closer than permitted [s]."""
        return self._stretches(self.violation)

    def _stretches(self, chosen: np.ndarray) -> list[tuple[float, float]]:
        edges = np.flatnonzero(np.diff(np.concatenate(([False], chosen, [False])).astype(int)))
        last = len(self.time) - 1
        return [(float(self.time[a]), float(self.time[min(b, last)])) for a, b in edges.reshape(-1, 2)]


class SafetyMessages:
    """Collector of the messages of a safety supervisor."""

    def __init__(self) -> None:
        self._mode, self._rows, self._events = "", array("d"), list[tuple[float, Any]]()

    def add(self, kind: str, message: Any) -> None:
        """Add a hric_msgs/SafetyState or hric_msgs/SafetyEvent; kind: its message type, one of TYPES."""
        stamp = seconds(message.header.stamp)
        if kind == EVENT_TYPE:
            self._events.append((stamp, message))
            return
        self._mode = str(message.mode)
        numbers = (message.scale, message.separation, message.protective, message.margin, message.latency)
        code = STATES.index(message.state)
        self._rows.extend((stamp, code, bool(message.fault), message.violation, *numbers))

    def record(self, robot_time: Callable[[float], float]) -> SafetyRecord | None:
        """Return the record of all messages; None: there was no decision.

        Args:
            robot_time: function from a stamp to robot time [s].
        """
        if not self._rows:
            return None
        rows = np.array(self._rows).reshape(-1, 9)
        rows[:, 0] = [robot_time(stamp) for stamp in rows[:, 0].tolist()]
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        time, state, fault, violation, scale, separation, protective, margin, latency = rows.T
        events = (
            SafetyEvent(
                robot_time(stamp), str(event.kind), str(event.text), float(event.separation), float(event.margin)
            )
            for stamp, event in self._events
        )
        return SafetyRecord(
            self._mode,
            time,
            state.astype(int),
            fault > 0.0,
            violation > 0.0,
            scale,
            separation,
            protective,
            margin,
            latency,
            tuple(sorted(events, key=lambda event: event.time)),
        )


def read(bag: Path | Bag, robot_time: Callable[[float], float]) -> SafetyRecord | None:
    """Read the record of the safety supervisor from a bag with all its parts; None: there was no supervisor.

    Raises:
        BagError: the bag is missing or damaged.
    """
    taken = SafetyMessages()
    with opened(bag) as reader:
        for connection, _, raw in reader.chosen(lambda c: c.msgtype in TYPES):
            taken.add(connection.msgtype, reader.deserialize(raw, connection.msgtype))
    return taken.record(robot_time)
