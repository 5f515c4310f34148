"""Contact forces in a bag (gazebo_msgs/ContactsState), and which of them may be compared with limits. No ROS."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hric_bags.parts import Bag
from hric_bags.reader import opened, seconds
from hric_control.sim import contact_info
from hric_core.errors import HricError

CONTACTS_TYPE = "gazebo_msgs/msg/ContactsState"
PENALTY = "penalty"
REMEDY = (
    "give one of the two contact: penalty (of the object in the world file, or plant/surfaces for a link) and run again"
)


class RigidForceError(HricError):
    """Error for a contact force that must not be assessed, because no real sensor would measure it."""


@dataclass
class PairForce:
    """Contact of two bodies in a run.

    Attributes:
        body_a, body_b: "model::link" names, in alphabetical order.
        kind: contact model: "penalty" (spring and damper), "rigid", or "unknown" in old bags; of several kinds one that
            must not be assessed.
        peak_force: largest force [N]; for penalty contact of all simulation steps, else of the recorded instants.
        time: robot time of the message with the largest force [s].
        first, last: robot time of the first and the last message with this pair [s].
    """

    body_a: str
    body_b: str
    kind: str
    peak_force: float
    time: float
    first: float
    last: float


def read(bag: Path | Bag, robot_time: Callable[[float], float]) -> list[PairForce]:
    """Return all pairs of bodies that touched in a bag; empty: no contact, or the bag has no such topic."""
    pairs: dict[tuple[str, str], PairForce] = {}
    with opened(bag) as reader:
        contacts = [c for c in reader.connections if c.msgtype == CONTACTS_TYPE]
        for connection, _, raw in reader.messages(connections=contacts) if contacts else ():
            message = reader.deserialize(raw, connection.msgtype)
            add_to(pairs, message, robot_time(seconds(message.header.stamp)))
    return [pairs[key] for key in sorted(pairs)]


def add_to(pairs: dict[tuple[str, str], PairForce], message: Any, time: float) -> None:
    """Add the contacts of a message at a robot time [s]; pairs: contacts so far, by the names of both bodies."""
    for state in message.states:
        _add(pairs, state, time)


def _add(pairs: dict[tuple[str, str], PairForce], state: Any, time: float) -> None:
    a, b = sorted((str(state.collision1_name), str(state.collision2_name)))
    info = contact_info.read(str(state.info))
    force = state.total_wrench.force
    peak = max(math.sqrt(force.x**2 + force.y**2 + force.z**2), info.peak or 0.0)
    pair = pairs.setdefault((a, b), PairForce(a, b, info.kind, -1.0, time, time, time))
    if info.kind != PENALTY:
        pair.kind = info.kind
    if peak > pair.peak_force:
        pair.peak_force, pair.time = peak, time
    pair.last = time


def assessable(pairs: Iterable[PairForce]) -> list[PairForce]:
    """Return the pairs, after checking that their forces may be compared with limits for persons.

    Raises:
        RigidForceError: the contact of a pair is not a penalty contact; the message names the pair and the remedy.
    """
    known = list(pairs)
    for pair in known:
        if pair.kind != PENALTY:
            why = (
                "the kind of contact is not known"
                if pair.kind == contact_info.UNKNOWN
                else "it is two to six times the transient of an elastic contact"
            )
            raise RigidForceError(
                f"the force of {pair.body_a} on {pair.body_b} ({pair.kind} contact) cannot be assessed: {why}; {REMEDY}"
            )
    return known


def cells(pairs: Sequence[PairForce]) -> list[tuple[str, ...]]:
    """Return one row of a table for each pair, with the columns of `HEAD`."""
    return [
        (
            f"{pair.body_a}, {pair.body_b}",
            pair.kind,
            f"{pair.peak_force:.2f}",
            f"{pair.time:.3f}",
            f"{pair.first:.3f}",
            f"{pair.last:.3f}",
        )
        for pair in pairs
    ]


HEAD = ("contact between", "kind", "peak force [N]", "time of peak [s]", "first [s]", "last [s]")
"""Column heads of the table that `cells` returns."""


def note(pairs: Sequence[PairForce]) -> str:
    """Return a warning about forces that must not be assessed; empty: all may be assessed."""
    if all(pair.kind == PENALTY for pair in pairs):
        return ""
    return (
        "Forces of contacts other than penalty contacts are two to six times the transient of an elastic contact and "
        f"must not be assessed; {REMEDY}."
    )
