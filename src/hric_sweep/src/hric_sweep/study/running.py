"""Headless execution of a study: every run of every form, the comparisons, and one verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hric_analysis import stability
from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.reader import ControlRecord, FloatArray
from hric_bags.run_folder import COMPLETED, INTERRUPTED, RUNNING, RunFolder, iso_now
from hric_control.robot_app import RobotApp
from hric_core.errors import HricError
from hric_core.local.node import LocalNode
from hric_core.urdf import read
from hric_report import headless
from hric_report.compare import compare
from hric_report.headless import Result
from hric_report.run import bag_of
from hric_run import simulation
from hric_run.definition import parameters
from hric_run.definition.experiment import Experiment
from hric_sweep.study import human as study_human
from hric_sweep.study import tracking as study_tracking
from hric_sweep.study.definition import Form, Pair, Study

PEOPLE = {
    "human_joint_difference_max": "of a human's joint",
    "human_force_difference_max": "of a grip's force [N]",
}
"""Headings of the largest differences that only runs with a human have."""


@dataclass(frozen=True)
class StudyResult:
    """Result of a study.

    Attributes:
        folder: folder with metrics.json, summary.txt and the figures.
        metrics: content of metrics.json, plus the report text under "report".
        interrupted: True if Ctrl-C ended the study early.
    """

    folder: Path
    metrics: dict[str, Any]
    interrupted: bool

    @property
    def passed(self) -> bool:
        """True if every difference is within its bound and every control loop is stable.

        An unstable interaction of human and robot does not count here: finding it may be the purpose of a sweep.
        """
        forms = self.metrics["forms"].values()
        stable = all(run["stability"] != stability.UNSTABLE for form in forms for run in form["runs"].values())
        return stable and all(pair["passed"] is not False for form in forms for pair in form["compared"])


def run(
    study: Study, forms: Sequence[Form], given: Sequence[str], *, seed: int, root: Path, progress: bool, figures: bool
) -> StudyResult:
    """Run the forms one after the other. Each run has its own run folder next to that of the study.

    Raises:
        HricError: a run fails, or two runs cannot be compared.
    """
    for form in forms:
        for name in form.runs:
            simulation.check(form.definition(name, given))  # report mistakes before anything runs
    folder = RunFolder.create(root, study.name)
    head = {
        "study": study.name,
        "description": study.description,
        "experiment": study.name,
        "arguments": list(given),
        "seed": seed,
    }
    folder.write({**head, "status": RUNNING, "started": iso_now()})
    try:
        with folder.filled():
            result, interrupted = _forms(forms, given, seed, folder.path, root, progress, figures)
    finally:
        folder.become_latest()
    result = {"study": study.name, "arguments": list(given), "forms": result}
    report = render(result)
    files.write_json(folder.metrics_path, result)
    files.write_text(folder.path / "summary.txt", report)
    folder.update(status=INTERRUPTED if interrupted else COMPLETED, finished=iso_now())
    return StudyResult(folder.path, {**result, "report": report}, interrupted)


def _forms(
    forms: Sequence[Form], given: Sequence[str], seed: int, folder: Path, root: Path, progress: bool, figures: bool
) -> tuple[dict[str, Any], bool]:
    """Return the results by form, and True if Ctrl-C interrupted the study."""
    found: dict[str, Any] = {}
    for form in forms:
        runs, interrupted = _runs(form, given, seed, root, progress)
        if interrupted:
            return found, True
        logs = {name: log_of(run.folder) for name, run in runs.items()}
        found[form.name] = {
            "experiment": form.experiment,
            "changes": list(form.changes),
            "runs": {name: _run(run, logs[name]) for name, run in runs.items()},
            "compared": [_pair(pair, runs, folder / form.name, figures) for pair in form.compared],
        }
        if figures:
            _draw(form, runs, logs, given, folder / form.name, found[form.name])
    return found, False


def _runs(form: Form, given: Sequence[str], seed: int, root: Path, progress: bool) -> tuple[dict[str, Result], bool]:
    """Return the result of each run, and True if Ctrl-C interrupted the study."""
    found: dict[str, Result] = {}
    for name in form.runs:
        result = headless.run(
            form.definition(name, given),
            form.arguments(name, given),
            seed=seed,
            root=root,
            progress=progress,
            figures=False,
        )
        if result.interrupted:
            return found, True
        found[name] = result
    return found, False


def log_of(folder: RunFolder) -> ControlRecord:
    """Return the control log of a run, with every cycle."""
    return bag_reader.read(bag_of(folder, folder.read())).log


def _run(result: Result, log: ControlRecord) -> dict[str, Any]:
    data = result.folder.read()
    return {
        "run": result.folder.path.name,
        "arguments": data["arguments"],
        "real_time_factor": data.get("real_time_factor"),
        "stability": result.metrics["stability"]["loop"],
        "law_times": law_times(log.time),
        "tracking": study_tracking.chosen(result.metrics),
        "human": study_human.chosen(result.metrics),
    }


def law_times(time: FloatArray) -> dict[str, Any]:
    """Return the values of thesis fig. 17: number of calls of the law, and whether the time it saw ever went back."""
    steps = np.diff(time)
    return {
        "calls": len(time),
        "strictly_rising": bool(np.all(steps > 0.0)),
        "backward_steps": int(np.count_nonzero(steps <= 0.0)),
        "step_min": float(steps.min()),
        "step_max": float(steps.max()),
    }


def _pair(pair: Pair, runs: Mapping[str, Result], folder: Path, figures: bool) -> dict[str, Any]:
    a, b = pair.runs
    found = compare(runs[a].folder, runs[b].folder, folder / f"{a}_{b}", labels=(a, b), figures=figures)
    peak = max(move["peak_difference_max"] for move in found["setpoints"])
    steady = max(move["steady_difference_max"] for move in found["setpoints"])
    rms = max(joint["rms_difference"] for move in found["setpoints"] for joint in move["joints"].values())
    person = found["human"] or {}
    apart = {
        "peak_difference_max": peak,
        "human_joint_difference_max": person.get("joint_difference_max"),
        "human_force_difference_max": person.get("force_difference_max"),
    }
    return {
        "runs": [a, b],
        **apart,
        "rms_difference_max": rms,
        "steady_difference_max": steady,
        "at_most": pair.at_most,
        "force_bound": pair.force_bound,
        "passed": _passed(pair, *apart.values()),
        "settling_time": {name: _settling(runs[name]) for name in (a, b)},
    }


def _passed(pair: Pair, robot: float, person: float | None, force: float | None) -> bool | None:
    """Return True if joints of robot and human, and grip forces, are within the bounds of a pair; None: it has none."""
    bounds = ((robot, pair.at_most), (person, pair.at_most), (force, pair.force_bound))
    held = [apart <= bound for apart, bound in bounds if apart is not None and bound is not None]
    return all(held) if held else None


def _settling(result: Result) -> dict[str, Any]:
    moves = result.metrics["setpoints"]
    return dict(moves[-1]["settling_time_max"]) if moves else {}


def _draw(
    form: Form,
    runs: Mapping[str, Result],
    logs: Mapping[str, ControlRecord],
    given: Sequence[str],
    folder: Path,
    result: dict[str, Any],
) -> None:
    from hric_report import drawing
    from hric_sweep.study import figures as study_figures

    poses = {name: start_poses(form.definition(name, given)) for name in _one_of_each_engine(form, given)}
    first, *others = poses.values()
    result["start_pose_difference_max"] = max(
        float(np.abs(first[link] - other[link]).max()) for other in others for link in first if link in other
    )
    followed = study_tracking.figure({name: run.folder for name, run in runs.items()})
    shown = [*study_figures.motion(logs), study_figures.times({name: log.time for name, log in logs.items()})]
    shown += [one for one in (followed, study_human.figure(result["runs"], form.abscissa)) if one is not None]
    drawing.draw(folder, shown, form.name)
    study_figures.draw_poses(folder, poses, form.name)


def _one_of_each_engine(form: Form, given: Sequence[str]) -> Sequence[str]:
    """Return the first run on each engine, or the first pair if all runs use the same engine."""
    engines: dict[str, str] = {}
    for name in form.runs:
        engines.setdefault(form.definition(name, given).robot.plant_type, name)
    return list(engines.values()) if len(engines) > 1 else form.compared[0].runs


def render(result: Mapping[str, Any]) -> str:
    """Return the study as text, for the terminal and summary.txt; `result`: content of metrics.json."""
    parts = [f"{result['study']}" + (f", {' '.join(result['arguments'])}" if result["arguments"] else "")]
    for name, form in result["forms"].items():
        lines = [f"{name}: {form['experiment']} {' '.join(form['changes'])}"]
        for run, values in form["runs"].items():
            law = values["law_times"]
            rising = (
                "time strictly rises" if law["strictly_rising"] else f"time went BACK {law['backward_steps']} times"
            )
            rising += ", UNSTABLE" if values["stability"] == stability.UNSTABLE else ""
            lines.append(
                f"  {run}: {law['calls']} calls of the law, {rising}; {values['real_time_factor']:.2f} times real "
                f"time ({values['run']})"
            )
        if "start_pose_difference_max" in form:
            lines.append(
                f"  link frames at the start agree within {form['start_pose_difference_max']:.1e} (m, and entries of "
                "the rotation)"
            )
        parts.append(
            "\n".join(
                [
                    *lines,
                    *study_tracking.lines(form["runs"]),
                    *study_human.lines(form["runs"]),
                    "",
                    *_differences(form["compared"]),
                ]
            )
        )
    return "\n\n".join(parts) + "\n"


def _differences(pairs: Sequence[Mapping[str, Any]]) -> list[str]:
    people = [key for key in PEOPLE if any(pair[key] is not None for pair in pairs)]
    forces = any(pair["force_bound"] is not None for pair in pairs)
    head = ["joint positions apart [rad]", "largest", "rms", "steady", *(PEOPLE[key] for key in people), "at most"]
    cells = [[*head, *(["at most [N]"] if forces else []), ""]]
    for pair in pairs:
        verdict = {None: "reported", True: "holds", False: "FALLS SHORT"}[pair["passed"]]
        keys = ("peak_difference_max", "rms_difference_max", "steady_difference_max", *people)
        bounds = [_small(pair["at_most"]), *([_small(pair["force_bound"])] if forces else [])]
        cells.append([" - ".join(pair["runs"]), *(_small(pair[key], ".2e") for key in keys), *bounds, verdict])
    return text_table.rows(cells)


def _small(value: float | None, digits: str = ".1e") -> str:
    return "-" if value is None else f"{value:{digits}}"


def start_poses(definition: Experiment) -> dict[str, FloatArray]:
    """Return T_world_link of each link that the engine knows, shape (4, 4), in the order of the description.

    Raises:
        HricError: the robot cannot be built, or has no plant.
    """
    text = parameters.description(definition.robot)
    values = parameters.robot(definition) | {"real_time_factor": 0.0}
    node = LocalNode(
        {"robot_description": text, "joint_limits": parameters.joint_limits(definition), parameters.ROBOT: values}
    )
    app = RobotApp(node, node.child(parameters.ROBOT))
    try:
        plant = app.hw.plant
        if plant is None:
            raise HricError(f"{definition.robot.hw} has no plant: its links have no poses")
        return {name: plant.link_state(name)[0] for name in read(text).links}
    finally:
        app.shutdown()
