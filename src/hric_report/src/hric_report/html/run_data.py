"""Data of a run for its HTML page, read from the run folder."""

from collections.abc import Sequence
from dataclasses import dataclass

from hric_analysis import human, metrics, recordings
from hric_analysis import tracking_run as tracking_analysis
from hric_analysis.human import SimulatedPerson
from hric_analysis.recordings import Recordings
from hric_analysis.tracking_run import MarkerTracking
from hric_analysis.values import RunMetrics, joint_orders
from hric_assessment.typed_json import Content
from hric_bags import reader as bag_reader
from hric_bags.reader import RunRecord
from hric_bags.records import object_record, safety_record
from hric_bags.records.object_record import ObjectRecord
from hric_bags.records.safety_record import SafetyRecord
from hric_bags.run_file import RunFile
from hric_bags.run_folder import RunFolder
from hric_core.json_values import from_json
from hric_report.html.verdict_file import VerdictFile


@dataclass(frozen=True)
class RunData:
    """Data of a run for its HTML page.

    Attributes:
        folder: run folder.
        run: contents of run.yaml.
        values: contents of metrics.json.
        record: control log with setpoints, profiles and reflexes.
        followed: data of marker tracking; None: the robot followed no marker.
        recorded: sensor signals, moving frames and markers, events and synchronisation data from the bag.
        description: URDF of the robot; "": the run folder has none.
        person: data of the simulated human; None: there was none.
        objects: objects around robot and person.
        safety: decisions of the safety supervisor; None: there was none.
        verdict: contents of verdict.json; None: there was no person.
    """

    folder: RunFolder
    run: RunFile
    values: Content
    record: RunRecord
    followed: MarkerTracking | None
    recorded: Recordings
    description: str
    person: SimulatedPerson | None = None
    objects: Sequence[ObjectRecord] = ()
    safety: SafetyRecord | None = None
    verdict: VerdictFile | None = None

    @property
    def moves(self) -> list[metrics.Move]:
        """Setpoints of the run, each with the range of control cycles until the next setpoint."""
        return metrics.moves(self.record, joint_orders(self.run))

    @property
    def run_metrics(self) -> RunMetrics:
        """Contents of metrics.json, with their types."""
        return from_json(RunMetrics, self.values)


def load(folder: RunFolder, values: Content, *, progress: bool = False) -> RunData:
    """Read the data of a run.

    Args:
        folder: run folder.
        values: metrics of the run, the contents of metrics.json.
        progress: True to show a progress bar.

    Raises:
        HricError: the bag or the robot description cannot be read.
    """
    run = folder.read()
    bag = folder.bag_of(run)
    record = bag_reader.read(bag)
    description = folder.description()
    followed = tracking_analysis.analyse(description, bag, run, record) if description else None
    recorded = recordings.read(bag, record.robot_time, progress=progress)
    definition = run.get("definition") or {}
    person = human.analyse(bag, run, description, record)
    objects = object_record.read(bag, (definition.get("robot") or {}).get("plant") or {}, record.robot_time)
    safety = safety_record.read(bag, record.robot_time)
    return RunData(folder, run, values, record, followed, recorded, description, person, objects, safety)
