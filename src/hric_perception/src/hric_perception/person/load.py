"""Muscle load of a tracked person, computed in a separate thread, so that it does not delay the tracking."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Vector3, Wrench
from numpy.typing import NDArray

from hric_core.geometry import stamped
from hric_core.node import Node
from hric_core.robot_time import stamps
from hric_motion.live_load import AWAY, MISSING, HandForce, LiveLoad, PersonLoad
from hric_motion.tracking import LOST, MEASURED, PersonEstimate
from hric_msgs.msg import JointReactions, JointTorque, MuscleActivation
from hric_msgs.msg import PersonLoad as PersonLoadMessage
from hric_perception.person.hand_force import source_of
from hric_perception.person.settings import HandForceSettings
from hric_perception.stream import OK, START, WARN, Driver, StreamReport

PORTION = 0.05
"""Time span of the mocap frames whose muscle load is computed together [s of the stamps]: many cost little more.

The constants of this file are project defaults, unconfirmed.
"""
BACKLOG = 1000
"""Largest number of waiting frames and force samples; the oldest are dropped."""
RECENT = 1.0
"""Longest time after the last frame with the person for which force samples are still used [s of the stamps]."""
WAIT = 0.1
"""Time between checks whether the node shuts down [s]."""
FULL = 1.0 - 1e-9
"""Activation from which a muscle, and torque over strength from which a joint counts as saturated [1]."""


class TrackerFrame(NamedTuple):
    """Result of the person tracker for one mocap frame.

    Attributes:
        live: muscle load computation of the tracked body.
        estimate: posture estimated by the tracker.
        frame_id: tf frame of the markers.
    """

    live: LiveLoad
    estimate: PersonEstimate
    frame_id: str


class Arrivals:
    """Counter of how often each of several values has reached its limit.

    Attributes:
        counts: how often each value has reached its limit.
        there: True for each value that is at its limit now.
    """

    def __init__(self, size: int) -> None:
        self.counts, self.there = np.zeros(size, int), np.zeros(size, np.bool_)

    def update(self, there: NDArray[np.bool_]) -> None:
        """Store which values are at their limit, and count those that were not at it before."""
        self.counts += there & ~self.there
        self.there = there


class LoadMessages:
    """Converter of the muscle load of one body to ROS messages.

    Args:
        live: muscle load computation of the body.
        hand: side of the hand whose force is measured; "": none.
    """

    def __init__(self, live: LiveLoad, hand: str) -> None:
        self._links, self._hand = live.links, hand
        self._strong, self._full = Arrivals(len(live.joints)), Arrivals(len(live.names))

    def count(self, person_load: PersonLoad, row: int) -> None:
        """Count newly saturated joints and muscles at instant `row`; call it before making messages of that instant."""
        self._strong.update(np.abs(person_load.load.share[row]) >= FULL)
        self._full.update(person_load.load.activation[row] >= FULL)

    def torque(self, head: Any, person_load: PersonLoad, row: int) -> Any:
        """Return hric_msgs/JointTorque of instant `row`; NaN for an arm whose markers are lost."""
        return JointTorque(
            header=head,
            name=person_load.load.joints,
            torque=person_load.load.torque[row].tolist(),
            strength_share=person_load.load.share[row].tolist(),
            at_strength=self._strong.there.tolist(),
            clipped=self._strong.counts.tolist(),
        )

    def activation(self, head: Any, person_load: PersonLoad, row: int) -> Any:
        """Return hric_msgs/MuscleActivation of instant `row`; excitation is NaN: static optimisation has none."""
        return MuscleActivation(
            header=head,
            name=person_load.load.names,
            excitation=[math.nan] * len(person_load.load.names),
            activation=person_load.load.activation[row].tolist(),
            at_limit=self._full.there.tolist(),
            limited=self._full.counts.tolist(),
        )

    def reactions(self, head: Any, person_load: PersonLoad, row: int) -> Any:
        """Return hric_msgs/JointReactions of instant `row`: contact forces between the bones."""
        names = list(person_load.load.contact)
        return JointReactions(
            header=head,
            joint_names=names,
            link_names=[self._links[name] for name in names],
            positions=[Point(*person_load.load.centres[name][row].tolist()) for name in names],
            wrenches=[Wrench(Vector3(*person_load.load.contact[name][row].tolist()), Vector3()) for name in names],
        )

    def load(self, head: Any, person_load: PersonLoad, row: int, behind: float) -> Any:
        """Return hric_msgs/PersonLoad of instant `row`; behind: robot time since that instant [s]."""
        return PersonLoadMessage(
            header=head,
            side=list(person_load.states),
            state=[states[row] for states in person_load.states.values()],
            outside=[bool(person_load.load.outside[side][row]) for side in person_load.states],
            hand=self._hand,
            force=person_load.force[row],
            wrench=Wrench(
                Vector3(*person_load.acting.force[row].tolist()), Vector3(*person_load.acting.torque[row].tolist())
            ),
            point=Point(*person_load.acting.point[row].tolist()),
            distance=float(person_load.distance[row]),
            behind=behind,
        )


class LoadThread(Driver):
    """Thread that computes and publishes the muscle load of a tracked person from construction on.

    Args:
        node: private node.
        where: prefix of the topics.
        settings: sensor that measures the force on the hand.
        side: side of that hand, "right" or "left"; None: the force is not measured.
        now: robot time [s]; None while it is not known.
    """

    def __init__(
        self, node: Node, where: str, settings: HandForceSettings, side: str | None, now: Callable[[], float | None]
    ) -> None:
        super().__init__("load", 1.0)
        self._now, self._side = now, side or ""
        self._queue: deque[TrackerFrame | HandForce] = deque(maxlen=BACKLOG)
        self._came = threading.Event()
        self._live: LiveLoad | None = None
        self._messages: LoadMessages | None = None
        self._newest = self._taken = -math.inf
        self._tally = _Tally(settings.source)
        self._load = node.advertise(f"{where}/load", PersonLoadMessage, queue_size=100)
        self._parts = {
            node.advertise(f"{where}/joint_torque", JointTorque, queue_size=100): LoadMessages.torque,
            node.advertise(f"{where}/activation", MuscleActivation, queue_size=100): LoadMessages.activation,
            node.advertise(f"{where}/joint_reactions", JointReactions, queue_size=100): LoadMessages.reactions,
        }
        self.start()
        if (source := source_of(settings)) is not None:
            self._read = source.read
            node.subscribe(node.beside(source.topic), source.type, self._on_force, queue_size=0)

    def add(self, item: TrackerFrame | HandForce) -> None:
        """Add a tracked frame or a force sample, each kind in the order of time; thread-safe."""
        self._queue.append(item)
        if isinstance(item, TrackerFrame):
            self._came.set()

    def _on_force(self, message: Any) -> None:
        self.add(self._read(message.header.stamp.to_sec(), message))

    def report(self) -> StreamReport:
        """Return the health report for diagnostics; to be called once a second."""
        return self._tally.report()

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        self._came.set()
        super().close()

    def _run(self) -> None:
        while not self._stop.is_set():
            self._came.wait(WAIT)
            self._came.clear()
            began = time.thread_time()
            while self._queue:
                item = self._queue.popleft()
                if isinstance(item, TrackerFrame):
                    self._take(item)
                elif self._live is not None and item.time - self._newest < RECENT:
                    self._live.add_force(item)
            self._tally.cost += time.thread_time() - began

    def _take(self, frame: TrackerFrame) -> None:
        if frame.live is not self._live:
            self._live, self._messages = frame.live, LoadMessages(frame.live, self._side)
        frame.live.add(frame.estimate)
        self._newest = frame.estimate.time
        if 0.0 <= frame.estimate.time - self._taken < PORTION:
            return
        self._taken = frame.estimate.time
        if (person_load := frame.live.take()) is not None:
            self._publish(person_load, frame.frame_id)

    def _publish(self, person_load: PersonLoad, frame_id: str) -> None:
        assert self._messages is not None
        now = self._now()
        for row, instant in enumerate(person_load.load.time.tolist()):
            head = stamped.header(stamps.to_time(instant), frame_id)
            behind = math.nan if now is None else now - instant
            self._messages.count(person_load, row)
            self._load.publish(self._messages.load(head, person_load, row, behind))
            for publisher, make in self._parts.items():
                if publisher.subscribers():
                    publisher.publish(make(self._messages, head, person_load, row))
        self._tally.took(person_load, now)


class _Tally:
    """Counts for the diagnostics; written by one thread, read by another.

    Attributes:
        cost: processor time so far [s].
    """

    def __init__(self, source: str) -> None:
        self.cost, self._source, self._made = 0.0, source, time.monotonic()
        self._before = time.monotonic(), 0.0, 0
        self._instants, self._behind = 0, 0.0
        self._last: PersonLoad | None = None

    def took(self, person_load: PersonLoad, now: float | None) -> None:
        """Count the instants of a published load; now: robot time [s], None if unknown."""
        self._instants += len(person_load.load.time)
        self._last = person_load
        if now is not None:
            self._behind = max(self._behind, now - float(person_load.load.time[0]))

    def report(self) -> StreamReport:
        """Return the health report for diagnostics; to be called once a second."""
        newest, instants, cost = self._last, self._instants, self.cost
        now, (then, cost_then, instants_then) = time.monotonic(), self._before
        self._before, span = (now, cost, instants), max(now - then, 1e-3)
        values = {
            "instants": str(instants),
            "rate [Hz]": f"{(instants - instants_then) / span:.0f}",
            "largest delay [s]": f"{self._behind:.3f}",
            "processor share [1]": f"{(cost - cost_then) / span:.3f}",
            "force": self._source,
        }
        self._behind = 0.0
        if newest is None or instants == instants_then:
            starts = not instants and now - self._made < START
            return StreamReport(OK if starts else WARN, "waiting for mocap frames that show the person", values)
        values |= {f"{side} arm": states[-1] for side, states in newest.states.items()}
        if math.isfinite(newest.distance[-1]):
            values["force from the hand [m]"] = f"{newest.distance[-1]:.3f}"
        return StreamReport(*_diagnosis(newest), values)


def _diagnosis(person_load: PersonLoad) -> tuple[int, str]:
    """Return the level and text of diagnostics about the newest instant of a load."""
    if person_load.force[-1] == MISSING:
        return WARN, "no samples of the force on the person's hand arrive: the load of that arm is not known"
    if lost := [side for side, states in person_load.states.items() if states[-1] == LOST]:
        return WARN, f"too few visible markers: {' and '.join(lost)} arm lost"
    if person_load.force[-1] == AWAY:
        return OK, f"the force is {person_load.distance[-1]:.2f} m from the person's hand and is ignored"
    if outside := [side for side, rows in person_load.load.outside.items() if rows[-1]]:
        return OK, f"joints outside the range of the fitted muscle paths: {' and '.join(outside)} arm"
    measured = person_load.force[-1] == MEASURED
    return OK, "the load is known" if measured else "the load is known; no force on a hand is measured"
