"""Simulated human as measured by emulated sensors: joints, grips and events, received on topics.

Joint positions are interpolated between two messages; `known` is the time up to which they are available.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from sensor_msgs.msg import JointState

from hric_core.errors import HricError, ParameterError
from hric_core.node import Node
from hric_core.parameters import anything
from hric_core.robot_time.stream_time import Clock
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import HumanEvent, HumanGrip
from hric_perception.replayed import RecentRows

HUMAN = "human"
"""Name of the simulated human next to the robot, and of their topics `hric/human/...`."""
PROGRAM = "body"
"""Value of the key `program` by which an emulated device measures the simulated human."""
PERSON: Any = anything(
    None,
    name="person",
    default_text="none",
    text="with `{program: body}`: section `human` of the experiment, with the simulated human and their place",
)


def person_of(value: Any, where: str) -> HumanSettings:
    """Return the settings of the simulated human from the parameter `person`.

    Args:
        value: value of the parameter.
        where: prefix of its name.

    Raises:
        ParameterError: the value is missing, or not valid.
    """
    if value is None:
        raise ParameterError(
            f"{where}person is not set, but {{program: {PROGRAM}}} measures a simulated human; valid: an experiment "
            "with a section human"
        )
    return HumanSettings.of(value, f"{where}person")


def check_joints(names: Sequence[str], expected: tuple[str, ...]) -> None:
    """Raise HricError if the joint names of a message are not those of the simulated human's body."""
    if tuple(names) != expected:
        valid = f"the joints of the section human, {', '.join(expected)}"
        raise HricError(f"the joint states of the human name {', '.join(names)}; valid: {valid}")


class JointTrack(RecentRows[tuple[Sequence[float], Sequence[float]]]):
    """Joint positions of a human over robot time, by cubic Hermite interpolation between messages; thread-safe.

    With messages every h = 5 ms the error is at most h^4 / 384 = 1.6e-12 s^4 times the fourth derivative. Before the
    first and after the last message positions are constant.

    Args:
        joints: names of the joints, in the order of the values.
    """

    def __init__(self, joints: Sequence[str]) -> None:
        super().__init__()
        self._joints = tuple(joints)

    def add(self, time: float, names: Sequence[str], q: Sequence[float], dq: Sequence[float]) -> None:
        """Add a joint state; one with an earlier time than the last clears the track.

        Args:
            time: robot time [s].
            names: names of the joints.
            q: joint positions, n floats [rad].
            dq: joint velocities, n floats [rad/s].

        Raises:
            HricError: the names are not those of the track.
        """
        check_joints(names, self._joints)
        self.store(time, (q, dq))

    def at(self, time: float) -> list[float] | None:
        """Return the joint positions at a robot time [s], n floats [rad]; None before the first message."""
        if not (rows := self.rows()):
            return None
        after = len(rows) - 1
        while after > 1 and rows[after - 1][0] > time:
            after -= 1
        (begin, (q, dq)), (end, (q_end, dq_end)) = rows[max(after - 1, 0)], rows[after]
        span = end - begin
        s = min(max((time - begin) / span, 0.0), 1.0) if span else 1.0
        a, b = s * s * (3.0 - 2.0 * s), span * s * (1.0 - s)
        return [
            (1.0 - a) * p + a * p_end + b * ((1.0 - s) * v - s * v_end)
            for p, p_end, v, v_end in zip(q, q_end, dq, dq_end, strict=True)
        ]


class KnownTime:
    """Clock that waits for measured values: it does not advance beyond the time up to which they are known.

    Args:
        clock: underlying clock.
        known: function that returns the time up to which values are known [s].
        ahead: largest lead over that time [s].
    """

    def __init__(self, clock: Clock, known: Callable[[], float], ahead: float = 0.0) -> None:
        self._clock, self._known, self._ahead = clock, known, ahead

    def now(self) -> float | None:
        """Return the time [s]; None if the clock's time is not known, or no values are known."""
        now, known = self._clock.now(), self._known() + self._ahead
        return None if now is None or known == -math.inf else min(now, known)

    def monotonic(self, run: float) -> int | None:
        """Return the monotonic time [ns] of a robot time [s], as the underlying clock does."""
        return self._clock.monotonic(run)


def always() -> float:
    """Return infinity: the values of a program are known for all times [s]."""
    return math.inf


class Held(NamedTuple):
    """Load of a grip on the human at an instant, in axes of the world.

    Attributes:
        time: robot time [s].
        name: name of the grip.
        force: force on the human [N].
        torque: torque on the human, about `point` [N m].
        point: point of application [m].
    """

    time: float
    name: str
    force: Sequence[float]
    torque: Sequence[float]
    point: Sequence[float]


def follow_joints(node: Node, add: Callable[[float, Sequence[str], Sequence[float], Sequence[float]], None]) -> None:
    """Subscribe to the simulated human's joint states; add: takes time [s], names, positions, velocities."""

    def on_state(message: Any) -> None:
        add(message.header.stamp.to_sec(), message.name, message.position, message.velocity)

    node.subscribe(_topic(node, "joint_states"), JointState, on_state, queue_size=0)


def follow_grips(node: Node, add: Callable[[Held], None]) -> None:
    """Subscribe to grips, and pass the load of each on the human to `add`; it is zero for grips of other bodies."""

    def on_grip(message: Any) -> None:
        prefix = f"{HUMAN}::"
        sign = float(message.holder.startswith(prefix)) - float(message.held.startswith(prefix))
        f, m, p = message.wrench.force, message.wrench.torque, message.point
        force, torque = [sign * value for value in (f.x, f.y, f.z)], [sign * value for value in (m.x, m.y, m.z)]
        add(Held(message.header.stamp.to_sec(), message.name, force, torque, (p.x, p.y, p.z)))

    node.subscribe(_topic(node, "grip"), HumanGrip, on_grip, queue_size=0)


def follow_events(node: Node, add: Callable[[float, str], None]) -> None:
    """Subscribe to events of the simulated human, and pass robot time [s] and kind of each to `add`."""

    def on_event(message: Any) -> None:
        add(message.header.stamp.to_sec(), message.kind)

    node.subscribe(_topic(node, "events"), HumanEvent, on_event, queue_size=0)


def _topic(node: Node, name: str) -> str:
    return node.beside(f"hric/{HUMAN}/{name}")


def measures_person(device: Any) -> bool:
    """Return True if the key `program` of an emulated device's mapping selects the simulated human."""
    return isinstance(device, Mapping) and device.get("program") == PROGRAM
