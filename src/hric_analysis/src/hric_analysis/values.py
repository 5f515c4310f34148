"""Metrics of a run with a bag on disk or in memory, each computed on first access."""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import Any

from hric_analysis import collection, collection_record, differences, human, metrics, stability, supervised
from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.human import Person
from hric_analysis.tracking_run import Tracking
from hric_bags.parts import Bag
from hric_bags.reader import RunRecord
from hric_bags.records import contact_record, safety_record
from hric_bags.records.safety_record import SafetyRecord
from hric_run.definition.experiment import MetricsSpec

MOTION = ("control_log", "state_sha256", "limits_touched", "path", "setpoints", "joints", "topics")
"""Metrics that need only the control log, the setpoints, the controller states and the limit counts."""
KEYS = (
    "experiment",
    *MOTION,
    *("real_time_factor", "missed_deadlines", "reflexes", "contacts", "stability", "sources", "sync"),
    *("human", "supervisor", "tracking"),
)
"""Metrics of every run; a run with a reference set-up also has `reference` and `differences`."""


class Values(Mapping[str, Any]):
    """Contents of metrics.json, computed on access.

    Args:
        run: contents of run.yaml.
        bag: bag of the run.
        record: control log with setpoints, profiles and reflexes.
        description: URDF of the robot; "": there is none.
    """

    def __init__(self, run: Mapping[str, Any], bag: Bag, record: RunRecord, description: str) -> None:
        self._run, self._bag, self._record, self._description = run, bag, record, description
        self._definition: Mapping[str, Any] = run.get("definition") or {}
        self._limits: Mapping[str, Mapping[str, float]] = run.get("limits") or {}
        given = (self._definition.get("metrics") or {}).get("tolerances")
        self.tolerances = tuple(given or MetricsSpec().tolerances)
        self._reference = str((self._definition.get("metrics") or {}).get("reference") or "")
        self._parts: dict[str, Any] = {}

    @cached_property
    def followed(self) -> Tracking | None:
        """Marker tracking of the run; None: no marker was followed."""
        return tracking_analysis.analyse(self._description, self._bag, self._run, self._record)

    @cached_property
    def person(self) -> Person | None:
        """Human of the run, with metrics of effort and contacts; None: there was none."""
        return human.analyse(self._bag, self._run, self._description, self._record)

    @cached_property
    def safety(self) -> SafetyRecord | None:
        """Decisions and events of the supervisor; None: there was none."""
        return safety_record.read(self._bag, self._record.robot_time)

    @cached_property
    def _motion(self) -> dict[str, Any]:
        return metrics.compute(self._record, self._limits, joint_orders(self._run), self.tolerances)

    @cached_property
    def _collected(self) -> dict[str, Any]:
        record = self._record
        found = collection_record.read(self._bag)
        return collection.metrics(found, record.log, record.robot_time, self._run.get("interval"))

    @cached_property
    def _compared(self) -> dict[str, Any]:
        if not self._reference:
            return {}
        reference = differences.reference(self._reference)
        setpoints, parameters = self._definition.get("setpoints") or [], self._run.get("parameters") or {}
        controller = parameters.get(setpoints[0]["controller"], {}) if setpoints else {}
        setup = differences.Setup(reference, self._definition.get("robot") or {}, controller, self)
        named = {"name": self._reference, "title": reference["title"]}
        return {"reference": named, "differences": differences.compare(setup)}

    def _stability(self) -> dict[str, Any]:
        judged = stability.judge(self._run, self._record.log, self._limits)
        if self.person is None:
            return judged
        return stability.also(judged, human.unrest(self.person.values["settling"]))

    def _computed(self, key: str) -> Any:
        record = self._record
        if key in MOTION:
            return self._motion[key]
        if key in ("sources", "sync"):
            return self._collected[key]
        if key in ("reference", "differences"):
            return self._compared[key]
        others: dict[str, Callable[[], Any]] = {
            "experiment": lambda: self._run.get("experiment", ""),
            "real_time_factor": lambda: self._run.get("real_time_factor"),
            "missed_deadlines": lambda: collection_record.missed_deadlines(self._bag),
            "reflexes": lambda: [{"time": time, "errors": list(names)} for time, names in record.reflexes],
            "contacts": lambda: contact_record.metrics(contact_record.read(self._bag, record.robot_time)),
            "stability": self._stability,
            "human": lambda: None if self.person is None else self.person.values,
            "supervisor": lambda: supervised.metrics(self.safety),
            "tracking": lambda: None if self.followed is None else self.followed.values,
        }
        return others[key]()

    def __getitem__(self, key: str) -> Any:
        if key not in self._parts:
            self._parts[key] = self._computed(key)
        return self._parts[key]

    def __iter__(self) -> Iterator[str]:
        return iter((*KEYS, *(("reference", "differences") if self._reference else ())))

    def __len__(self) -> int:
        return len(list(iter(self)))


def joint_orders(run: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the joint order of each controller that has a parameter `joints`; run: contents of run.yaml."""
    found = {}
    for name, values in (run.get("parameters") or {}).items():
        if isinstance(values, Mapping) and isinstance(values.get("joints"), list) and values["joints"]:
            found[name] = [str(joint) for joint in values["joints"]]
    return found
