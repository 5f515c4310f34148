"""The human in the robot's plant, as those see him who measure him: his joints between two of his messages, and up to
when they are known."""

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from sensor_msgs.msg import JointState

from hric_control.errors import HricError, ParameterError
from hric_control.node import Node
from hric_control.parameters import anything
from hric_control.robot_time.stream_time import Clock
from hric_human.participant.settings import HumanSettings
from hric_msgs.msg import HumanEvent, HumanGrip
from hric_perception.replayed import HISTORY

HUMAN = "human"
"""Name of who is beside the robot, and of his topics below `hric/`."""
PROGRAM = "body"
"""Name of the programs of emulated devices that measure him."""
PERSON: Any = anything(
    None,
    name="person",
    default_text="none",
    text="with `{program: body}`: the section `human` of the experiment, that is, who is in the plant, and where",
)


def person_of(given: Any, where: str) -> HumanSettings:
    """The parameter `person`.

    Args:
        given: its value.
        where: prefix of its name.

    Raises:
        ParameterError: it is not given, or not valid.
    """
    if given is None:
        raise ParameterError(
            f"{where}person is not set, and {{program: {PROGRAM}}} measures the human in the robot's plant; valid: an "
            "experiment with a section human"
        )
    return HumanSettings.of(given, f"{where}person")


def check_joints(names: Sequence[str], own: tuple[str, ...]) -> None:
    """Raises HricError where joint states are those of another body."""
    if tuple(names) != own:
        raise HricError(f"the joints are {', '.join(names)}; valid: those of the section human, {', '.join(own)}")


class _Row(NamedTuple):
    time: float
    q: Sequence[float]
    dq: Sequence[float]


class JointTrack:
    """Joint positions at any time between the messages that gave positions and velocities, by cubics (Hermite): with
    messages at 200 Hz they are exact but for 5e-12 s^4 of the fourth derivative. Before the first and after the last
    message they are constant. From any thread.

    Args:
        joints: names, in the order of the values.
    """

    def __init__(self, joints: Sequence[str]) -> None:
        self._joints, self._lock = tuple(joints), threading.Lock()
        self._rows: deque[_Row] = deque()

    def add(self, time: float, names: Sequence[str], q: Sequence[float], dq: Sequence[float]) -> None:
        """One message; an earlier time begins again, the same one replaces.

        Args:
            time: of robot [s].
            names: of the joints.
            q, dq: n floats each [rad], [rad/s].

        Raises:
            HricError: these are other joints.
        """
        check_joints(names, self._joints)
        with self._lock:
            if self._rows and time < self._rows[-1].time:
                self._rows.clear()
            elif self._rows and time == self._rows[-1].time:
                self._rows.pop()
            self._rows.append(_Row(time, q, dq))
            while self._rows[0].time < time - HISTORY:
                self._rows.popleft()

    @property
    def known(self) -> float:
        """Time of the last message [s]; before all times where there is none."""
        with self._lock:
            return self._rows[-1].time if self._rows else -math.inf

    def at(self, time: float) -> list[float] | None:
        """Joint positions, n floats [rad]; None before the first message."""
        with self._lock:
            if not self._rows:
                return None
            after = len(self._rows) - 1
            while after > 1 and self._rows[after - 1].time > time:
                after -= 1
            begin, end = self._rows[max(after - 1, 0)], self._rows[after]
        return _between(begin, end, time)


def _between(begin: _Row, end: _Row, time: float) -> list[float]:
    """On the cubic that has positions and velocities of both."""
    span = end.time - begin.time
    s = min(max((time - begin.time) / span, 0.0), 1.0) if span else 1.0
    a, b = s * s * (3.0 - 2.0 * s), span * s * (1.0 - s)
    return [
        (1.0 - a) * q + a * q_end + b * ((1.0 - s) * dq - s * dq_end)
        for q, q_end, dq, dq_end in zip(begin.q, end.q, begin.dq, end.dq, strict=True)
    ]


class KnownTime:
    """A clock that waits for what is measured: it does not go beyond what is known.

    Args:
        clock: by which it goes else.
        known: up to when it is known [s].
        ahead: by which it may be beyond that [s].
    """

    def __init__(self, clock: Clock, known: Callable[[], float], ahead: float = 0.0) -> None:
        self._clock, self._known, self._ahead = clock, known, ahead

    def now(self) -> float | None:
        """The time [s]; None while it is not known, or nothing that is measured."""
        now, known = self._clock.now(), self._known() + self._ahead
        return None if now is None or known == -math.inf else min(now, known)

    def monotonic(self, run: float) -> int | None:
        """See Clock."""
        return self._clock.monotonic(run)


def always() -> float:
    """Up to when it is known what a program does [s]."""
    return math.inf


class Held(NamedTuple):
    """What a grip does to him at an instant, in axes of the world.

    Attributes:
        time: of robot [s].
        name: of the grip.
        force: on him [N].
        torque: on him, about `point` [N m].
        point: where both act [m].
    """

    time: float
    name: str
    force: Sequence[float]
    torque: Sequence[float]
    point: Sequence[float]


def follow_joints(node: Node, add: Callable[[float, Sequence[str], Sequence[float], Sequence[float]], None]) -> None:
    """Give each of his joint states to `add`, see `JointTrack`."""

    def on_state(message: Any) -> None:
        add(message.header.stamp.to_sec(), message.name, message.position, message.velocity)

    node.subscribe(_topic(node, "joint_states"), JointState, on_state, queue_size=0)


def follow_grips(node: Node, add: Callable[[Held], None]) -> None:
    """Give what each grip does to him to `add`; a grip that somebody else has does nothing."""

    def on_grip(message: Any) -> None:
        own = f"{HUMAN}::"
        sign = float(message.holder.startswith(own)) - float(message.held.startswith(own))
        f, m, p = message.wrench.force, message.wrench.torque, message.point
        force, torque = [sign * value for value in (f.x, f.y, f.z)], [sign * value for value in (m.x, m.y, m.z)]
        add(Held(message.header.stamp.to_sec(), message.name, force, torque, (p.x, p.y, p.z)))

    node.subscribe(_topic(node, "grip"), HumanGrip, on_grip, queue_size=0)


def follow_events(node: Node, add: Callable[[float, str], None]) -> None:
    """Give time [s] and kind of what happens to him to `add`."""

    def on_event(message: Any) -> None:
        add(message.header.stamp.to_sec(), message.kind)

    node.subscribe(_topic(node, "events"), HumanEvent, on_event, queue_size=0)


def _topic(node: Node, name: str) -> str:
    return node.beside(f"hric/{HUMAN}/{name}")


def measures_him(device: Any) -> bool:
    """Whether a mapping with `program`, of an emulated device, says that it measures him."""
    return isinstance(device, Mapping) and device.get("program") == PROGRAM
