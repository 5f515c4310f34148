"""Metrics of a run, from a bag on disk or in memory; each is computed on first access."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hric_analysis import collection, collection_record, differences, metrics, stability, supervised
from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.collection import CollectionMetrics, SourceMetrics, StreamMetrics
from hric_analysis.differences import Difference
from hric_analysis.human_values import HumanMetrics, instability_reasons
from hric_analysis.metrics import MotionMetrics
from hric_analysis.stability import Stability
from hric_analysis.supervised import SupervisorMetrics
from hric_analysis.tracking_run import MarkerTracking, TrackingMetrics
from hric_bags.parts import Bag
from hric_bags.reader import RunRecord
from hric_bags.records import contact_record, safety_record
from hric_bags.records.contact_record import ForceHeld, PairForce
from hric_bags.records.safety_record import SafetyRecord
from hric_bags.run_file import Definition, RunFile
from hric_core.json_values import to_json

if TYPE_CHECKING:
    from hric_analysis.human import SimulatedPerson


@dataclass(frozen=True)
class Reflex:
    """Reflex: the arm stopped to protect itself. Robot time [s], and libfranka's names of the errors."""

    time: float
    errors: tuple[str, ...]


@dataclass(frozen=True)
class ReferenceSetup:
    """Reference set-up with which a run is compared: name, and title for the report."""

    name: str
    title: str


@dataclass(frozen=True, kw_only=True)
class RunMetrics(MotionMetrics):
    """Contents of metrics.json; None: the run has no such data. See also INTERFACE.md of hric_experiments.

    Attributes:
        real_time_factor: robot time per wall time [1].
        missed_deadlines: number of control cycles that started late; None: not published, as in a headless run.
        prismatic: prismatic joints, whose values are in m, m/s and N instead of rad, rad/s and N m.
        reflexes: stops by which the arm protected itself.
        contacts: contact forces of each pair of bodies that touched.
        forces: force that each force controller held on a surface, by its name.
        stability: stability verdict.
        sources, sync: completeness of the sensor data, and of synchronised streams.
        human, supervisor, tracking: metrics of simulated human, safety supervisor, and marker tracking.
        reference, differences: reference set-up, and differences from it; left out if there is no reference.
    """

    real_time_factor: float | None
    missed_deadlines: int | None
    reflexes: tuple[Reflex, ...]
    contacts: tuple[PairForce, ...] | None
    forces: dict[str, ForceHeld] | None
    stability: Stability
    sources: dict[str, SourceMetrics] | None
    sync: dict[str, StreamMetrics] | None
    human: HumanMetrics | None
    supervisor: SupervisorMetrics | None
    tracking: TrackingMetrics | None
    prismatic: tuple[str, ...] = ()
    reference: ReferenceSetup | None = None
    differences: tuple[Difference, ...] | None = None


KEYS = tuple(item.name for item in fields(RunMetrics) if item.default is not None)
"""Keys of metrics.json for every run; with a reference set-up, `reference` and `differences` are added."""
MOTION = tuple(item.name for item in fields(MotionMetrics) if item.name != "experiment")
"""Keys of metrics that need only control log, setpoints, controller states and counts of limited cycles."""


