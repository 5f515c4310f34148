"""Messages of a simulation for the outputs of a sweep, analysed from memory as a bag would be."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict
from functools import cached_property
from typing import Any

import roslib.message

from hric_analysis import collaboration, contacts
from hric_analysis.values import MOTION, Values
from hric_assessment.verdict.inputs import AssessmentInput
from hric_bags.memory import MemoryBag, nanoseconds
from hric_bags.reader import (
    COMMAND_TYPE,
    COUNTS_TYPE,
    FRANKA_TYPE,
    LOG_TYPE,
    STATE_TYPE,
    TYPES,
    ControlRecord,
    Messages,
    RunRecord,
)
from hric_bags.reader import read as read_record
from hric_bags.records import contact_record, human_record
from hric_bags.records.region_contacts import CONTACTS_TYPE
from hric_run import provenance
from hric_run.definition.experiment import to_dict
from hric_run.simulation import Simulation
from hric_sweep.approaches import meetings
from hric_sweep.approaches.meetings import ContactEvent
from hric_sweep.outputs import COLLABORATION, IMPACT, SUPERVISION

SAFETY_TYPE = "hric_msgs/msg/SafetyState"
ALL = None
HUMAN = (
    *(human_record.GRIP_TYPE, human_record.TORQUE_TYPE, human_record.EVENT_TYPE, CONTACTS_TYPE),
    *("hric_msgs/msg/MuscleActivation", "hric_msgs/msg/MuscleForce", "hric_msgs/msg/JointReactions"),
    "sensor_msgs/msg/JointState",
)
NEEDS: dict[str, tuple[str, ...] | None] = {
    **dict.fromkeys((*MOTION, "experiment", "real_time_factor"), ()),
    "path": (STATE_TYPE,),
    "reflexes": (FRANKA_TYPE,),
    "stability": HUMAN,
    "human": HUMAN,
    "contacts": (contact_record.CONTACTS_TYPE,),
    IMPACT: (*HUMAN, LOG_TYPE),
    SUPERVISION: (SAFETY_TYPE,),
    COLLABORATION: (*HUMAN, LOG_TYPE),
}
"""Types of messages that a group of metrics is computed from, beside MOVED; a group that is not here: all of them."""
MOVED = (LOG_TYPE, COUNTS_TYPE, COMMAND_TYPE)
"""Types that the record of every run is made of."""


class Observed:
    """Listens to a simulation that has not begun yet.

    Args:
        simulation: whose messages.
        groups: first keys of the outputs that are requested; nothing else is kept.
    """

    def __init__(self, simulation: Simulation, groups: Collection[str]) -> None:
        self._simulation, self._groups = simulation, groups
        self._bag, self._messages = MemoryBag(), Messages()
        needed = [NEEDS.get(group, ALL) for group in groups]
        self._kept = None if None in needed else {kind for kinds in needed if kinds for kind in kinds}
        for topic, message, at in simulation.early:
            self._take(topic, message, at)
        self._subscribe()

    def _subscribe(self) -> None:
        node, begun = self._simulation.node, False

        def listen(topic: str, kind: Any) -> None:
            self._bag.announce(topic, kind)
            node.subscribe(topic, kind, lambda message: self._take(topic, message, node.clock()) if begun else None)

        for topic, name in node.topics().items():
            if self._wants(name.replace("/", "/msg/")):
                listen(topic, roslib.message.get_message_class(name))
        begun = True  # what is latched came with `early`

    def _wants(self, kind: str) -> bool:
        return kind in MOVED or self._kept is None or kind in self._kept

    def _take(self, topic: str, message: Any, at: float) -> None:
        kind = message._type.replace("/", "/msg/")
        if kind in TYPES:
            self._messages.add(topic, kind, nanoseconds(at), message)
        if self._kept is None or kind in self._kept:
            self._bag.write(topic, message, at)

    def values(self) -> "Observations":
        """Return the metrics of the run so far, by their first keys.

        Raises:
            HricError: it has no control log.
        """
        simulation = self._simulation
        error = simulation.app.hw.error
        run = {
            "experiment": simulation.definition.name,
            "definition": to_dict(simulation.definition),
            "parameters": provenance.parameters(simulation.tree),
            "limits": simulation.limits,
            **({"arm_error": error} if error else {}),
        }
        record = read_record(self._bag, self._messages)
        return Observations(run, self._bag, record, simulation.tree["robot_description"])


class Observations(Mapping[str, Any]):
    """Metrics of a run, and the keys that sweeps add to them.

    Args:
        run: contents of run.yaml, as far as analyses read it.
        bag: its messages.
        record: its control log and what belongs to it.
        description: URDF of the robot.
    """

    def __init__(self, run: Mapping[str, Any], bag: MemoryBag, record: RunRecord, description: str) -> None:
        self._run, self._bag, self._record, self._description = run, bag, record, description
        self._own: dict[str, Callable[[], Any]] = {
            IMPACT: lambda: self._impact,
            SUPERVISION: lambda: self._supervision,
            COLLABORATION: lambda: self._collaboration,
        }

    @property
    def log(self) -> ControlRecord:
        """Every cycle of the run."""
        return self._record.log

    @cached_property
    def _metrics(self) -> Values:
        return Values(self._run, self._bag, self._record, self._description)

    def _messages(self, kind: str) -> list[Any]:
        chosen = self._bag.chosen(lambda connection: connection.msgtype == kind)
        return [self._bag.deserialize(raw, kind) for _, _, raw in chosen]

    @cached_property
    def _given(self) -> AssessmentInput:
        return contacts.given_of(self._run, self._bag, self._description)

    @cached_property
    def contacts(self) -> list[ContactEvent]:
        """Contacts of the person, judged as by the verdict."""
        return meetings.contact_events(contacts.findings(self._given), self._record.log, self._description)

    @property
    def _impact(self) -> dict[str, Any]:
        """All contacts of the person, and those that began with a moving arm."""
        rows = [{**asdict(one), "above": one.above, "not_assessable": one.not_assessable} for one in self.contacts]
        return {"contacts": rows, "moving": [row for row in rows if row["arm"] == meetings.MOVING]}

    @cached_property
    def _supervision(self) -> dict[str, Any] | None:
        return meetings.supervision(self._messages(SAFETY_TYPE))

    @cached_property
    def _collaboration(self) -> dict[str, Any] | None:
        return collaboration.values(self._given, self._metrics.person)

    def __getitem__(self, key: str) -> Any:
        return self._own[key]() if key in self._own else self._metrics[key]

    def __iter__(self) -> Iterator[str]:
        return iter((*self._metrics, *self._own))

    def __len__(self) -> int:
        return len(self._metrics) + len(self._own)
