"""Results of one form (experiment with variants) of a study: values of its runs, comparisons, and figures."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hric_bags import reader as bag_reader
from hric_bags.reader import ControlRecord, FloatArray
from hric_bags.run_folder import RunFolder
from hric_core.errors import HricError
from hric_core.urdf import read
from hric_report.compare import compare
from hric_run.definition.experiment import Experiment
from hric_run.simulation import Simulation
from hric_sweep.records import PlainData
from hric_sweep.study import tables
from hric_sweep.study.definition import ComparedPair, Form


def of_form(
    form: Form, runs: Mapping[str, RunFolder], arguments: Sequence[str], folder: Path, *, figures: bool
) -> PlainData:
    """Return the results of one form of a study, as plain data for metrics.json.

    Args:
        form: form that was run.
        runs: run folders of its runs, by name.
        arguments: overrides of the user, for all runs.
        folder: run folder of the study.
        figures: True to draw figures.

    Raises:
        HricError: runs cannot be compared.
    """
    logs = {name: bag_reader.read(run.bag_of(run.read())).log for name, run in runs.items()}
    metrics = {name: json.loads(run.metrics_path.read_text()) for name, run in runs.items()}
    results = {name: _result(run, metrics[name], logs[name]) for name, run in runs.items()}
    result = {
        "experiment": form.experiment,
        "changes": list(form.changes),
        "runs": results,
        "compared": [_compared(pair, runs, metrics, folder / form.name, figures) for pair in form.compared],
    }
    if not figures:
        return result
    poses = _draw(form, runs, logs, arguments, folder / form.name, results)
    return {**result, "start_pose_difference_max": poses}


def _result(folder: RunFolder, metrics: PlainData, log: ControlRecord) -> PlainData:
    run = folder.read()
    return {
        "run": folder.path.name,
        "arguments": run["arguments"],
        "real_time_factor": run.get("real_time_factor"),
        "stability": metrics["stability"]["loop"],
        "law_times": law_times(log.time),
        "tracking": tables.values(metrics, "tracking", tables.TRACKING_COLUMNS),
        "human": tables.values(metrics, "human", tables.HUMAN_COLUMNS),
    }


def law_times(time: FloatArray) -> PlainData:
    """Return the number of calls of the control law, and if the time passed to it ever went back (thesis fig. 17).

    `time`: time passed to the control law at each call, shape (n,) [s].
    """
    steps = np.diff(time)
    return {
        "calls": len(time),
        "strictly_rising": bool(np.all(steps > 0.0)),
        "backward_steps": int(np.count_nonzero(steps <= 0.0)),
        "step_min": float(steps.min()),
        "step_max": float(steps.max()),
    }


def _compared(
    pair: ComparedPair, runs: Mapping[str, RunFolder], metrics: Mapping[str, PlainData], folder: Path, figures: bool
) -> PlainData:
    a, b = pair.runs
    result = compare(runs[a], runs[b], folder / f"{a}_{b}", labels=(a, b), figures=figures)
    moves, person = result["setpoints"], result["human"] or {}
    differences = {
        "peak_difference_max": max(move["peak_difference_max"] for move in moves),
        "human_joint_difference_max": person.get("joint_difference_max"),
        "human_force_difference_max": person.get("force_difference_max"),
    }
    last = {name: metrics[name]["setpoints"][-1:] for name in pair.runs}
    return {
        "runs": [a, b],
        **differences,
        "rms_difference_max": max(joint["rms_difference"] for move in moves for joint in move["joints"].values()),
        "steady_difference_max": max(move["steady_difference_max"] for move in moves),
        "at_most": pair.at_most,
        "force_bound": pair.force_bound,
        "passed": _passed(pair, *differences.values()),
        "settling_time": {name: dict(move[0]["settling_time_max"]) if move else {} for name, move in last.items()},
    }


def _passed(pair: ComparedPair, robot: float, person: float | None, force: float | None) -> bool | None:
    """Return True if all differences are within the bounds of a pair; None: no difference has a bound.

    `robot`, `person`: largest difference of joint positions [rad]; `force`: of grip forces [N]; None: not known.
    """
    bounds = ((robot, pair.at_most), (person, pair.at_most), (force, pair.force_bound))
    within = [value <= bound for value, bound in bounds if value is not None and bound is not None]
    return all(within) if within else None


def _draw(
    form: Form,
    runs: Mapping[str, RunFolder],
    logs: Mapping[str, ControlRecord],
    arguments: Sequence[str],
    folder: Path,
    results: Mapping[str, PlainData],
) -> float:
    """Draw the figures of a form; return the largest difference of link frames at the start of its runs [m or 1]."""
    from hric_report import drawing
    from hric_sweep.study import figures

    engines: dict[str, str] = {}
    for name in form.runs:
        engines.setdefault(form.definition(name, arguments).robot.plant_type, name)
    shown = list(engines.values()) if len(engines) > 1 else form.compared[0].runs  # a run of each engine, or a pair
    poses = {name: start_poses(form.definition(name, arguments)) for name in shown}
    tracking, human = tables.tracking_figure(runs), tables.human_figure(results, form.abscissa)
    drawn = [*figures.motion(logs), figures.times({name: log.time for name, log in logs.items()}), tracking, human]
    drawing.draw(folder, [figure for figure in drawn if figure is not None], form.name)
    figures.draw_poses(folder, poses, form.name)
    first, *others = poses.values()
    return max(float(np.abs(first[link] - other[link]).max()) for other in others for link in first if link in other)


def start_poses(definition: Experiment) -> dict[str, FloatArray]:
    """Return T_world_link of each link at the start of a run, shape (4, 4), in the order of the robot description.

    Raises:
        HricError: the robot cannot be built, or is not simulated.
    """
    with Simulation(definition) as at_start:
        plant = at_start.app.hw.plant
        if plant is None:
            raise HricError(f"the robot {definition.robot.hw} is not simulated, so its link poses are unknown")
        return {name: plant.link_state(name)[0] for name in read(at_start.tree["robot_description"]).links}
