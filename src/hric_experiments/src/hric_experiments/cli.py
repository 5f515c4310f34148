"""Commands `run` and `list`, and functions shared with other commands on experiments."""

import argparse
import logging
import sys
from pathlib import Path

from hric_assessment.typed_json import Content
from hric_bags import text
from hric_bags.arguments import RUNS
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command
from hric_core.parameters import whole
from hric_core.processes import INTERRUPTED_CODE
from hric_run.definition import experiment, overrides
from hric_sweep.study import definition as study


class RunCommand(Command):
    """Run an experiment or study without a ROS master, as fast as possible, and store the results in a run folder."""

    epilog = (
        "overrides (any other key of the experiment file can be set by its dotted path, e.g. "
        f"robot.plant.friction:=identified):\n{overrides.help_text()}"
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            *experiment_arguments(
                f"one of: {', '.join(experiment.names())}; a study: {', '.join(study.names())}; or the path of a "
                "YAML file"
            ),
            Argument(
                "--form",
                action="append",
                default=[],
                metavar="NAME",
                help="run only this form (experiment) of a study; may be repeated",
            ),
            Argument("--seed", type=int, default=0, help="seed of all random numbers (default: 0)"),
            RUNS,
            Argument(
                "--quiet", action="store_true", help="no progress bar and no report, only errors and the run folder"
            ),
            Argument("--no-figures", action="store_true", help="draw no figures"),
            Argument(
                "--refine",
                action="store_true",
                help="also run a twin with half the time step; its differences give the verdict error bars of peak "
                "forces and smallest distances",
            ),
            Argument(
                "--html",
                action="store_true",
                help="also write report.html: one file with plots, tables and a 3D replay",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Run the experiment or study in this process, and print its report."""
        sort_words(arguments)
        whole(minimum=0).checked(arguments.seed, "--seed")
        log_to_terminal(arguments.quiet)
        if study.is_study(arguments.experiment):
            if arguments.refine:
                raise experiment.ExperimentError(
                    f"--refine is for one experiment, and {arguments.experiment} is a study; valid: "
                    f"{', '.join(experiment.names())}, or the path of a YAML file"
                )
            return _run_study(arguments)
        if arguments.form:
            raise experiment.ExperimentError(
                f"{arguments.experiment} is not a study, so it has no form {arguments.form[0]}; studies: "
                f"{', '.join(study.names())}"
            )
        return _run_experiment(arguments)


def _run_experiment(arguments: argparse.Namespace) -> int:
    definition = experiment.load(arguments.experiment, arguments.overrides)
    from hric_report import headless  # slow to import: errors are reported before

    if not arguments.quiet and definition.human is not None:
        # Imported only for runs with a person: it is slow to import.
        from hric_assessment.verdict.conclusions import unknown_beforehand

        if lacking := unknown_beforehand(definition.human):
            print(lacking, file=sys.stderr)
    twin = None
    if arguments.refine:  # first: the run itself is then the latest
        from hric_experiments import refine  # imported only here: it is slow to import

        twin = refine.run_twin(definition, arguments)
    result = headless.run(
        definition,
        arguments.overrides,
        seed=arguments.seed,
        root=arguments.runs,
        progress=not arguments.quiet,
        figures=not arguments.no_figures,
    )
    if twin is not None and not result.interrupted:
        refine.add_errors(result.folder, *twin)
    if not arguments.quiet:
        text.show(f"\n{result.metrics['report']}")
    else:
        print(
            "".join(f"unstable: {reason}\n" for reason in result.metrics["stability"]["reasons"]),
            end="",
            file=sys.stderr,
        )
    print(f"state_sha256: {result.metrics['state_sha256']}\nrun folder: {result.folder.path}")
    if arguments.html:
        write_page(result.folder, progress=not arguments.quiet)
    if result.interrupted:
        print("interrupted; the bag contains all messages up to now", file=sys.stderr)
        return INTERRUPTED_CODE
    return 0


def experiment_arguments(what: str) -> list[Argument]:
    """Return the arguments for experiment and overrides, which are allowed in any order (see `sort_words`)."""
    return [
        Argument("experiment", nargs="?", help=what, complete=lambda: (*experiment.names(), *study.names())),
        Argument("overrides", nargs="*", metavar="key:=value", help="override of a key of the experiment file"),
    ]


def sort_words(arguments: argparse.Namespace) -> None:
    """Separate the experiment from the overrides: words with := are overrides. Raises ExperimentError."""
    words = [word for word in (arguments.experiment, *arguments.overrides) if word is not None]
    for word in words:
        key, sign, value = word.partition("=")
        if sign and not key.endswith(":") and not Path(word).exists():
            raise experiment.ExperimentError(f"{word!r} is not a valid override; valid: {key}:={value}")
    arguments.overrides = [word for word in words if ":=" in word]
    overrides.once(tuple(arguments.overrides))
    names = [word for word in words if ":=" not in word]
    if len(names) != 1:
        valid = f"valid: {', '.join(experiment.names())}, or the path of a YAML file"
        raise experiment.ExperimentError(
            f"exactly one experiment is needed; given: {', '.join(names) or 'none'}; {valid}"
        )
    arguments.experiment = names[0]


def _run_study(arguments: argparse.Namespace) -> int:
    definition = study.load(arguments.experiment)
    forms = definition.chosen(arguments.form)
    from hric_sweep.study import running as study_run

    result = study_run.run(
        definition,
        forms,
        arguments.overrides,
        seed=arguments.seed,
        root=arguments.runs,
        progress=not arguments.quiet,
        figures=not arguments.no_figures,
    )
    text.show(f"\n{result.metrics['report']}\nstudy: {result.folder}")
    if arguments.html:
        _study_pages(result.metrics, result.folder)
    if result.interrupted:
        print("interrupted; the finished runs are stored", file=sys.stderr)
    return result.exit_code


def _study_pages(metrics: Content, folder: Path) -> None:
    """Write one comparison page for each form (experiment) of a study."""
    from hric_report import html as report_html

    for form, values in metrics["forms"].items():
        runs = {name: RunFolder(folder.parent / run["run"]) for name, run in values["runs"].items()}
        if len(runs) > 1:
            print(f"page: {report_html.write_comparison(list(runs.values()), list(runs), folder / form)}")


class ListCommand(Command):
    """List the experiments and studies of the workspace."""

    def run(self, arguments: argparse.Namespace) -> None:
        """Print each experiment and study with duration and description."""
        names = experiment.names()
        width = max(map(len, names + study.names()), default=0)
        for name in names:
            definition = experiment.load(name)
            print(f"{name:<{width}}  {definition.duration:g} s  {definition.description}")
        for name in study.names():
            print(f"{name:<{width}}  study  {study.load(name).description}")


def write_page(folder: RunFolder, *, progress: bool = True) -> None:
    """Write the HTML page of a run and print its path."""
    from hric_report import html as report_html

    print(f"page: {report_html.write(folder, progress=progress and sys.stderr.isatty())}")


def log_to_terminal(quiet: bool) -> None:
    """Show log messages of this process on the terminal, from level INFO on; `quiet`: only errors."""
    logger = logging.getLogger("hric")
    handler = logging.StreamHandler()
    handler.setFormatter(logging.Formatter("[%(levelname)s] %(message)s"))
    logger.handlers = [handler]
    logger.propagate = False
    logger.setLevel(logging.ERROR if quiet else logging.INFO)
