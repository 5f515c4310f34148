"""Execution of a study: its forms (experiments with variants) one after the other, and the overall result."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hric_analysis import stability
from hric_bags import files
from hric_bags.run_file import RunFile
from hric_bags.run_folder import COMPLETED, INTERRUPTED, RUNNING, RunFolder, iso_now
from hric_core.errors import NOT_GOOD
from hric_core.parameters import read_yaml
from hric_core.processes import INTERRUPTED_CODE
from hric_run import simulation
from hric_sweep.engines.make import resume_command
from hric_sweep.records import PlainData
from hric_sweep.study import definition, results
from hric_sweep.study.definition import Form, Study
from hric_sweep.study.execution import execute
from hric_sweep.study.report import render

FILE = "study.yaml"


@dataclass(frozen=True)
class StudyResult:
    """Result of a study.

    Attributes:
        folder: run folder of the study, with metrics.json, summary.txt and the figures.
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
        """Exit code of the command that ran the study."""
        return INTERRUPTED_CODE if self.interrupted else 0 if self.passed else NOT_GOOD


@dataclass(frozen=True)
class StudySettings:
    """Settings with which a study was started, as stored in study.yaml.

    Attributes:
        name: name of the study.
        content: content of the study file.
        forms: names of the forms to run.
        arguments: overrides of the user, for all runs.
        seed: seed of all runs.
        figures: True to draw figures.
    """

    name: str
    content: PlainData
    forms: Sequence[str]
    arguments: Sequence[str]
    seed: int
    figures: bool


def resume(folder: Path, *, progress: bool) -> int:
    """Resume the study in a run folder, print its report, and return the exit code."""
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
    """Run forms of a study one after the other; each run gets a run folder next to that of the study.

    Raises:
        HricError: a run failed, or two runs cannot be compared.
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
    """Run or resume a study in its run folder."""
    forms: dict[str, PlainData] = {}
    interrupted = False
    try:
        with folder.filled():
            for form in definition.parse(settings.name, settings.content).chosen(settings.forms):
                runs = execute(form, settings.arguments, settings.seed, folder.path, progress=progress)
                forms[form.name] = results.of_form(
                    form, runs, settings.arguments, folder.path, figures=settings.figures
                )
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
