"""Verdict on a running system: the assessment of `hric assess`, on the data received since the start of the run.

A thread computes it, and then sleeps for SHARE times the processor time that this took, so that frames are not delayed.
In a long run the shown verdict may therefore be old; the page shows the time up to which it has data.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from hric_assessment.verdict.assess import judge
from hric_assessment.verdict.conclusions import EFFORT, TASK, Conclusion, Reply
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.reader import ControlRecord
from hric_bags.records.human_record import HumanMessages
from hric_bags.records.recording import Recording
from hric_bags.records.rows import RecordRows, Thinning, stamp_of
from hric_bags.run_file import RunFile
from hric_core.errors import HricError
from hric_msgs.msg import HumanGrip, JointTorque, RegionContacts

PERIOD, SHARE = 1.0, 79.0
"""Shortest time between two verdicts [s], and time between them as a multiple of the processor time of one [1]; project
default."""
RATE = 50.0
"""Highest rate at which postures, torques and grips are stored [Hz]; project default. All contacts are stored."""
NOT_YET = {
    TASK: "the run has not ended",
    EFFORT: "the load of joints and muscles is computed after the run, by hric assess",
}
"""Reason why a question of the verdict has no reply while the system runs, by question."""
ARM = "joint_states"
"""Topic with the joint states of the arm."""
PERSON = {
    "joint_states": JointState,
    "joint_torque": JointTorque,
    "root": PoseStamped,
    "grip": HumanGrip,
    "contacts": RegionContacts,
}
"""Message classes of the person's topics that the verdict uses, by the last part of the topic's name."""


class LiveVerdict:
    """Verdict on the simulated person next to the arm; thread-safe.

    Args:
        description: URDF of the arm.
        joints: names of the arm's joints.
        run: known contents of the run's run.yaml, such as its section `human`.
        name: namespace of the person.
    """

    def __init__(self, description: str, joints: Sequence[str], run: RunFile, name: str) -> None:
        self._description, self._joints, self._run, self._name = description, tuple(joints), run, name
        self._queue = deque[tuple[str, bytes]]()
        self._lock, self._sent = threading.Lock(), 0.0
        self._lines: dict[str, object] = {}
        self._clear()

    def _clear(self) -> None:
        self._times, self._topics, self._thin = dict[str, float](), dict[str, int](), Thinning(RATE)
        self._arm, self._person = RecordRows("position", "velocity", "effort"), HumanMessages(self._name, RATE)

    def push(self, topic: str, data: bytes) -> None:
        """Store a message; may be called in any thread.

        Args:
            topic: ARM, or the full name of a topic of the person.
            data: serialised message.
        """
        self._queue.append((topic, data))

    def watch(self, stop: threading.Event, needed: Callable[[], bool]) -> None:
        """Decode messages and compute verdicts until the event `stop` is set.

        Args:
            stop: event that ends the call.
            needed: function that returns True if a viewer is connected; else no verdict is computed.
        """
        due = 0.0
        while not stop.wait(PERIOD):
            self.collect()
            if needed() and time.monotonic() > due:
                due = self.judge() + time.monotonic()

    def collect(self) -> None:
        """Decode the messages that `push` has stored; to be called in the thread that calls `judge`."""
        while self._queue:
            topic, data = self._queue.popleft()
            stamp = 1e-9 * stamp_of(data)
            if stamp < self._times.get(topic, stamp) - 1.0:
                self._clear()  # the simulation began again
            self._times[topic] = stamp
            self._topics[topic] = self._topics.get(topic, 0) + 1
            if topic == ARM:
                self._add_arm(stamp, data)
            else:
                self._add_person(topic, data)

    def _add_person(self, topic: str, data: bytes) -> None:
        kind = PERSON[topic.rpartition("/")[2]]
        connection = _Connection(topic, _name_in_bags(kind))
        self._person.note(connection, data)
        if self._person.due(connection, data):
            self._person.add(topic, connection.msgtype, kind().deserialize(data))

    def _add_arm(self, stamp: float, data: bytes) -> None:
        message = JointState().deserialize(data)
        values = zip(message.position, message.velocity, message.effort, strict=False)
        rows = dict(zip(message.name, values, strict=False))
        if set(self._joints) <= set(rows) and self._thin.due(ARM, data):  # not of the hand
            self._arm.add(stamp, _Row(self._joints, *zip(*(rows[name] for name in self._joints), strict=True)))

    def judge(self) -> float:
        """Compute the verdict on all data so far; return the time to wait before the next one [s of wall time]."""
        before = time.thread_time()
        self.collect()
        if (source := self._source()) is not None:
            lines, window = _lines(source), [round(source.recording.begin, 2), round(source.recording.end, 2)]
            with self._lock:
                self._lines, self._sent = {"window": window, "lines": lines}, 0.0
        return max(PERIOD, SHARE * (time.thread_time() - before))

    def _source(self) -> AssessmentInput | None:
        """Return the received data in the form of a recording; None: nothing has been received from the person."""
        person, (at, q, dq, tau) = self._person.record(float), self._arm.columns(float)
        ends = [times[k] for times in (at, person.time) if len(times) for k in (0, -1)]
        if not ends or not len(person.time):
            return None
        none = np.full_like(q, np.nan)
        log = ControlRecord(self._joints, ("none",) * len(self._joints), at, q, dq, tau, none, none, 0, (), ())
        recording = Recording(
            dict(self._topics),
            frozenset(map(_name_in_bags, PERSON.values())),
            min(ends),
            max(ends),
            float,  # stamps are robot time
            log if len(at) else None,
            {self._name: person},
            None,
            description=self._description,
        )
        return AssessmentInput("the running system", "run", Path(), recording, self._run, self._description)

    def scene(self) -> dict[str, object]:
        """Return an empty dictionary: a new viewer needs nothing before the first frame, which has the verdict."""
        return {}

    def frame(self) -> dict[str, object]:
        """Return the newest verdict; empty if it was returned less than PERIOD ago, or there is none."""
        with self._lock:
            if not self._lines or time.monotonic() - self._sent < PERIOD:
                return {}
            self._sent = time.monotonic()
            return {"verdict": self._lines}


class _Connection:
    """Stand-in for a connection of a bag, which has topic and type of a message."""

    def __init__(self, topic: str, msgtype: str) -> None:
        self.topic, self.msgtype = topic, msgtype


class _Row:
    """Joint names and values of an arm, with the fields of a sensor_msgs/JointState."""

    def __init__(self, name: Sequence[str], position: Any, velocity: Any, effort: Any) -> None:
        self.name, self.position, self.velocity, self.effort = name, position, velocity, effort


def _name_in_bags(kind: Any) -> str:
    """Return the name of a message class in the form of the rosbags library, e.g. "sensor_msgs/msg/JointState"."""
    name: str = kind._type
    return name.replace("/", "/msg/")


def _lines(source: AssessmentInput) -> list[dict[str, str]]:
    """Return the lines of the verdict, one for each question; if it cannot be computed, one line with the reason."""
    try:
        drawn: Sequence[Conclusion] = judge(source).conclusions
    except HricError as error:
        return [{"question": "verdict", "reply": str(Reply.UNKNOWN), "number": "", "text": str(error)}]
    return [_line(_live(item)) for item in drawn]


def _live(item: Conclusion) -> Conclusion:
    """Return a conclusion, or "not known" with the reason in NOT_YET if only a finished run can decide it."""
    if item.question == TASK or (item.question == EFFORT and item.reply != Reply.NO and item.finding is None):
        return replace(item, reply=Reply.UNKNOWN, value=None, subject="", reason=NOT_YET[item.question], remedy="")
    return item


def _line(item: Conclusion) -> dict[str, str]:
    text = ": ".join(filter(None, (item.subject, item.reason or item.remedy)))
    return {"question": item.question, "reply": str(item.reply), "number": item.number, "text": text}
