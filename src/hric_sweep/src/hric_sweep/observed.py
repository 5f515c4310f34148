"""Recording of a simulation's messages in memory; the outputs of a sweep are computed from it as from a bag."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import genpy.message

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
    RunMessages,
    RunRecord,
)
from hric_bags.reader import read as read_record
from hric_bags.records import contact_record, human_record
from hric_bags.run_file import RunFile
from hric_run import provenance
from hric_run.definition.experiment import to_dict
from hric_run.simulation import Simulation
from hric_sweep.approaches.contact_events import SUPERVISED, ContactEvent, contact_events, impact, supervision
from hric_sweep.outputs import COLLABORATION, IMPACT, SUPERVISION, SWEEP_GROUPS
from hric_sweep.records import PlainData

ALL = None
HUMAN = (
    *human_record.TYPES,
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
    SUPERVISION: SUPERVISED,
    COLLABORATION: (*HUMAN, LOG_TYPE),
}
"""Message types that each group of metrics needs besides MOVED; a group that is not listed needs all types."""
MOVED = (LOG_TYPE, COUNTS_TYPE, COMMAND_TYPE)
"""Message types from which the control record of every run is built."""


class Observed:
    """Recorder of the messages of a simulation that has not started yet.

    Args:
        simulation: simulation to record.
        groups: groups of metrics (first keys of output paths) to compute; only messages they need are stored.
    """

    def __init__(self, simulation: Simulation, groups: Collection[str]) -> None:
        self._simulation, self._groups = simulation, groups
        self._bag, self._messages = MemoryBag(), RunMessages()
        needed = [NEEDS.get(group, ALL) for group in groups]
        self._types = None if None in needed else {kind for kinds in needed if kinds for kind in kinds}
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
                listen(topic, genpy.message.get_message_class(name))
        begun = True  # latched messages are in `simulation.early` already

    def _wants(self, kind: str) -> bool:
        return kind in MOVED or self._types is None or kind in self._types

    def _take(self, topic: str, message: Any, at: float) -> None:
        kind = message._type.replace("/", "/msg/")
        if kind in TYPES:
            self._messages.add(topic, kind, nanoseconds(at), message)
        if self._types is None or kind in self._types:
            self._bag.write(topic, message, at)

    def values(self) -> "Observations":
        """Return the metrics of the run up to now, by group.

        Raises:
            HricError: the run has no control log.
        """
        simulation = self._simulation
        error = simulation.app.hw.error
        run: RunFile = {
            "experiment": simulation.definition.name,
            "definition": to_dict(simulation.definition),
            "parameters": provenance.parameters(simulation.tree),
            "limits": simulation.limits,
            **({"arm_error": error} if error else {}),
        }
        record = read_record(self._bag, self._messages)
        return Observations(run, self._bag, record, simulation.tree["robot_description"])


class Observations(Mapping[str, object]):
    """Metrics of a run by group, including the groups that only sweeps have (SWEEP_GROUPS).

    Args:
        run: contents of run.yaml that analyses read.
        bag: recorded messages.
        record: control log of the run with its accompanying data.
        description: URDF of the robot.

    Attributes:
        description: URDF of the robot.
    """

    def __init__(self, run: RunFile, bag: MemoryBag, record: RunRecord, description: str) -> None:
        self._run, self._bag, self._record, self.description = run, bag, record, description

    @property
    def log(self) -> ControlRecord:
        """Control log with every cycle of the run."""
        return self._record.log

    @cached_property
    def metrics(self) -> Values:
        """Metrics of the run, with the keys of metrics.json."""
        return Values(self._run, self._bag, self._record, self.description)

    @cached_property
    def verdict_input(self) -> AssessmentInput:
        """Recorded data of the run in the form that the verdict reads."""
        return contacts.given_of(self._run, self._bag, self.description)

    @cached_property
    def contacts(self) -> list[ContactEvent]:
        """Contacts between person and robot, assessed as in the verdict of a report."""
        return contact_events(contacts.findings(self.verdict_input), self._record.log, self.description)

    @cached_property
    def _impact(self) -> Mapping[str, Sequence[PlainData]]:
        return impact(self.contacts)

    @cached_property
    def _supervision(self) -> PlainData | None:
        return supervision(self._bag, self._record.robot_time)

    @cached_property
    def _collaboration(self) -> PlainData | None:
        return collaboration.values(self.verdict_input, self.metrics.person)

    def __getitem__(self, key: str) -> Any:
        return getattr(self, f"_{key}") if key in SWEEP_GROUPS else self.metrics[key]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.metrics, *SWEEP_GROUPS))

    def __len__(self) -> int:
        return len(self.metrics) + len(SWEEP_GROUPS)
