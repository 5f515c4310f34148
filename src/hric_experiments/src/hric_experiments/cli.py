"""Commands: run, list, report, compare, describe and schema."""

import argparse
import contextlib
import json
import logging
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from hric_bags import text
from hric_bags.arguments import RUNS, run_arguments, run_names
from hric_bags.run_folder import RunFolder
from hric_bags.text import Steps
from hric_core import plugins
from hric_core.command import Argument, Command
from hric_core.parameters import Settings, json_schema, read_yaml, whole
from hric_core.processes import INTERRUPTED_CODE
from hric_run.definition import experiment, overrides
from hric_sweep.study import definition as study

DESCRIBED = {
    "robot": "robot",
    "limits": "joint_limits",
    "controllers": "controllers",
    "mocap": "mocap",
    "human_muscles": "human_muscles",
}
"""Choices of `describe` that are printed as YAML, with the function of `parameters` that returns the values."""
NODES = ("natnet_client", "emulated_human", "synchronizer", "person", "supervisor")
"""Nodes, in addition to those of sensors, whose private parameters `describe` prints."""


class RunCommand(Command):
    """Run an experiment without a ROS master, as fast as the machine allows, and leave a run folder."""

    epilog = (
        "overrides (or the dotted path of any key of the experiment file, e.g. "
        f"robot.plant.friction:=identified):\n{overrides.help_text()}"
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *_experiment_arguments(
                f"one of: {', '.join(experiment.names())}; a study: {', '.join(study.names())}; or the path of a "
                "YAML file"
            ),
            Argument(
                "--form",
                action="append",
                default=[],
                metavar="NAME",
                help="of a study: only this form, may be repeated",
            ),
            Argument("--seed", type=int, default=0, help="seed of everything random (0)"),
            RUNS,
            Argument(
                "--quiet", action="store_true", help="no progress bar and no report, only errors and the run folder"
            ),
            Argument("--no-figures", action="store_true", help="do not draw"),
            Argument(
                "--html", action="store_true", help="leave report.html, too: one file with plots, tables and a replay"
            ),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Run an experiment or a study headless."""
        _sort_words(given)
        whole(minimum=0).checked(given.seed, "--seed")
        _log_to_terminal(given.quiet)
        if study.is_study(given.experiment):
            return _run_study(given)
        if given.form:
            raise experiment.ExperimentError(
                f"{given.experiment} is no study, so it has no form {given.form[0]}; studies: "
                f"{', '.join(study.names())}"
            )
        return _run_experiment(given)


def _run_experiment(given: argparse.Namespace) -> int:
    definition = experiment.load(given.experiment, given.overrides)
    from hric_assessment.verdict.conclusions import unknown_beforehand
    from hric_report import headless  # slow to import: errors are reported before

    if not given.quiet and (lacking := unknown_beforehand(definition.human)):
        print(lacking, file=sys.stderr)
    result = headless.run(
        definition,
        given.overrides,
        seed=given.seed,
        root=given.runs,
        progress=not given.quiet,
        figures=not given.no_figures,
    )
    if not given.quiet:
        text.show(f"\n{result.metrics['report']}")
    else:
        print(
            "".join(f"unstable: {reason}\n" for reason in result.metrics["stability"]["reasons"]),
            end="",
            file=sys.stderr,
        )
    print(f"state_sha256: {result.metrics['state_sha256']}\nrun folder: {result.folder.path}")
    if given.html:
        _html(result.folder, progress=not given.quiet)
    if result.interrupted:
        print("interrupted; the bag holds what ran until then", file=sys.stderr)
        return INTERRUPTED_CODE
    return 0


def _experiment_arguments(what: str) -> list[Argument]:
    """Return experiment and overrides, which may stand in any order; `_sort_words` separates them."""
    return [
        Argument("experiment", nargs="?", help=what, complete=lambda: (*experiment.names(), *study.names())),
        Argument("overrides", nargs="*", metavar="key:=value", help="changes to the experiment file"),
    ]


def _sort_words(given: argparse.Namespace) -> None:
    """Separate the experiment from the overrides: a word with := is an override. Raises ExperimentError."""
    words = [word for word in (given.experiment, *given.overrides) if word is not None]
    for word in words:
        key, sign, value = word.partition("=")
        if sign and not key.endswith(":") and not Path(word).exists():
            raise experiment.ExperimentError(f"{word!r} is no override; write {key}:={value}")
    given.overrides = [word for word in words if ":=" in word]
    overrides.once(tuple(given.overrides))
    names = [word for word in words if ":=" not in word]
    if len(names) != 1:
        valid = f"valid: {', '.join(experiment.names())}, or the path of a YAML file"
        raise experiment.ExperimentError(f"one experiment is needed; got {', '.join(names) or 'none'}; {valid}")
    given.experiment = names[0]


def _run_study(given: argparse.Namespace) -> int:
    definition = study.load(given.experiment)
    forms = definition.chosen(given.form)
    from hric_sweep.study import running as study_run

    result = study_run.run(
        definition,
        forms,
        given.overrides,
        seed=given.seed,
        root=given.runs,
        progress=not given.quiet,
        figures=not given.no_figures,
    )
    text.show(f"\n{result.metrics['report']}\nstudy: {result.folder}")
    if given.html:
        _study_pages(result.metrics, result.folder)
    if result.interrupted:
        print("interrupted; the runs that were made are kept", file=sys.stderr)
    return result.exit_code


def _study_pages(metrics: Mapping[str, Any], folder: Path) -> None:
    """Write one page per form of a study, with its runs overlaid on each other."""
    from hric_report import html as report_html

    for form, values in metrics["forms"].items():
        runs = {name: RunFolder(folder.parent / one["run"]) for name, one in values["runs"].items()}
        if len(runs) > 1:
            print(f"page: {report_html.write_comparison(list(runs.values()), list(runs), folder / form)}")


class ListCommand(Command):
    """List the experiments of the workspace."""

    def run(self, given: argparse.Namespace) -> None:
        """List experiments and studies with their duration and description."""
        names = experiment.names()
        width = max(map(len, names + study.names()), default=0)
        for name in names:
            definition = experiment.load(name)
            print(f"{name:<{width}}  {definition.duration:g} s  {definition.description}")
        for name in study.names():
            print(f"{name:<{width}}  study  {study.load(name).description}")


class ReportCommand(Command):
    """Compute metrics, figures and report of a run again, from its bag.

    Of a bag or a c3d file without a run folder: its verdict.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *run_arguments("a bag, or a c3d file with markers of a body", "RUN|BAG|C3D"),
            Argument(
                "--html",
                action="store_true",
                help="leave report.html, too: one file with plots, tables and a replay, for any browser; of a bag or a "
                "c3d file NAME_report.html beside it, with its verdict and a replay",
            ),
            Argument("--no-figures", action="store_true", help="do not draw the PNG files"),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Compute metrics and figures of a run again, or the verdict of a bag or c3d file."""
        path = Path(given.run).expanduser()
        if path.suffix.lower() in (".bag", ".c3d") and not path.is_dir():
            _report_recording(path, given.html)
        else:
            _report_run(RunFolder.open(given.run, given.runs), given)


def _report_run(folder: RunFolder, given: argparse.Namespace) -> None:
    from hric_report.html.verdict import summary, verdict_of
    from hric_report.run import FIGURE_STEPS, STEPS, analyse

    with contextlib.closing(Steps(STEPS + FIGURE_STEPS * (not given.no_figures))) as step:
        metrics = analyse(folder, figures=not given.no_figures, step=step)
    text.show(f"{metrics['report']}\nrun folder: {folder.path}")
    if (verdict := verdict_of(folder)) is not None:
        print(summary(verdict))
    if given.html:
        _html(folder)


def _report_recording(path: Path, html: bool) -> None:
    """Print the verdict of a bag or c3d file and, with html, write its page next to it."""
    from hric_assessment.verdict import opened
    from hric_report.html import recording_page
    from hric_report.html.verdict import summary, verdict_beside

    recording = opened(str(path))
    verdict = verdict_beside(recording)
    print(summary(verdict))
    if html:
        print(f"page: {recording_page.write(recording, verdict, path.with_name(f'{path.stem}_report.html'))}")


def _html(folder: RunFolder, *, progress: bool = True) -> None:
    from hric_report import html as report_html

    print(f"page: {report_html.write(folder, progress=progress and sys.stderr.isatty())}")


class CompareCommand(Command):
    """Compare two runs of the same motion, such as simulated and real.

    Gives peak and steady difference per joint, and figures.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument("run_a", help="run folder, its name, or latest", complete=run_names),
            Argument(
                "others",
                nargs="+",
                metavar="run_b",
                help="the other one; with --html also more, each compared with run_a",
                complete=run_names,
            ),
            Argument(
                "--labels",
                nargs="+",
                metavar="NAME",
                help="what to call them, e.g. simulated real (default: the names of their folders)",
            ),
            Argument("--joint", help="joint shown large, by its name in run A (default: the sixth)"),
            Argument(
                "--fit",
                action="store_true",
                help="lay the runs over each other by their positions, not by the setpoints' time",
            ),
            Argument("--output", metavar="DIR", help="where to write (default: A_vs_B in the folder of all runs)"),
            RUNS,
            Argument("--no-figures", action="store_true", help="do not draw"),
            Argument(
                "--html",
                action="store_true",
                help="leave report.html, too: one file with plots, tables and a replay of all runs",
            ),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Compare two runs of the same motion, or more of them on a page."""
        runs = [RunFolder.open(name, given.runs) for name in (given.run_a, *given.others)]
        names = given.labels or [run.path.name for run in runs]
        if len(names) != len(runs):
            raise experiment.ExperimentError(
                f"--labels names {len(names)} runs ({', '.join(names)}), but {len(runs)} are compared"
            )
        if len(set(given.labels or ())) < len(given.labels or ()):
            raise experiment.ExperimentError(f"--labels has {', '.join(names)}; valid: a different name for each run")
        if len(runs) > 2 and not given.html:
            raise experiment.ExperimentError(
                f"{len(runs)} runs are compared on a page only: add --html, or name two runs"
            )
        default = given.runs / "_vs_".join(run.path.name for run in runs)
        _compare(runs, names, Path(given.output).expanduser() if given.output else default, given)


def _compare(runs: Sequence[RunFolder], names: Sequence[str], folder: Path, given: argparse.Namespace) -> None:
    """Compare each run with the first one, and write the page if requested."""
    from hric_report.compare import compare as compare_runs

    for other, name in zip(runs[1:], names[1:], strict=True):
        pair = folder if len(runs) == 2 else folder / other.path.name
        options = {"joint": given.joint, "fit": given.fit, "figures": not given.no_figures}
        text.show(compare_runs(runs[0], other, pair, labels=(names[0], name), **options)["report"])
    print(f"comparison: {folder.absolute()}")
    if given.html:
        from hric_report import html as report_html

        page = report_html.write_comparison(runs, names, folder, fit=given.fit, progress=sys.stderr.isatty())
        print(f"page: {page.absolute()}")


class SchemaCommand(Command):
    """Print the JSON schema of experiment files, by which editors complete and check them."""

    epilog = (
        "An editor with a YAML language server finds it by the file's first line, for example\n"
        "  # yaml-language-server: $schema=experiment.schema.json"
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument("--study", action="store_true", help="of study files"),
            Argument("--sweep", action="store_true", help="of sweep files"),
            Argument("--example", action="store_true", help="print a small file instead, to begin with"),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Print the JSON schema of experiment, study or sweep files, or an example."""
        if given.study and given.sweep:
            raise experiment.ExperimentError("--study and --sweep are two schemas; valid: one of them")
        kind: type[Settings] = study.Study if given.study else experiment.Experiment
        example = study.EXAMPLE if given.study else experiment.EXAMPLE
        if given.sweep:
            from hric_sweep.definition import EXAMPLE, Sweep

            kind, example = Sweep, EXAMPLE
        print(example if given.example else json.dumps(json_schema(kind), indent=2) + "\n", end="")


class DescribeCommand(Command):
    """Print what an experiment puts on the parameter server; launch files read it."""

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument(
                "what", choices=["urdf", "human_urdf", *DESCRIBED, *_nodes()], help="descriptions; parameters (YAML)"
            ),
            *_experiment_arguments(
                f"one of: {', '.join(experiment.names())}; none: the bring-up without experiment; or a YAML file"
            ),
            Argument(
                "--also",
                action="append",
                default=[],
                metavar="KEY:=VALUE",
                help="print this parameter, too; may be repeated",
            ),
            Argument("--also-file", type=Path, metavar="FILE", help="print the parameters of this YAML file, too"),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Print the description or the parameters."""
        _sort_words(given)
        _log_to_terminal(quiet=False)
        definition = experiment.load(given.experiment, given.overrides)
        from hric_run.definition import parameters

        if given.what == "urdf":
            print(parameters.description(definition.robot))
        elif given.what == "human_urdf":
            print(parameters.human_description(definition))
        else:
            if given.what in DESCRIBED:
                values = getattr(parameters, DESCRIBED[given.what])(definition)
            else:
                values = parameters.beside(definition).get(given.what, {})
            print(yaml.safe_dump({**values, **_also(given.also_file, given.also)}, sort_keys=False), end="")


def _nodes() -> list[str]:
    """Return the nodes whose private parameters `describe` prints."""
    sensors: list[Any] = [plugins.find(plugins.SENSOR, name) for name in plugins.names(plugins.SENSOR)]
    return [*NODES, *(name for sensor in sensors for name in (sensor.name, sensor.emulated_name))]


def _also(path: Path | None, given: Sequence[str]) -> dict[str, object]:
    """Return the parameters of a YAML file, overridden by those of the command line."""
    content: object = {} if path is None else read_yaml(path)
    if not isinstance(content, dict):
        raise experiment.ExperimentError(f"{path} must be a mapping of parameters to values")
    return content | dict(map(overrides.split, given))


def _log_to_terminal(quiet: bool) -> None:
    logger = logging.getLogger("hric")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("[%(levelname)s] %(message)s"))
    logger.handlers = [handler]
    logger.propagate = False
    logger.setLevel(logging.ERROR if quiet else logging.INFO)
