"""Execution of a study: each form is a sweep whose rows are recorded runs; their comparisons, and one verdict."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hric_analysis import stability
from hric_bags import files
from hric_bags import reader as bag_reader
from hric_bags import text as text_table
from hric_bags.reader import ControlRecord, FloatArray
from hric_bags.run_file import RunFile
from hric_bags.run_folder import COMPLETED, INTERRUPTED, RUNNING, RunFolder, iso_now
from hric_core.errors import NOT_GOOD, FailureError, HricError
from hric_core.parameters import read_yaml
from hric_core.processes import INTERRUPTED_CODE
from hric_core.urdf import read
from hric_report.compare import compare
from hric_run import simulation
from hric_run.definition.experiment import Experiment
from hric_run.simulation import Simulation
from hric_sweep import definition as sweep_definition
from hric_sweep.definition import ROW, Plan
from hric_sweep.engines.make import resume_command
from hric_sweep.engines.pebble_engine import InProcessEngine
from hric_sweep.journal import Journal
from hric_sweep.records import PlainData
from hric_sweep.study import definition, tables
from hric_sweep.study.definition import Form, Pair, Study
from hric_sweep.supervisor import Supervisor
from hric_sweep.task import code_version

FILE = "study.yaml"
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
    metrics: PlainData
    interrupted: bool

    @property
    def passed(self) -> bool:
        """True if every difference is within its bound and every control loop is stable.

        An unstable interaction of human and robot does not count here: finding it may be the purpose of a study.
        """
        forms = self.metrics["forms"].values()
        stable = all(run["stability"] != stability.UNSTABLE for form in forms for run in form["runs"].values())
        return stable and all(pair["passed"] is not False for form in forms for pair in form["compared"])

    @property
    def exit_code(self) -> int:
        """Exit code of the command that ran it."""
        return INTERRUPTED_CODE if self.interrupted else 0 if self.passed else NOT_GOOD


@dataclass(frozen=True)
class StudySettings:
    """Settings of the execution of a study, as study.yaml has them.

    Attributes:
        name: name of the study.
        content: content of the study file.
        forms: names of the forms to run.
        arguments: overrides of the user, for all runs.
        seed: seed of all runs.
        figures: True if figures are drawn.
    """

    name: str
    content: PlainData
    forms: Sequence[str]
    arguments: Sequence[str]
    seed: int
    figures: bool


def resume(folder: Path, *, progress: bool) -> int:
    """Resume a study in its folder, print its report, and return the exit code."""
    folder = folder.resolve()
    result = _run(StudySettings(**read_yaml(folder / FILE)), RunFolder(folder), progress=progress)
    print(f"\n{result.metrics['report']}\nstudy: {result.folder}")
    return result.exit_code


def run(
    study: Study,
    forms: Sequence[Form],
    arguments: Sequence[str],
    *,
    seed: int,
    root: Path,
    progress: bool,
    figures: bool,
) -> StudyResult:
    """Run the forms one after the other. Each run has its own run folder next to that of the study.

    Raises:
        HricError: a run fails, or two runs cannot be compared.
    """
    for form in forms:
        for name in form.runs:
            simulation.check(form.definition(name, arguments))  # report mistakes before anything runs
    folder = RunFolder.create(root, study.name)
    names = [form.name for form in forms]
    settings = StudySettings(study.name, study.content, names, list(arguments), seed, figures)
    head: RunFile = {"study": study.name, "description": study.description, "experiment": study.name}
    folder.write({**head, "arguments": list(arguments), "seed": seed, "status": RUNNING, "started": iso_now()})
    files.write_yaml(folder.path / FILE, vars(settings))
    return _run(settings, folder, progress=progress)


def _run(settings: StudySettings, folder: RunFolder, *, progress: bool) -> StudyResult:
    """Run or resume a study in its folder."""
    forms: dict[str, PlainData] = {}
    interrupted = False
    try:
        with folder.filled():
            for form in definition.parse(settings.name, settings.content).chosen(settings.forms):
                forms[form.name] = _form(form, settings, folder.path, progress)
    except KeyboardInterrupt:
        print(f"\ninterrupted; resume with: {resume_command(folder.path)}", file=sys.stderr)
        interrupted = True
    finally:
        folder.become_latest()
    result = {"study": settings.name, "arguments": settings.arguments, "forms": forms}
    report = render(result)
    files.write_json(folder.metrics_path, result)
    files.write_text(folder.path / "summary.txt", report)
    folder.update(status=INTERRUPTED if interrupted else COMPLETED, finished=iso_now())
    return StudyResult(folder.path, {**result, "report": report}, interrupted)


def _form(form: Form, settings: StudySettings, folder: Path, progress: bool) -> PlainData:
    """Return the results of a form. Raises KeyboardInterrupt; HricError: a run fails, or runs cannot be compared."""
    runs = _runs(form, settings, folder, progress)
    logs = {name: bag_reader.read(run.bag_of(run.read())).log for name, run in runs.items()}
    metrics = {name: json.loads(run.metrics_path.read_text()) for name, run in runs.items()}
    results = {name: _result(run, metrics[name], logs[name]) for name, run in runs.items()}
    result = {
        "experiment": form.experiment,
        "changes": list(form.changes),
        "runs": results,
        "compared": [_compared(pair, runs, metrics, folder / form.name, settings.figures) for pair in form.compared],
    }
    if not settings.figures:
        return result
    poses = _draw(form, runs, logs, settings.arguments, folder / form.name, results)
    return {**result, "start_pose_difference_max": poses}


def plan_of(form: Form, settings: StudySettings, root: Path) -> Plan:
    """Return a form as a sweep: a list of recorded runs with one seed."""
    content = {
        "extends": form.experiment,
        "sweep": {
            "rows": {name: form.arguments(name, settings.arguments) for name in form.runs},
            "sampler": {"kind": "list"},
            "seeds": "common",
            "seed": settings.seed,
            "outputs": tables.OUTPUTS,
            "keep": {"worst": 0, "failed": False},
        },
    }
    return replace(sweep_definition.plan(Path(form.experiment).stem, content), runs_folder=str(root))


def _runs(form: Form, settings: StudySettings, folder: Path, progress: bool) -> dict[str, RunFolder]:
    """Execute the runs of a form that the journal lacks, and return the folders of all."""
    plan = plan_of(form, settings, folder.parent)
    files.make_folder(folder / form.name)
    bar = tqdm(total=len(form.runs), unit=" runs", desc=form.name, leave=False, disable=None if progress else True)
    with Journal(folder / form.name) as journal, closing(bar):
        engine, code = InProcessEngine(), code_version()
        supervisor = Supervisor(plan, folder / form.name, journal, engine, code, lambda _: bar.update())
        supervisor.run()
    if failures := [f"{row.values[ROW]}: {row.failure}" for row in supervisor.rows.values() if row.failure]:
        raise FailureError(f"form {form.name}, run {'; '.join(failures)}")
    return {row.values[ROW]: RunFolder(folder.parent / row.run) for row in supervisor.rows.values()}


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
    """Return the values of thesis fig. 17: number of calls of the law, and whether the time it saw ever went back."""
    steps = np.diff(time)
    return {
        "calls": len(time),
        "strictly_rising": bool(np.all(steps > 0.0)),
        "backward_steps": int(np.count_nonzero(steps <= 0.0)),
        "step_min": float(steps.min()),
        "step_max": float(steps.max()),
    }


def _compared(
    pair: Pair, runs: Mapping[str, RunFolder], metrics: Mapping[str, PlainData], folder: Path, figures: bool
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


def _passed(pair: Pair, robot: float, person: float | None, force: float | None) -> bool | None:
    """Return True if joints of robot and human, and grip forces, are within the bounds of a pair; None: it has none."""
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
    """Draw the figures of a form, and return the largest difference of link frames at the start [m], [1]."""
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


def render(result: PlainData) -> str:
    """Return the study as text, for the terminal and summary.txt; `result`: content of metrics.json."""
    parts = [f"{result['study']}" + (f", {' '.join(result['arguments'])}" if result["arguments"] else "")]
    for name, form in result["forms"].items():
        lines = [f"{name}: {form['experiment']} {' '.join(form['changes'])}"]
        lines += [_run_line(run, values) for run, values in form["runs"].items()]
        if "start_pose_difference_max" in form:
            lines.append(
                f"  link frames at the start agree within {form['start_pose_difference_max']:.1e} (m, and entries of "
                "the rotation)"
            )
        lines += tables.lines(form["runs"], "tracking", "following the marker", tables.TRACKING_COLUMNS)
        lines += tables.lines(form["runs"], "human", "the human, a model's estimate", tables.HUMAN_COLUMNS)
        parts.append("\n".join([*lines, "", *_differences(form["compared"])]))
    return "\n\n".join(parts) + "\n"


def _run_line(name: str, run: PlainData) -> str:
    law = run["law_times"]
    rising = "time strictly rises" if law["strictly_rising"] else f"time went BACK {law['backward_steps']} times"
    unstable = ", UNSTABLE" * (run["stability"] == stability.UNSTABLE)
    factor = f"{run['real_time_factor']:.2f} times real time"
    return f"  {name}: {law['calls']} calls of the law, {rising}{unstable}; {factor} ({run['run']})"


def _differences(pairs: Sequence[PlainData]) -> list[str]:
    people = [key for key in PEOPLE if any(pair[key] is not None for pair in pairs)]
    forces = any(pair["force_bound"] is not None for pair in pairs)
    head = ["joint positions apart [rad]", "largest", "rms", "steady", *(PEOPLE[key] for key in people), "at most"]
    cells = [[*head, *(["at most [N]"] if forces else []), ""]]
    for pair in pairs:
        verdict = {None: "reported", True: "within bounds", False: "OUT OF BOUNDS"}[pair["passed"]]
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
    with Simulation(definition) as at_start:
        plant = at_start.app.hw.plant
        if plant is None:
            raise HricError(f"{definition.robot.hw} has no plant: its links have no poses")
        return {name: plant.link_state(name)[0] for name in read(at_start.tree["robot_description"]).links}
