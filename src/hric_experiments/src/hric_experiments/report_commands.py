"""Commands `report` (rewrite the report of a run) and `compare` (compare runs)."""

import argparse
import contextlib
import sys
from collections.abc import Sequence
from pathlib import Path

from hric_bags import foreign, text
from hric_bags.arguments import RUNS, run_arguments, run_names
from hric_bags.run_folder import RunFolder
from hric_bags.text import Steps
from hric_core.command import Argument, Command
from hric_experiments.cli import write_page
from hric_run.definition.experiment import ExperimentError


class ReportCommand(Command):
    """Compute metrics, figures and report of a run again, from its bag.

    For a bag or a trial without run folder, print the verdict on safety and ergonomics.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            *run_arguments("a bag, or a trial with markers of people (see hric trial)", "RUN|BAG|TRIAL"),
            Argument(
                "--html",
                action="store_true",
                help="also write report.html: one file with plots, tables and a 3D replay, for any browser; for a bag "
                "or trial: NAME_report.html next to it, with verdict and replay",
            ),
            Argument("--no-figures", action="store_true", help="draw no figures"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Rewrite metrics, figures and report of a run, or print the verdict on a bag or trial."""
        from hric_motion.formats import FORMATS
        from hric_motion.handovers import is_handover

        path = Path(arguments.run).expanduser()
        file = path.suffix.lower() in (".bag", *FORMATS) and not path.is_dir()
        if file or foreign.is_ros2(path) or is_handover(path):
            _report_recording(path, arguments.html)
        else:
            _report_run(RunFolder.open(arguments.run, arguments.runs), arguments)


def _report_run(folder: RunFolder, arguments: argparse.Namespace) -> None:
    from hric_report.html.verdict import summary, verdict_of
    from hric_report.run import FIGURE_STEPS, STEPS, analyse

    with contextlib.closing(Steps(STEPS + FIGURE_STEPS * (not arguments.no_figures))) as step:
        metrics = analyse(folder, figures=not arguments.no_figures, step=step)
    text.show(f"{metrics['report']}\nrun folder: {folder.path}")
    if (verdict := verdict_of(folder)) is not None:
        print(summary(verdict))
    if arguments.html:
        write_page(folder)


def _report_recording(path: Path, html: bool) -> None:
    """Print the verdict on a bag or trial; `html`: also write its page next to the file."""
    from hric_assessment.verdict import opened
    from hric_report.html import recording_page
    from hric_report.html.verdict import summary, verdict_of_recording

    recording = opened(str(path))
    verdict = verdict_of_recording(recording, path)
    print(summary(verdict))
    if html:
        print(f"page: {recording_page.write(recording, verdict, path.with_name(f'{path.stem}_report.html'))}")


class CompareCommand(Command):
    """Compare two runs of the same motion, such as simulated and real.

    Prints peak and steady-state difference per joint, and draws figures.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument("run_a", help="run folder, its name, or latest", complete=run_names),
            Argument(
                "others",
                nargs="+",
                metavar="run_b",
                help="the other run; with --html also several, each compared with run_a",
                complete=run_names,
            ),
            Argument(
                "--labels",
                nargs="+",
                metavar="NAME",
                help="labels of the runs, e.g. simulated real (default: the names of their folders)",
            ),
            Argument("--joint", help="joint for the large figure, by its name in run A (default: the sixth)"),
            Argument(
                "--fit",
                action="store_true",
                help="align the runs by their joint positions instead of the times of the setpoints",
            ),
            Argument("--output", metavar="DIR", help="output folder (default: A_vs_B in the folder of all runs)"),
            RUNS,
            Argument("--no-figures", action="store_true", help="draw no figures"),
            Argument(
                "--html",
                action="store_true",
                help="also write report.html: one file with plots, tables and a 3D replay of all runs",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Compare two runs; with --html also more than two."""
        runs = [RunFolder.open(name, arguments.runs) for name in (arguments.run_a, *arguments.others)]
        names = arguments.labels or [run.path.name for run in runs]
        if len(names) != len(runs):
            raise ExperimentError(f"--labels needs {len(runs)} names, one for each run; given: {', '.join(names)}")
        if len(set(arguments.labels or ())) < len(arguments.labels or ()):
            raise ExperimentError(f"--labels has equal names: {', '.join(names)}; valid: a different name for each run")
        if len(runs) > 2 and not arguments.html:
            raise ExperimentError(f"{len(runs)} runs can only be compared on a page; valid: with --html, or two runs")
        default = arguments.runs / "_vs_".join(run.path.name for run in runs)
        _compare(runs, names, Path(arguments.output).expanduser() if arguments.output else default, arguments)


def _compare(runs: Sequence[RunFolder], names: Sequence[str], folder: Path, arguments: argparse.Namespace) -> None:
    """Compare each run with the first one, print the texts, and write the page if requested."""
    from hric_report.compare import compare as compare_runs

    for other, name in zip(runs[1:], names[1:], strict=True):
        pair = folder if len(runs) == 2 else folder / other.path.name
        options = {"joint": arguments.joint, "fit": arguments.fit, "figures": not arguments.no_figures}
        text.show(compare_runs(runs[0], other, pair, labels=(names[0], name), **options)["report"])
    print(f"comparison: {folder.absolute()}")
    if arguments.html:
        from hric_report import html as report_html

        page = report_html.write_comparison(runs, names, folder, fit=arguments.fit, progress=sys.stderr.isatty())
        print(f"page: {page.absolute()}")
