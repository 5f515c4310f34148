"""Data of a run for its page, read from its folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hric_analysis import human, metrics, recordings
from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.human import Person
from hric_analysis.recordings import Recordings
from hric_analysis.tracking_run import Tracking
from hric_analysis.values import joint_orders
from hric_bags import reader as bag_reader
from hric_bags.reader import RunRecord
from hric_bags.records import object_record, safety_record
from hric_bags.records.object_record import ObjectRecord
from hric_bags.records.safety_record import SafetyRecord
from hric_bags.run_folder import RunFolder
from hric_report import run as analysis


@dataclass(frozen=True)
class RunData:
    """Data of a run for its page.

    Attributes:
        folder: run folder.
        run: contents of run.yaml.
        values: contents of metrics.json.
        record: control log with setpoints, profiles and reflexes.
        followed: marker tracking; None: no marker was followed.
        found: sensor signals, moving frames and markers, events and synchronisation data from the bag.
        description: URDF of the robot; "": the run folder has none.
        person: simulated human; None: there was none.
        objects: objects around robot and person.
        safety: decisions of the supervisor; None: there was none.
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
        """Setpoints of the run, each with the cycles until the next one."""
        return metrics.moves(self.record, joint_orders(self.run))


def load(folder: RunFolder, values: Mapping[str, Any], *, progress: bool = False) -> RunData:
    """Read the data of a run.

    Args:
        folder: run folder.
        values: metrics of the run, as `analysis.analyse` returns them.
        progress: show a progress bar.

    Raises:
        HricError: the bag or the description cannot be used.
    """
    run = folder.read()
    bag = analysis.bag_of(folder, run)
    record = bag_reader.read(bag)
    description = folder.description()
    followed = tracking_analysis.analyse(description, bag, run, record) if description else None
    found = recordings.read(bag, record.robot_time, progress=progress)
    definition = run.get("definition") or {}
    person = human.analyse(bag, run, description, record)
    plant = (definition.get("robot") or {}).get("plant") or {}
    objects = object_record.read(bag, plant, record.robot_time)
    safety = safety_record.read(bag, record.robot_time)
    return RunData(folder, run, values, record, followed, found, description, person, objects, safety)
