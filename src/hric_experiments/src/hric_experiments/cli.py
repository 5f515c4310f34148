"""Command line of the package: run, list, report, compare, describe, schema, and the commands of other packages."""

import argparse
import contextlib
import importlib
import json
import logging
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from hric_bags import text
from hric_bags.run_folder import RunFolder, runs_root
from hric_bags.text import Steps
from hric_core import plugins
from hric_core.parameters import Settings, json_schema, read_yaml, whole
from hric_core.processes import INTERRUPTED_CODE, run_command
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


def run(arguments: Sequence[str]) -> int:
    """Run an experiment headless."""
    given = _in_any_order(_run_parser(), arguments)
    whole(minimum=0).checked(given.seed, "--seed")
    _log_to_terminal(given.quiet)
    if study.is_study(given.experiment):
        return _run_study(given)
    if given.form:
        raise experiment.ExperimentError(
            f"{given.experiment} is no study, so it has no form {given.form[0]}; studies: {', '.join(study.names())}"
        )
    definition = experiment.load(given.experiment, given.overrides)
    from hric_assessment.verdict.conclusions import unknown_beforehand
    from hric_report import headless  # slow to import: errors are reported before

    if not given.quiet and (lacking := unknown_beforehand(definition.human)):
        print(lacking, file=sys.stderr)
    result = headless.run(
        definition,
        given.overrides,
        seed=given.seed,
        root=runs_root(given.runs),
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


def _run_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments run",
        description="Run an experiment without a ROS master, as fast as the machine allows, and leave a run folder.",
        epilog="overrides (or the dotted path of any key of the experiment file, e.g. "
        "robot.plant.friction:=identified):\n" + overrides.help_text(),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "experiment",
        nargs="?",
        help=f"one of: {', '.join(experiment.names())}; a study: {', '.join(study.names())}; or the path of a "
        "YAML file",
    )
    parser.add_argument("overrides", nargs="*", metavar="key:=value", help="changes to the experiment file")
    parser.add_argument(
        "--form", action="append", default=[], metavar="NAME", help="of a study: only this form, may be repeated"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of everything random (0)")
    parser.add_argument(
        "--runs", metavar="DIR", help="folder of all runs (default: $HRIC_RUNS, else runs/ of the workspace)"
    )
    parser.add_argument(
        "--quiet", action="store_true", help="no progress bar and no report, only errors and the run folder"
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw")
    parser.add_argument(
        "--html", action="store_true", help="leave report.html, too: one file with plots, tables and a replay"
    )
    return parser


def _in_any_order(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> argparse.Namespace:
    """Parse options, `experiment` and `overrides` in any order: a word with := is an override."""
    given = parser.parse_intermixed_args(list(arguments))
    words = [word for word in (given.experiment, *given.overrides) if word is not None]
    for word in words:
        key, sign, value = word.partition("=")
        if sign and not key.endswith(":") and not Path(word).exists():
            parser.error(f"{word!r} is no override; write {key}:={value}")
    given.overrides = [word for word in words if ":=" in word]
    overrides.once(tuple(given.overrides))
    names = [word for word in words if ":=" not in word]
    if len(names) != 1:
        valid = f"valid: {', '.join(experiment.names())}, or the path of a YAML file"
        parser.error(f"one experiment is needed; got {', '.join(names) or 'none'}; {valid}")
    given.experiment = names[0]
    return given


def _run_study(given: argparse.Namespace) -> int:
    definition = study.load(given.experiment)
    forms = definition.chosen(given.form)
    from hric_sweep.study import running as study_run

    result = study_run.run(
        definition,
        forms,
        given.overrides,
        seed=given.seed,
        root=runs_root(given.runs),
        progress=not given.quiet,
        figures=not given.no_figures,
    )
    text.show(f"\n{result.metrics['report']}\nstudy: {result.folder}")
    if given.html:
        _study_pages(result.metrics, result.folder)
    if result.interrupted:
        print("interrupted; the runs that were made are kept", file=sys.stderr)
        return INTERRUPTED_CODE
    return 0 if result.passed else 1


def _study_pages(metrics: Mapping[str, Any], folder: Path) -> None:
    """Write one page per form of a study, with its runs overlaid on each other."""
    from hric_report import html as report_html

    for form, values in metrics["forms"].items():
        runs = {name: RunFolder(folder.parent / one["run"]) for name, one in values["runs"].items()}
        if len(runs) > 1:
            print(f"page: {report_html.write_comparison(list(runs.values()), list(runs), folder / form)}")


def list_experiments(arguments: Sequence[str]) -> int:
    """List experiments and studies with their duration and description."""
    argparse.ArgumentParser(
        "rosrun hric_experiments list", description="List the experiments of the workspace."
    ).parse_args(list(arguments))
    names = experiment.names()
    width = max(map(len, names + study.names()), default=0)
    for name in names:
        definition = experiment.load(name)
        print(f"{name:<{width}}  {definition.duration:g} s  {definition.description}")
    for name in study.names():
        print(f"{name:<{width}}  study  {study.load(name).description}")
    return 0


def report(arguments: Sequence[str]) -> int:
    """Compute metrics and figures of a run again, or the verdict of a bag or c3d file."""
    what = (
        "Compute metrics, figures and report of a run again, from its bag. Of a bag or a c3d file without a run "
        "folder: its verdict."
    )
    parser = argparse.ArgumentParser("rosrun hric_experiments report", description=what)
    parser.add_argument(
        "run",
        nargs="?",
        default="latest",
        metavar="RUN|BAG|C3D",
        help="run folder, its name, latest (default), a bag, or a c3d file with markers of a body",
    )
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    parser.add_argument(
        "--html",
        action="store_true",
        help="leave report.html, too: one file with plots, tables and a replay, for any browser; of a bag or a c3d "
        "file NAME_report.html beside it, with its verdict and a replay",
    )
    parser.add_argument("--no-figures", action="store_true", help="do not draw the PNG files")
    given = parser.parse_args(list(arguments))
    if Path(given.run).suffix.lower() in (".bag", ".c3d") and not Path(given.run).expanduser().is_dir():
        return _report_recording(Path(given.run).expanduser(), given.html)
    from hric_report.run import FIGURE_STEPS, STEPS, analyse

    folder = RunFolder.open(given.run, runs_root(given.runs))
    with contextlib.closing(Steps(STEPS + FIGURE_STEPS * (not given.no_figures))) as step:
        found = analyse(folder, figures=not given.no_figures, step=step)
    text.show(f"{found['report']}\nrun folder: {folder.path}")
    from hric_report.html.verdict import summary, verdict_of

    if (verdict := verdict_of(folder)) is not None:
        print(summary(verdict))
    if given.html:
        _html(folder)
    return 0


def _report_recording(path: Path, html: bool) -> int:
    """Print the verdict of a bag or c3d file and, with html, write its page next to it."""
    from hric_assessment.verdict import opened
    from hric_report.html import recording_page
    from hric_report.html.verdict import summary, verdict_beside

    given = opened(str(path))
    verdict = verdict_beside(given)
    print(summary(verdict))
    if html:
        print(f"page: {recording_page.write(given, verdict, path.with_name(f'{path.stem}_report.html'))}")
    return 0


def _html(folder: RunFolder, *, progress: bool = True) -> None:
    from hric_report import html as report_html

    print(f"page: {report_html.write(folder, progress=progress and sys.stderr.isatty())}")


def compare(arguments: Sequence[str]) -> int:
    """Compare two runs of the same motion, or more of them on a page."""
    given = _compare_parser().parse_args(list(arguments))
    root = runs_root(given.runs)
    runs = [RunFolder.open(name, root) for name in (given.run_a, *given.others)]
    names = given.labels or [run.path.name for run in runs]
    if len(names) != len(runs):
        raise experiment.ExperimentError(
            f"--labels names {len(names)} runs ({', '.join(names)}), but {len(runs)} are compared"
        )
    if len(set(given.labels or ())) < len(given.labels or ()):
        raise experiment.ExperimentError(f"--labels has {', '.join(names)}; valid: a different name for each run")
    if len(runs) > 2 and not given.html:
        raise experiment.ExperimentError(f"{len(runs)} runs are compared on a page only: add --html, or name two runs")
    folder = Path(given.output).expanduser() if given.output else root / "_vs_".join(run.path.name for run in runs)
    _compare(runs, names, folder, given)
    return 0


def _compare_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments compare",
        description="Compare two runs of the same motion, such as simulated and real: peak and steady difference per "
        "joint, and figures.",
    )
    parser.add_argument("run_a", help="run folder, its name, or latest")
    parser.add_argument(
        "others", nargs="+", metavar="run_b", help="the other one; with --html also more, each compared with run_a"
    )
    parser.add_argument(
        "--labels",
        nargs="+",
        metavar="NAME",
        help="what to call them, e.g. simulated real (default: the names of their folders)",
    )
    parser.add_argument("--joint", help="joint shown large, by its name in run A (default: the sixth)")
    parser.add_argument(
        "--fit",
        action="store_true",
        help="lay the runs over each other by their positions, not by the setpoints' time",
    )
    parser.add_argument("--output", metavar="DIR", help="where to write (default: A_vs_B in the folder of all runs)")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    parser.add_argument("--no-figures", action="store_true", help="do not draw")
    parser.add_argument(
        "--html",
        action="store_true",
        help="leave report.html, too: one file with plots, tables and a replay of all runs",
    )
    return parser


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


def schema(arguments: Sequence[str]) -> int:
    """Print the JSON schema of experiment, study or sweep files, or an example."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments schema",
        description="Print the JSON schema of experiment files, by which editors complete and check them.",
        epilog="An editor with a YAML language server finds it by the file's first line, for example\n"
        "  # yaml-language-server: $schema=experiment.schema.json",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--study", action="store_true", help="of study files")
    which.add_argument("--sweep", action="store_true", help="of sweep files")
    parser.add_argument("--example", action="store_true", help="print a small file instead, to begin with")
    given = parser.parse_args(list(arguments))
    kind: type[Settings] = study.Study if given.study else experiment.Experiment
    example = study.EXAMPLE if given.study else experiment.EXAMPLE
    if given.sweep:
        from hric_sweep.definition import EXAMPLE, Sweep

        kind, example = Sweep, EXAMPLE
    print(example if given.example else json.dumps(json_schema(kind), indent=2) + "\n", end="")
    return 0


def describe(arguments: Sequence[str]) -> int:
    """Print descriptions or parameters of an experiment for the parameter server; launch files read the output."""
    sensors: list[Any] = [plugins.find(plugins.SENSOR, name) for name in plugins.names(plugins.SENSOR)]
    nodes = [*NODES, *(name for sensor in sensors for name in (sensor.name, sensor.emulated_name))]
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments describe", description="Print what an experiment puts on the parameter server."
    )
    parser.add_argument(
        "what", choices=["urdf", "human_urdf", *DESCRIBED, *nodes], help="descriptions; parameters (YAML)"
    )
    parser.add_argument(
        "experiment",
        nargs="?",
        help=f"one of: {', '.join(experiment.names())}; none: the bring-up without experiment; or a YAML file",
    )
    parser.add_argument("overrides", nargs="*", metavar="key:=value", help="changes, as for run")
    parser.add_argument(
        "--also", action="append", default=[], metavar="KEY:=VALUE", help="print this parameter, too; may be repeated"
    )
    parser.add_argument("--also-file", type=Path, metavar="FILE", help="print the parameters of this YAML file, too")
    given = _in_any_order(parser, arguments)
    _log_to_terminal(quiet=False)
    definition = experiment.load(given.experiment, given.overrides)
    from hric_run.definition import parameters

    if given.what in ("urdf", "human_urdf"):
        own = given.what == "urdf"
        print(parameters.description(definition.robot) if own else parameters.human_description(definition))
        return 0
    if given.what in nodes:
        printed = parameters.beside(definition).get(given.what, {})
    else:
        printed = getattr(parameters, DESCRIBED[given.what])(definition)
    print(yaml.safe_dump({**printed, **_also(given.also_file, given.also)}, sort_keys=False), end="")
    return 0


def _also(path: Path | None, given: Sequence[str]) -> dict[str, object]:
    """Return the parameters of a YAML file, overridden by those of the command line."""
    content: object = {} if path is None else read_yaml(path)
    if not isinstance(content, dict):
        raise experiment.ExperimentError(f"{path} must be a mapping of parameters to values")
    return content | dict(map(overrides.split, given))


def _of(module: str, name: str = "main") -> Callable[[Sequence[str]], int]:
    """Return a command that imports a module only when it runs, and calls its function `name`."""
    return lambda arguments: int(getattr(importlib.import_module(module), name)(arguments))


COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    "run": run,
    "list": list_experiments,
    "report": report,
    "compare": compare,
    "describe": describe,
    "schema": schema,
    "health": _of("hric_bags.health.command"),
    "export": _of("hric_bags.export.command"),
    "inverse_kinematics": _of("hric_bags.export.command", "inverse_kinematics"),
    "inverse_dynamics": _of("hric_bags.export.command", "inverse_dynamics"),
    "muscle_load": _of("hric_report.muscle_load"),
    "measure_stops": _of("hric_sweep.stops.command"),
    "speed_map": _of("hric_sweep.speed_map.command"),
    "check_model": _of("hric_experiments.check_model.command"),
    "approaches": _of("hric_sweep.approaches.command"),
    "benchmark": _of("hric_sweep.benchmark.command"),
    "sweep": _of("hric_sweep.command"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command that the first argument names and return its exit code; a user error is one line, no traceback.

    Args:
        arguments: command and its arguments; None: those of the process, with the program name as the command.
    """
    name, *others = arguments or [Path(sys.argv[0]).name, *sys.argv[1:]]
    return run_command(name, lambda: COMMANDS[name](others))


def _log_to_terminal(quiet: bool) -> None:
    logger = logging.getLogger("hric")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("[%(levelname)s] %(message)s"))
    logger.handlers = [handler]
    logger.propagate = False
    logger.setLevel(logging.ERROR if quiet else logging.INFO)
