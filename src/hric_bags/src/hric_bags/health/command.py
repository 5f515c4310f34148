"""Command `health`."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from hric_bags import files
from hric_bags.arguments import run_arguments
from hric_bags.health import examine, seams
from hric_bags.health.examine import DAMAGED, Health
from hric_bags.health.salvage import salvage
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command


class HealthCommand(Command):
    """Examine a bag, or each part of one and where they meet: rates, gaps, order, clock, and damage.

    Needs no ROS master.
    """

    epilog = (
        "exit codes: 0 healthy; 3 readable, with problems; 4 damaged; 2 cannot be examined. With --salvage, of "
        "the salvaged bag."
    )

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *run_arguments(),
            Argument(
                "--salvage",
                action="store_true",
                help="of a damaged bag, write what can be read into a whole one; the damaged one is kept",
            ),
            Argument("--json", type=Path, metavar="FILE", help="write the findings here, too"),
            Argument("--quiet", action="store_true", help="no progress bar, and of the report only the findings"),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Examine a bag; return 0 (healthy), 3 (readable, with problems) or 4 (damaged)."""
        parts, folder = examine.find(given.run, given.runs)
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
