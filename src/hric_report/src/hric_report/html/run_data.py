"""A run as its page needs it, read from its folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_analysis import human, metrics, recordings
from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.human import Person
from hric_analysis.recordings import Recordings
from hric_analysis.tracking_run import Tracking
from hric_analysis.values import joint_orders
from hric_assessment.contact import impact
from hric_bags import reader as bag_reader
from hric_bags.reader import RunRecord
from hric_bags.records import human_record, object_record, safety_record
from hric_bags.records.object_record import ObjectRecord
from hric_bags.records.safety_record import SafetyRecord
from hric_bags.run_folder import RunFolder
from hric_report import run as analysis


@dataclass(frozen=True)
class RunData:
    """A run, read.

    Attributes:
        folder: where it lies.
        run: contents of run.yaml.
        values: contents of metrics.json.
        record: its control log and what goes with it.
        followed: how a marker was followed; None: none was.
        found: what else is in the bag.
        description: URDF; "": the run folder has none.
        person: the human beside the robot; None: nobody was there.
        objects: of the world around them.
        safety: what a supervisor decided; None: none was there.
        verdict: contents of verdict.json; None: there was no person.
    """

    folder: RunFolder
    run: Mapping[str, Any]
    values: Mapping[str, Any]
    record: RunRecord
    followed: Tracking | None
    found: Recordings
    description: str
    person: Person | None = None
    objects: Sequence[ObjectRecord] = ()
    safety: SafetyRecord | None = None
    verdict: Mapping[str, Any] | None = None

    @property
    def moves(self) -> list[metrics.Move]:
        """Its setpoints."""
        return metrics.moves(self.record, joint_orders(self.run))


def load(folder: RunFolder, values: Mapping[str, Any], *, progress: bool = False) -> RunData:
    """Read a run.

    Args:
        folder: of the run.
        values: its metrics, as `analysis.analyse` returns them.
        progress: show a progress bar.

    Raises:
        HricError: its bag or its description cannot be used.
    """
    run = folder.read()
    bag = analysis.bag_of(folder, run)
    record = bag_reader.read(bag)
    description = folder.description()
    followed = tracking_analysis.analyse(description, bag, run, record) if description else None
    found = recordings.read(bag, record.robot_time, progress=progress)
    definition = run.get("definition") or {}
    beside = definition.get("human") and human_record.read(bag, record.robot_time)
    person = None
    if beside:
        met = tuple(impact.expected_contacts(run, description, record, beside))
        person = Person(beside, values.get("human") or {}, met, human.carried_in(beside, definition))
    plant = (definition.get("robot") or {}).get("plant") or {}
    objects = object_record.read(bag, plant, record.robot_time)
    safety = safety_record.read(bag, record.robot_time)
    return RunData(folder, run, values, record, followed, found, description, person, objects, safety)
