"""From a run folder to its metrics, figures and report; needs no ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hric_experiments import (
    bag_reader,
    collection,
    collection_record,
    contact_record,
    differences,
    files,
    metrics,
    stability,
    table,
    tracking_analysis,
)
from hric_experiments.experiment import MetricsSpec
from hric_experiments.run_folder import RunFolder

OPENSIM = "opensim_ros_control/OpenSimPlant"
"""Plant whose runs leave files for OpenSim's own tools."""


def analyse(path: str | Path | RunFolder, *, figures: bool = True) -> dict[str, Any]:
    """Compute metrics.json, the figures and summary.txt of a run, and what OpenSim replays of a run in it, replacing those that are there.

    Args:
        path: the run folder.
        figures: whether to draw.

    Returns:
        The metrics, with the report text under "report".

    Raises:
        HricError: no run folder, or its bag cannot be used.
    """
    folder = path if isinstance(path, RunFolder) else RunFolder.open(path)
    run = folder.read()
    record = bag_reader.read(bag_of(folder, run))
    limits: Mapping[str, Mapping[str, float]] = run.get("limits") or {}
    definition = run.get("definition") or {}
    tolerances = tuple((definition.get("metrics") or {}).get("tolerances") or MetricsSpec().tolerances)
    joints_of = joint_orders(run)
    result = {"experiment": run.get("experiment", ""), **metrics.compute(record, limits, joints_of, tolerances)}
    result["real_time_factor"] = run.get("real_time_factor")
    result["reflexes"] = [{"time": time, "errors": list(names)} for time, names in record.reflexes]
    result["contacts"] = contact_record.metrics(contact_record.read(bag_of(folder, run), record.run_time))
    result["stability"] = stability.judge(run, record.log, limits)
    followed = tracking_analysis.analyse(folder, bag_of(folder, run), run, record)
    result["tracking"] = None if followed is None else followed.values
    collected, interval = collection_record.read(bag_of(folder, run)), run.get("interval")
    result |= {"sources": None, "sync": None} if collected is None else collection.metrics(collected, record.log, record.run_time, interval)
    result |= _compared(definition, run.get("parameters") or {}, result)
    files.write_json(folder.metrics_path, result)
    report = table.render(run, result)
    files.write_text(folder.path / "summary.txt", report)
    if (definition.get("robot") or {}).get("plant_type") == OPENSIM:
        from hric_experiments import opensim_files

        opensim_files.write(folder, run, record.log)
    if figures:
        from hric_experiments.figures import draw_all

        draw_all(folder.path, record, metrics.moves(record, joints_of), limits, _title(run), tolerances)
        if followed is not None and followed.data is not None:
            from hric_experiments import tracking_figures

            tracking_figures.draw_all(folder.path, followed.data, followed.record, followed.values, _title(run))
    return {**result, "report": report}


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


def _title(run: Mapping[str, Any]) -> str:
    arguments = " ".join(run.get("arguments") or [])
    return f"{run.get('experiment', 'run')} ({arguments})" if arguments else str(run.get("experiment", "run"))


def _compared(definition: Mapping[str, Any], parameters: Mapping[str, Any], result: Mapping[str, Any]) -> dict[str, Any]:
    name = (definition.get("metrics") or {}).get("reference")
    if not name:
        return {}
    reference = differences.reference(name)
    setpoints = definition.get("setpoints") or []
    controller = parameters.get(setpoints[0]["controller"], {}) if setpoints else {}
    setup = differences.Setup(reference, definition.get("robot") or {}, controller, result)
    return {"reference": {"name": name, "title": reference["title"]}, "differences": differences.compare(setup)}
