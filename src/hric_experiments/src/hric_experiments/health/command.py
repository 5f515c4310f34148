"""Command line: health."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from hric_experiments import files
from hric_experiments.health import examine, seams
from hric_experiments.health.examine import DAMAGED, Health
from hric_experiments.health.salvage import salvage
from hric_experiments.run_folder import INTERRUPTED, RUNNING, RunFolder, runs_root


def main(arguments: Sequence[str]) -> int:
    """Examine a bag; answers 0 (healthy), 3 (readable, with problems) or 4 (damaged)."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments health",
        description="Examine a bag, or each part of one and where they meet: rates, gaps, order, clock, and damage. Needs no ROS master.",
        epilog="exit codes: 0 healthy; 3 readable, with problems; 4 damaged; 1 cannot be examined. With --salvage, of the salvaged bag.",
    )
    parser.add_argument("run", nargs="?", default="latest", metavar="RUN|BAG", help="run folder, its name, latest (default), or a bag")
    parser.add_argument("--salvage", action="store_true", help="of a damaged bag, write what can be read into a whole one; the damaged one is kept")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the findings here, too")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    parser.add_argument("--quiet", action="store_true", help="no progress bar, and of the report only the findings")
    given = parser.parse_args(list(arguments))
    parts, folder = examine.find(given.run, runs_root(given.runs))
    found = [_examine(path, folder, given) for path in parts]
    joined = seams.of_parts([(health.path, health.streams) for health in found])
    for seam in joined:
        print(seam.render(given.quiet), end="", flush=True)
    code = max([health.code for health in found] + [examine.code_of(seam.findings) for seam in joined])
    if given.json is not None:
        try:
            told = [{"before": s.before, "after": s.after, "findings": examine.findings_of(s.findings)} for s in joined]
            files.write_json(given.json, {"exit_code": code, "bags": [examine.to_dict(health) for health in found], "seams": told})
        except OSError as error:
            raise examine.HealthError(f"cannot write {given.json}: {error.strerror or error}") from error
    return code


def _examine(path: Path, folder: RunFolder | None, given: argparse.Namespace) -> Health:
    health = examine.examine(path, progress=not given.quiet and sys.stderr.isatty())
    _tell(health, given.quiet)
    return _salvaged(path, folder, given.quiet) if given.salvage and health.code == DAMAGED else health


def _salvaged(path: Path, folder: RunFolder | None, quiet: bool) -> Health:
    result = salvage(path)
    if folder is not None:
        status = folder.read().get("status")
        folder.update(salvaged=True, **({"status": INTERRUPTED} if status == RUNNING else {}))
    print(f"salvaged {result.messages} messages into {result.bag}; the damaged bag is {result.original.name}\n")
    health = examine.examine(result.bag)
    _tell(health, quiet)
    return health


def _tell(health: Health, quiet: bool) -> None:
    text = examine.render(health)
    if quiet:
        text = "".join(f"{finding.level}: {finding.topic}{': ' if finding.topic else ''}{finding.text}\n" for finding in health.findings)
    print(text, end="", flush=True)
