"""From a run folder to its metrics, figures and report; needs no ROS."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags.parts import PartsReader
from hric_bags.reader import Messages, RunRecord
from hric_bags.records import contact_record
from hric_bags.run_folder import RunFolder
from hric_control.plants import WindowlessConfig
from hric_experiments.analysis import (
    collection,
    collection_record,
    differences,
    human,
    metrics,
    recordings,
    stability,
)
from hric_experiments.analysis import tracking_run as tracking_analysis
from hric_experiments.analysis.human import Person
from hric_experiments.analysis.tracking_run import Tracking
from hric_experiments.definition.experiment import MetricsSpec
from hric_experiments.report import text as report_text

OPENSIM = "opensim_ros_control/OpenSimPlant"
"""Plant whose runs leave files for OpenSim's own tools."""
STEPS, FIGURE_STEPS = 3, 2
"""Of `analyse`, and with figures so many more."""


def analyse(
    path: str | Path | RunFolder,
    *,
    figures: bool = True,
    step: Callable[[str], object] = str,
    known: Messages | None = None,
) -> dict[str, Any]:
    """Compute metrics.json, the figures and summary.txt of a run, and what OpenSim replays of a run in it, replacing
    those that are there.

    Args:
        path: the run folder.
        figures: whether to draw.
        step: called with what begins, since a minute of samples takes a minute, too; str: nobody looks on.
        known: the bag's messages, from whoever has just written them.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: no run folder, or its bag cannot be used.
    """
    folder = path if isinstance(path, RunFolder) else RunFolder.open(path)
    run = folder.read()
    bag, definition = bag_of(folder, run), run.get("definition") or {}
    step("reading the control log")
    tolerances = tuple((definition.get("metrics") or {}).get("tolerances") or MetricsSpec().tolerances)
    with bag_reader.opened(bag) as reader:
        record = bag_reader.read(reader, known)
        step("how a marker was followed")
        followed = tracking_analysis.analyse(folder, reader, run, record)
        step("metrics of motion, contacts and samples")
        result = _metrics(run, reader, record, tolerances)
        person = human.analyse(reader, run, folder.description(), record)
    result |= _of_human(person, result["stability"])
    result["tracking"] = None if followed is None else followed.values
    result |= _compared(definition, run.get("parameters") or {}, result)
    files.write_json(folder.metrics_path, result)
    report = report_text.render(run, result)
    files.write_text(folder.path / "summary.txt", report)
    _export(folder, run, record, person)
    if figures:
        _draw(folder, run, bag, record, followed, person, tolerances, step)
    return {**result, "report": report}


def _of_human(person: Person | None, judged: Mapping[str, Any]) -> dict[str, Any]:
    """What a human adds to metrics.json; judged: the verdict on the control loop, to which he may add reasons."""
    if person is None:
        return {"human": None}
    return {"human": person.values, "stability": stability.also(judged, human.unrest(person.values["settling"]))}


def _export(folder: RunFolder, run: Mapping[str, Any], record: RunRecord, person: Person | None) -> None:
    """What OpenSim's own tools replay, of a run on it."""
    definition = run.get("definition") or {}
    if (definition.get("robot") or {}).get("plant_type") != OPENSIM:
        return
    from hric_bags.export import opensim_files

    opensim_files.write(folder, run, record.log)
    if person is not None:
        from hric_experiments.analysis import human_opensim

        plant = ((run.get("parameters") or {}).get("robot") or {}).get("plant") or {}
        gravity = tuple(plant.get("gravity") or WindowlessConfig().gravity)
        human_opensim.write(folder.path, definition["human"], person.record, gravity)


def _draw(
    folder: RunFolder,
    run: Mapping[str, Any],
    bag: Path,
    record: RunRecord,
    followed: Tracking | None,
    person: Person | None,
    tolerances: Sequence[float],
    step: Callable[[str], object],
) -> None:
    """The figures of a run and what its sensors measured, into its folder `figures`."""
    from hric_experiments.report import drawing, human_figures, run_figures, signal_figures

    step("reading what sensors measured")
    moves = metrics.moves(record, joint_orders(run))
    shown = run_figures.robot_figures(record, moves, run.get("limits") or {}, tolerances)
    shown += human_figures.human_figures(person)
    shown += run_figures.tracking_figures(followed)
    shown += signal_figures.signal_figures(recordings.read(bag, record.robot_time, signals_only=True).signals)
    step(f"drawing {len(shown)} figures")
    drawing.draw(folder.path / drawing.FOLDER, shown, title(run))


def _metrics(
    run: Mapping[str, Any], bag: PartsReader, record: RunRecord, tolerances: Sequence[float]
) -> dict[str, Any]:
    """What follows from the run alone, for metrics.json."""
    limits: Mapping[str, Mapping[str, float]] = run.get("limits") or {}
    collected, interval = collection_record.read(bag), run.get("interval")
    return {
        "experiment": run.get("experiment", ""),
        **metrics.compute(record, limits, joint_orders(run), tolerances),
        "real_time_factor": run.get("real_time_factor"),
        "missed_deadlines": collection_record.missed_deadlines(bag),
        "reflexes": [{"time": time, "errors": list(names)} for time, names in record.reflexes],
        "contacts": contact_record.metrics(contact_record.read(bag, record.robot_time)),
        "stability": stability.judge(run, record.log, limits),
        **collection.metrics(collected, record.log, record.robot_time, interval),
    }


def bag_of(folder: RunFolder, run: Mapping[str, Any]) -> Path:
    """The bag of a run; run: contents of its run.yaml."""
    return folder.path / str(run.get("bag", folder.bag_path.name))


def joint_orders(run: Mapping[str, Any]) -> dict[str, list[str]]:
    """Joint order of each controller of a run that names its joints; run: contents of run.yaml."""
    found = {}
    for name, values in (run.get("parameters") or {}).items():
        if isinstance(values, Mapping) and isinstance(values.get("joints"), list) and values["joints"]:
            found[name] = [str(joint) for joint in values["joints"]]
    return found


def title(run: Mapping[str, Any]) -> str:
    """Of a run: its experiment and its arguments; run: contents of run.yaml."""
    arguments = " ".join(run.get("arguments") or [])
    return f"{run.get('experiment', 'run')} ({arguments})" if arguments else str(run.get("experiment", "run"))


def _compared(
    definition: Mapping[str, Any], parameters: Mapping[str, Any], result: Mapping[str, Any]
) -> dict[str, Any]:
    name = (definition.get("metrics") or {}).get("reference")
    if not name:
        return {}
    reference = differences.reference(name)
    setpoints = definition.get("setpoints") or []
    controller = parameters.get(setpoints[0]["controller"], {}) if setpoints else {}
    setup = differences.Setup(reference, definition.get("robot") or {}, controller, result)
    return {"reference": {"name": name, "title": reference["title"]}, "differences": differences.compare(setup)}
