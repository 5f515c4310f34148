"""Contact forces in a bag (gazebo_msgs/ContactsState), and which of them may be compared with limits. No ROS."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hric_bags.parts import Bag
from hric_bags.reader import opened, seconds
from hric_control.sim import contact_info
from hric_core.errors import HricError

CONTACTS_TYPE = "gazebo_msgs/msg/ContactsState"
FloatArray = npt.NDArray[np.float64]
PENALTY = "penalty"
REFERENCE, MEASURED = "/reference_force", "/measured_force"
"""Topics of a force controller below its name."""
SETTLING = 0.5
"""Time after a change of the desired force that is not counted [s] (project default, unconfirmed)."""
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


@dataclass(frozen=True)
class ForceHeld:
    """Force that a force controller held on a surface, from 0.5 s after each change of the desired force.

    Attributes:
        desired: mean desired force [N].
        seconds: time that the other values are computed from [s].
        estimate_rms_error: RMS error of the force that the arm estimates, along the desired force [N].
        contact_rms_error: likewise, of the recorded contacts of the arm [N]; None: no contacts were recorded.
    """

    desired: float
    seconds: float
    estimate_rms_error: float
    contact_rms_error: float | None


def forces_held(bag: Path | Bag, robot_time: Callable[[float], float]) -> dict[str, ForceHeld]:
    """Return the force that each force controller held in a bag, by the name of its topics; empty: there is none."""
    series: dict[str, list[tuple[float, FloatArray]]] = {}
    arms: dict[str, str] = {}  # prefix of the links' names by controller
    with opened(bag) as reader:
        names = [c.topic.removesuffix(REFERENCE) for c in reader.connections if c.topic.endswith(REFERENCE)]
        topics = {f"{name}{topic}" for name in names for topic in (REFERENCE, MEASURED)}
        chosen = [c for c in reader.connections if names and (c.msgtype == CONTACTS_TYPE or c.topic in topics)]
        for connection, _, raw in reader.messages(connections=chosen) if chosen else ():
            message = reader.deserialize(raw, connection.msgtype)
            time = robot_time(seconds(message.header.stamp))
            if connection.msgtype == CONTACTS_TYPE:
                for name, arm in arms.items():
                    series.setdefault(f"{name}{CONTACTS_TYPE}", []).append((time, _on_others(message, arm)))
            else:
                arms[connection.topic.rpartition("/")[0]] = f"{str(message.header.frame_id).removesuffix('_link0')}::"
                series.setdefault(connection.topic, []).append((time, _vector(message.wrench.force)))
    held = {name: _held(series, name) for name in names}
    return {name: force for name, force in held.items() if force is not None}


def _held(series: dict[str, list[tuple[float, FloatArray]]], name: str) -> ForceHeld | None:
    """Return the force that a controller held; None: never for long enough."""
    times, vectors = (np.array(values) for values in zip(*series[f"{name}{REFERENCE}"], strict=True))
    desired = np.linalg.norm(vectors, axis=1)
    changed = np.diff(desired, prepend=0.0) != 0.0
    settled = (desired > 0.0) & (times - np.maximum.accumulate(np.where(changed, times, -np.inf)) >= SETTLING)
    if not settled.any():
        return None

    def rms_error(topic: str) -> float | None:
        samples = series.get(topic, [])
        index = [int(np.searchsorted(times, time, "right")) - 1 for time, _ in samples]
        errors = [
            v @ vectors[k] / desired[k] - desired[k]
            for (_, v), k in zip(samples, index, strict=True)
            if k >= 0 and settled[k]
        ]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    estimated = rms_error(f"{name}{MEASURED}")
    period = float(np.median(np.diff(times)))
    return (
        None
        if estimated is None
        else ForceHeld(
            float(desired[settled].mean()), period * int(settled.sum()), estimated, rms_error(f"{name}{CONTACTS_TYPE}")
        )
    )


def _on_others(message: Any, arm: str) -> FloatArray:
    """Return the force of an arm on all other bodies, shape (3,) [N]; arm: prefix of the names of its links."""
    force = np.zeros(3)
    for state in message.states:
        # The wrench acts on the first body.
        sign = float(str(state.collision2_name).startswith(arm)) - float(str(state.collision1_name).startswith(arm))
        force += sign * _vector(state.total_wrench.force)
    return force


def _vector(message: Any) -> FloatArray:
    return np.array([message.x, message.y, message.z])


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
