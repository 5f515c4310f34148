"""Analysis of a run folder: writes metrics, figures and text report of the run; needs no ROS."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hric_analysis.values import Values
from hric_assessment.typed_json import JsonObject
from hric_bags import files, run_notes
from hric_bags import reader as bag_reader
from hric_bags.reader import RunMessages, RunRecord
from hric_bags.run_file import RunFile, robot_parameters
from hric_bags.run_folder import RunFolder
from hric_control.plants import WindowlessConfig
from hric_core.json_values import to_json
from hric_report import text as report_text

if TYPE_CHECKING:
    from hric_analysis.human import SimulatedPerson

OPENSIM = "opensim_ros_control/OpenSimPlant"
"""Plant type (physics engine plug-in) whose runs are also exported as files for OpenSim."""
STEPS, FIGURE_STEPS = 3, 2
"""Number of progress steps of `analyse`, and of additional steps with figures."""


def analyse(
    path: str | Path | RunFolder,
    *,
    figures: bool = True,
    step: Callable[[str], object] = str,
    known: RunMessages | None = None,
) -> JsonObject:
    """Write metrics.json, summary.txt and the figures of a run, overwriting old files; return the metrics.

    A run on the OpenSim plant also gets files that OpenSim can replay.

    Args:
        path: run folder.
        figures: True to draw the figures.
        step: callback with the name of each step that starts; the default `str` does nothing.
        known: messages of the bag if the caller has just written them, so that they are not read again.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: `path` is no run folder, or its bag cannot be read.
    """
    folder = path if isinstance(path, RunFolder) else RunFolder.open(path)
    run = folder.read()
    bag = folder.bag_of(run)
    step("reading the control log")
    with bag_reader.opened(bag) as reader:
        record = bag_reader.read(reader, known)
        values = Values(run, reader, record, folder.description())
        step("analysing marker tracking")
        _ = values.followed  # computed here, so that its time counts for this step
        step("computing metrics of motion, contacts and samples")
        result = values.all()
        person = values.person
        files.write_json(folder.metrics_path, to_json(result))
        report = report_text.render(run, result) + run_notes.text(folder.path)
        files.write_text(folder.path / "summary.txt", report)
        _export(folder, run, record, person)
        if figures:
            from hric_report import run_figures  # slow to import

            run_figures.draw(folder, run, reader, record, values, step)
    return {**to_json(result), "report": report}


def _export(folder: RunFolder, run: RunFile, record: RunRecord, person: "SimulatedPerson | None") -> None:
    """Write files that OpenSim can replay, if the run used the OpenSim plant."""
    definition = run.get("definition") or {}
    if (definition.get("robot") or {}).get("plant_type") != OPENSIM:
        return
    from hric_bags.export import opensim_files

    opensim_files.write(folder, run, record.log)
    if person is not None:
        from hric_analysis import human_opensim

        plant = robot_parameters(run).get("plant") or {}
        gravity = tuple(plant.get("gravity") or WindowlessConfig().gravity)
        human_opensim.write(folder.path, definition.get("human") or {}, person.record, gravity)
