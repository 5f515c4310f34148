"""Analysis of a run folder: writes its metrics, figures and report; needs no ROS."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hric_analysis import metrics, recordings
from hric_analysis.human import Person
from hric_analysis.tracking_run import Tracking
from hric_analysis.values import Values, joint_orders
from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags.parts import Bag
from hric_bags.reader import Messages, RunRecord
from hric_bags.records.safety_record import SafetyRecord
from hric_bags.run_folder import RunFolder
from hric_control.plants import WindowlessConfig
from hric_core.json_values import to_json
from hric_report import text as report_text

OPENSIM = "opensim_ros_control/OpenSimPlant"
"""Plant type whose runs are exported for OpenSim's tools."""
STEPS, FIGURE_STEPS = 3, 2
"""Number of progress steps of `analyse`, and of additional steps with figures."""


def analyse(
    path: str | Path | RunFolder,
    *,
    figures: bool = True,
    step: Callable[[str], object] = str,
    known: Messages | None = None,
) -> dict[str, Any]:
    """Write metrics.json, summary.txt and the figures of a run, overwriting old files; return the metrics.

    A run on the OpenSim plant also gets files that OpenSim can replay.

    Args:
        path: run folder.
        figures: draw the figures.
        step: callback for the name of each step that starts (a minute of samples takes about a minute); str: none.
        known: messages of the bag, if the caller has just written them.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: not a run folder, or its bag cannot be used.
    """
    folder = path if isinstance(path, RunFolder) else RunFolder.open(path)
    run = folder.read()
    bag = bag_of(folder, run)
    step("reading the control log")
    with bag_reader.opened(bag) as reader:
        record = bag_reader.read(reader, known)
        values = Values(run, reader, record, folder.description())
        step("how a marker was followed")
        followed = values.followed
        step("metrics of motion, contacts and samples")
        result = values.all()
        person = values.person
        files.write_json(folder.metrics_path, to_json(result))
        report = report_text.render(run, result)
        files.write_text(folder.path / "summary.txt", report)
        _export(folder, run, record, person)
        if figures:
            _draw(folder, run, reader, record, followed, person, values.safety, values.tolerances, step)
    return {**to_json(result), "report": report}


def _export(folder: RunFolder, run: Mapping[str, Any], record: RunRecord, person: Person | None) -> None:
    """Write the files that OpenSim's tools replay, for a run on the OpenSim plant."""
    definition = run.get("definition") or {}
    if (definition.get("robot") or {}).get("plant_type") != OPENSIM:
        return
    from hric_bags.export import opensim_files

    opensim_files.write(folder, run, record.log)
    if person is not None:
        from hric_analysis import human_opensim

        plant = ((run.get("parameters") or {}).get("robot") or {}).get("plant") or {}
        gravity = tuple(plant.get("gravity") or WindowlessConfig().gravity)
        human_opensim.write(folder.path, definition["human"], person.record, gravity)


def _draw(
    folder: RunFolder,
    run: Mapping[str, Any],
    bag: Bag,
    record: RunRecord,
    followed: Tracking | None,
    person: Person | None,
    safety: SafetyRecord | None,
    tolerances: Sequence[float],
    step: Callable[[str], object],
) -> None:
    """Draw the figures of a run and of its sensors into its folder `figures`."""
    from hric_report import drawing, figures
    from hric_report.thinning import limited

    step("reading what sensors measured")
    moves, signals = metrics.moves(record, joint_orders(run)), recordings.signals(bag, record.robot_time)
    data = figures.FigureData(record, moves, run.get("limits") or {}, tolerances, person, safety, followed, signals)
    shown = [limited(figure, drawing.POINTS) for figure in figures.of_run(data)]
    del data, signals
    step(f"drawing {len(shown)} figures")
    drawing.draw(folder.path / drawing.FOLDER, shown, title(run))


def bag_of(folder: RunFolder, run: Mapping[str, Any]) -> Path:
    """Return the path of the bag of a run; `run` is the contents of its run.yaml."""
    return folder.path / str(run.get("bag", folder.bag_path.name))


def title(run: Mapping[str, Any]) -> str:
    """Return the title of a run: its experiment and arguments; `run` is the contents of run.yaml."""
    arguments = " ".join(run.get("arguments") or [])
    return f"{run.get('experiment', 'run')} ({arguments})" if arguments else str(run.get("experiment", "run"))
