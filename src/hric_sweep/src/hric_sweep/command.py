"""Command `sweep`: run or resume a sweep."""

import argparse
import math
import shlex
import statistics
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path

from tqdm import tqdm

from hric_core.command import Argument, Command, perform
from hric_core.errors import NOT_GOOD, HricError
from hric_sweep import definition, table
from hric_sweep.definition import SweepPlan
from hric_sweep.engines.engine import SweepEngine, same
from hric_sweep.engines.make import engine_arguments, engine_session, resume_command
from hric_sweep.folder import create, opened
from hric_sweep.journal import Journal
from hric_sweep.records import ReferenceRun
from hric_sweep.supervisor import SweepSupervisor


class SweepCommand(Command):
    """Run an experiment many times with varied parameters and seeds, on all processors; write one table.

    See also: sweep rerun, sweep page.
    """

    epilog = (
        "exit codes: 0 all runs finished; 2 user error, nothing was started; 3 runs failed, or the sweep could not "
        "continue (finished runs are stored); 130 Ctrl-C (resume with --resume DIR)"
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            Argument(
                "sweep",
                nargs="?",
                help=f"one of: {', '.join(definition.names())}; or the path of a YAML file",
                complete=definition.names,
            ),
            Argument("--quick", action="store_true", help="run the sweep's short form, with few runs"),
            *engine_arguments("sweep, benchmark or study"),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Run a new sweep, or resume a sweep, a benchmark or a study."""
        if (arguments.sweep is None) == (arguments.resume is None):
            names = ", ".join(definition.names())
            raise HricError(f"one sweep is needed; valid: {names}, a YAML file, or --resume DIR")
        if arguments.resume is None:
            return _run(None, definition.load(arguments.sweep, quick=arguments.quick), None, arguments)
        resumed = Path(arguments.resume).expanduser()
        if (resumed / "benchmark.yaml").is_file():
            return perform(["benchmark", *shlex.split(arguments.command)[2:]])
        if (resumed / "study.yaml").is_file():
            return _resume_study(resumed, arguments)
        folder = table.find(arguments.resume)
        return _run(folder, *opened(folder), arguments)


def _resume_study(folder: Path, arguments: argparse.Namespace) -> int:
    """Resume a study. Raises HricError: --jobs or --dask was given; the runs of a study are not parallel."""
    if arguments.jobs is not None or arguments.dask is not None:
        raise HricError(
            f"{folder} is a study, which executes one run after the other; valid: without --jobs and --dask"
        )
    from hric_sweep.study import running  # slow to import: errors are reported before

    return running.resume(folder, progress=not arguments.quiet)


def _run(folder: Path | None, plan: SweepPlan, before: ReferenceRun | None, options: argparse.Namespace) -> int:
    """Run a new sweep (`folder` is None), or resume the one in `folder`, whose reference run was `before`."""
    memory, total, started = 1e9 * plan.section.memory, plan.sampler().total, None
    with engine_session(options, memory, total, lambda: resume_command(started)) as engine:
        reference = engine.check(plan.task(0, {}, ""))
        if before is not None:
            same([("this machine and code", reference)], before)
        if folder is None:
            _probe(plan, engine, reference.code)
            folder = create(plan, reference, options.runs)
        started = folder
        print(f"sweep: {folder}", flush=True)
        with Journal(folder) as journal:
            supervisor = _supervise(folder, plan, journal, engine, reference.code, options.quiet)
    print(summary(folder))
    return NOT_GOOD if any(row.failure for row in supervisor.rows.values()) else 0


def _probe(plan: SweepPlan, engine: SweepEngine, code: str) -> None:
    """Check that each variable has an effect. Raises HricError if one has none, or if its values are refused."""
    from hric_sweep import probe

    print(
        f"checking that each variable has an effect, at both ends of its range: {probe.runs_of(plan)} runs", flush=True
    )
    for warning in probe.probe(plan, engine, code):
        print(f"warning: {warning}", file=sys.stderr)


def _supervise(
    folder: Path, plan: SweepPlan, journal: Journal, engine: SweepEngine, code: str, quiet: bool
) -> SweepSupervisor:
    from hric_sweep.page import build as page

    def show(folder: Path) -> None:
        if supervisor.rows:
            page.write(folder, running=True)

    with closing(tqdm(total=plan.sampler().total, unit=" runs", disable=quiet or None)) as bar:
        supervisor = SweepSupervisor(plan, folder, journal, engine, code, lambda _: bar.update(), show)
        try:
            supervisor.run()
        finally:
            if supervisor.rows:
                print(f"\npage: {page.write(folder)}")
    return supervisor


def summary(folder: Path) -> str:
    """Return the summary of a sweep for the terminal: failed runs, range and median of each output, exceedance.

    It makes the same statements as the beginning of the sweep's page.
    """
    from hric_sweep.page import estimate
    from hric_sweep.page.study import FAILED, load

    study = load(folder)
    failed = study.kinds == FAILED
    lines = [f"{study.runs} runs, {int(failed.sum())} failed"]
    for name in study.outputs:
        values = sorted(value for value in study.columns[name][~failed].tolist() if not math.isnan(value))
        if values:
            middle, unit = statistics.median(values), study.about[name].unit
            lines.append(f"{name}: {values[0]:.6g} to {values[-1]:.6g}, median {middle:.6g} {unit}".rstrip())
    if study.limit is not None:
        lines += filter(None, estimate.lines(study, "given the distributions of the sweep"))
    reasons = Counter(study.columns["failure"][failed].tolist())
    lines += [f"failed {count} times: {reason}" for reason, count in reasons.most_common(5)]
    return "\n".join(lines)