class Values(Mapping[str, object]):
    """Metrics of a run as JSON values by key; each is computed on first access.

    Args:
        run: contents of run.yaml.
        bag: bag of the run.
        record: control log with setpoints, profiles and reflexes.
        description: URDF of the robot; "": there is none.
    """

    def __init__(self, run: RunFile, bag: Bag, record: RunRecord, description: str) -> None:
        self._run, self._bag, self._record, self._description = run, bag, record, description
        self._definition = run.get("definition") or Definition()
        self._limits = run.get("limits") or {}
        settings = self._definition.get("metrics") or {}
        self.tolerances = metrics.settling_bands(settings)
        self._reference = str(settings.get("reference") or "")
        self._parts: dict[str, object] = {}
        self._others: dict[str, Callable[[], object]] = {
            "real_time_factor": lambda: run.get("real_time_factor"),
            "missed_deadlines": lambda: collection_record.missed_deadlines(bag),
            "prismatic": lambda: metrics.prismatic_joints(record.log.joint_names, description),
            "reflexes": lambda: tuple(Reflex(*reflex) for reflex in record.reflexes),
            "contacts": lambda: tuple(contact_record.read(bag, record.robot_time)) or None,
            "forces": lambda: contact_record.forces_held(bag, record.robot_time) or None,
            "stability": self._stability,
            "sources": lambda: self._collected.sources,
            "sync": lambda: self._collected.sync,
            "human": lambda: self._human,
            "supervisor": lambda: supervised.metrics(self.safety),
            "tracking": lambda: None if self.followed is None else self.followed.values,
        }
        if self._reference:
            self._others |= {"reference": lambda: self._compared[0], "differences": lambda: self._compared[1]}

    def all(self) -> RunMetrics:
        """Return all metrics of the run."""
        return RunMetrics(**{key: self._part(key) for key in self})

    @cached_property
    def followed(self) -> MarkerTracking | None:
        """Marker tracking of the run; None: the robot followed no marker."""
        return tracking_analysis.analyse(self._description, self._bag, self._run, self._record)

    @cached_property
    def person(self) -> "SimulatedPerson | None":
        """Data of the simulated human, with contacts and carried objects; None: there was no human."""
        if self._definition.get("human") is None:
            return None
        from hric_analysis import human  # imported only for runs with a person: it is slow to import

        return human.analyse(self._bag, self._run, self._description, self._record)

    @cached_property
    def safety(self) -> SafetyRecord | None:
        """Decisions and events of the safety supervisor; None: there was none."""
        return safety_record.read(self._bag, self._record.robot_time)

    @cached_property
    def _motion(self) -> MotionMetrics:
        orders, name = joint_orders(self._run), self._run.get("experiment", "")
        return metrics.compute(self._record, self._limits, orders, self.tolerances, name)

    @cached_property
    def _collected(self) -> CollectionMetrics:
        record, data = self._record, collection_record.read(self._bag)
        return collection.metrics(data, record.log, record.robot_time, self._run.get("interval"))

    @cached_property
    def _human(self) -> HumanMetrics | None:
        if self.person is None:
            return None
        from hric_analysis import human  # as in `person`

        return human.metrics(self.person, self._definition["human"] or {})

    @cached_property
    def _compared(self) -> tuple[ReferenceSetup, tuple[Difference, ...]]:
        reference = differences.reference(self._reference)
        setpoints, parameters = self._definition.get("setpoints") or [], self._run.get("parameters") or {}
        controller = parameters.get(setpoints[0]["controller"], {}) if setpoints else {}
        setup = differences.Setup(reference, self._definition.get("robot") or {}, controller, self._motion)
        return ReferenceSetup(self._reference, reference["title"]), differences.compare(setup)

    def _stability(self) -> Stability:
        judged = stability.judge(self._run, self._record.log, self._limits)
        return judged.also([] if self._human is None else instability_reasons(self._human.settling))

    def _part(self, key: str) -> Any:
        if key not in self._parts:
            self._parts[key] = self._others[key]() if key in self._others else getattr(self._motion, key)
        return self._parts[key]

    def __getitem__(self, key: str) -> Any:
        return to_json(self._part(key))

    def __iter__(self) -> Iterator[str]:
        return iter((*KEYS, *(("reference", "differences") if self._reference else ())))

    def __len__(self) -> int:
        return len(list(iter(self)))


def joint_orders(run: RunFile) -> dict[str, list[str]]:
    """Return the order of the joints in each controller with a parameter `joints`; `run`: contents of run.yaml."""
    orders, parameters = {}, dict(run.get("parameters") or {})
    for arm in (run.get("definition") or {}).get("arms") or {}:
        parameters |= {f"{arm}/{name}": values for name, values in parameters.get(arm, {}).items()}
    for name, values in parameters.items():
        if isinstance(values, Mapping) and isinstance(values.get("joints"), list) and values["joints"]:
            orders[name] = [str(joint) for joint in values["joints"]]
    return orders
