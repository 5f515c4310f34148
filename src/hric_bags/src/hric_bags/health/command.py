"""Command line of `health`."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from hric_bags import files
from hric_bags.health import examine, seams
from hric_bags.health.examine import DAMAGED, Health
from hric_bags.health.salvage import salvage
from hric_bags.run_folder import RunFolder, runs_root


def main(arguments: Sequence[str]) -> int:
    """Examine a bag; return 0 (healthy), 3 (readable, with problems) or 4 (damaged)."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments health",
        description="Examine a bag, or each part of one and where they meet: rates, gaps, order, clock, and damage. "
        "Needs no ROS master.",
        epilog="exit codes: 0 healthy; 3 readable, with problems; 4 damaged; 2 cannot be examined. With --salvage, "
        "of the salvaged bag.",
    )
    parser.add_argument(
        "run", nargs="?", default="latest", metavar="RUN|BAG", help="run folder, its name, latest (default), or a bag"
    )
    parser.add_argument(
        "--salvage",
        action="store_true",
        help="of a damaged bag, write what can be read into a whole one; the damaged one is kept",
    )
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
        bags = [examine.to_dict(health) for health in found]
        listed = [
            {"before": seam.before, "after": seam.after, "findings": [asdict(finding) for finding in seam.findings]}
            for seam in joined
        ]
        files.write_json(given.json, {"exit_code": code, "bags": bags, "seams": listed})
    return code


def _examine(path: Path, folder: RunFolder | None, given: argparse.Namespace) -> Health:
    health = examine.examine(path, progress=not given.quiet and sys.stderr.isatty())
    _print(health, given.quiet)
    return _salvaged(path, folder, given.quiet) if given.salvage and health.code == DAMAGED else health


def _salvaged(path: Path, folder: RunFolder | None, quiet: bool) -> Health:
    result = salvage(path)
    if folder is not None:
        folder.update(salvaged=True)
    print(f"salvaged {result.messages} messages into {result.bag}; the damaged bag is {result.original.name}\n")
    health = examine.examine(result.bag, doubtful=result.doubtful)
    _print(health, quiet)
    return health


def _print(health: Health, quiet: bool) -> None:
    text = "".join(f"{finding}\n" for finding in health.findings) if quiet else examine.render(health)
    print(text, end="", flush=True)
