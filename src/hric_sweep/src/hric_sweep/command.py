"""Commands `sweep`, `sweep rerun` and `sweep page`."""

import argparse
import math
import signal
import statistics
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from tqdm import tqdm

from hric_bags import files
from hric_bags.arguments import RUNS
from hric_bags.run_folder import RunFolder, iso_now
from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError
from hric_core.parameters import read_yaml
from hric_core.processes import INTERRUPTED_CODE
from hric_run import provenance
from hric_sweep import definition, table, task
from hric_sweep.definition import Plan
from hric_sweep.engines.engine import Engine, Response, going_on_with, same
from hric_sweep.engines.make import engine_arguments, engine_of
from hric_sweep.journal import Journal
from hric_sweep.supervisor import Supervisor, make_task

FILE = "sweep.yaml"
FOLDER = Argument("sweep", help="folder of the sweep, or its name in the folder of all runs")


class SweepCommand(Command):
    """Run an experiment many times with variables and seeds, on all processors, into one table. See also: sweep rerun,
    sweep page."""

    epilog = (
        "exit codes: 0 all runs ended; 2 a mistake, and nothing was begun; 3 runs failed, or it could not go on "
        "(what ended is kept); 130 Ctrl-C (go on with --resume DIR)"
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument(
                "sweep",
                nargs="?",
                help=f"one of: {', '.join(definition.names())}; or the path of a YAML file",
                complete=definition.names,
            ),
            *engine_arguments("sweep"),
            Argument("--quick", action="store_true", help="the sweep's form with few runs"),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Run a new sweep, or go on with one."""
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        if (given.sweep is None) == (given.resume is None):
            names = ", ".join(definition.names())
            raise HricError(f"one sweep is needed; valid: {names}, a YAML file, or --resume DIR")
        if given.resume is not None:
            folder = table.find(given.resume)
            return _run(folder, *_opened(folder), given)
        return _run(None, definition.load(given.sweep, quick=given.quick), None, given)


def _opened(folder: Path) -> tuple[Plan, Response]:
    """A sweep that was begun, and its reference run. Raises HricError: it cannot go on with this code."""
    content = read_yaml(folder / FILE)
    plan = definition.plan(content["name"], content["definition"], base=content["experiment"])
    return plan, {"code": content["code"], **content["reference"]}


def _run(folder: Path | None, plan: Plan, before: Response | None, given: argparse.Namespace) -> int:
    """Run a new sweep, or go on; folder and before: of the one that was begun, and its reference run."""
    engine = engine_of(given, 1e9 * plan.section.memory, plan.sampler().total)
    now = True
    try:
        own = engine.check(make_task(plan, 0, {}, ""))
        if before is not None:
            same([("what would run it now", own)], before)
        if folder is None:
            _probed(plan, engine, own["code"])
            folder = _begin(plan, own, given)
        print(f"sweep: {folder}", flush=True)
        with Journal(folder) as journal, going_on_with(_command(folder)):
            supervisor = _supervised(folder, plan, journal, engine, own["code"], given.quiet)
        now = False
    except KeyboardInterrupt:
        going_on = "nothing was begun" if folder is None else f"go on: {_command(folder)}"
        print(f"\ninterrupted; {going_on}", file=sys.stderr)
        return INTERRUPTED_CODE
    finally:
        engine.close(now=now)
    print(summary(folder))
    return NOT_GOOD if any(row["failure"] for row in supervisor.rows.values()) else 0


def _probed(plan: Plan, engine: Engine, code: str) -> None:
    """Try the variables; raises HricError: one has no effect, or values that cannot be."""
    from hric_sweep import probe

    print(f"trying each variable at both ends: {probe.runs_of(plan)} runs", flush=True)
    for warning in probe.probe(plan, engine, code):
        print(f"warning: {warning}", file=sys.stderr)


def _command(folder: Path) -> str:
    return f"hric sweep --resume {folder}"


def _begin(plan: Plan, own: Response, given: argparse.Namespace) -> Path:
    """A new folder with sweep.yaml."""
    folder = RunFolder.create(given.runs, plan.name).path
    files.write_yaml(
        folder / FILE,
        {
            "name": plan.name,
            "started": iso_now(),
            "definition": plan.content,
            "experiment": plan.experiment,
            "code": own["code"],
            "revision": provenance.revision(),
            "reference": {"state_sha256": own["state_sha256"]},
            "versions": provenance.versions(),
            "platform": provenance.platform_info(),
        },
    )
    return folder


def _supervised(folder: Path, plan: Plan, journal: Journal, engine: Engine, code: str, quiet: bool) -> Supervisor:
    from hric_sweep.page import build as page

    def shown(folder: Path) -> None:
        if supervisor.rows:
            page.write(folder, running=True)

    with closing(tqdm(total=plan.sampler().total, unit=" runs", disable=quiet or None)) as bar:
        supervisor = Supervisor(plan, folder, journal, engine, code, lambda _: bar.update(), shown)
        try:
            supervisor.run()
        finally:
            if supervisor.rows:
                print(f"\npage: {page.write(folder)}")
    return supervisor


def summary(folder: Path) -> str:
    """For the terminal, from the table: what the page says first."""
    from hric_sweep.page import estimate
    from hric_sweep.page.study import FAILED, OUTPUT, load

    study = load(folder)
    failed = study.kinds == FAILED
    lines = [f"{study.runs} runs, {int(failed.sum())} failed"]
    for name in study.named(OUTPUT):
        values = sorted(value for value in study.columns[name][~failed].tolist() if not math.isnan(value))
        if values:
            middle, unit = statistics.median(values), study.about[name].unit
            lines.append(f"{name}: {values[0]:.6g} to {values[-1]:.6g}, median {middle:.6g} {unit}".rstrip())
    if study.limit is not None:
        lines += filter(None, estimate.lines(study, "given the distributions of the sweep"))
    reasons = Counter(study.columns["failure"][failed].tolist())
    lines += [f"failed {count} times: {reason}" for reason, count in reasons.most_common(5)]
    return "\n".join(lines)


class RerunCommand(Command):
    """Run one run of a sweep again, into a run folder with bag, metrics, figures and page; its hash is compared with
    that of the sweep."""

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            FOLDER,
            Argument("id", help="of the run, or the first characters of it"),
            RUNS,
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Run it again. Raises HricError: it gave another result."""
        folder = table.find(given.sweep)
        plan, before = _opened(folder)
        row = _row(table.read(folder).to_pylist(), given.id)
        one = make_task(plan, row["index"], {name: row[name] for name in plan.section.vary}, before["code"])
        from hric_report import headless as runner
        from hric_report import html as report_html

        changes = definition.written(one["changes"])
        result = runner.run(task.definition_of(one), changes, seed=one["seed"], root=given.runs)
        print(f"{result.metrics['report']}\nrun folder: {result.folder.path}\npage: {report_html.write(result.folder)}")
        if result.metrics["state_sha256"] != row["state_sha256"]:
            raise HricError(
                f"state_sha256 is {result.metrics['state_sha256']}, and was {row['state_sha256']} in the sweep: code "
                f"or machine differ (sweep: code {before['code'][:12]}, here {task.code_version()[:12]})"
            )
        print(f"state_sha256: {row['state_sha256']}, as in the sweep")


def _row(rows: Sequence[dict[str, Any]], given: str) -> dict[str, Any]:
    found = [row for row in rows if row["id"].startswith(given)]
    ids = {row["id"]: None for row in found or rows}
    if not found or len(ids) > 1:  # a point that was chosen twice is one run
        some = ", ".join(list(ids)[:5])
        raise HricError(f"{len(ids) if found else 0} runs have an id that begins with {given!r}; valid: {some}, ...")
    return found[0]


class PageCommand(Command):
    """Write report.html of a sweep again, from its table."""

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [FOLDER]

    def run(self, given: argparse.Namespace) -> None:
        """Write the page."""
        from hric_sweep.page import build as page

        print(f"page: {page.write(table.find(given.sweep))}")
