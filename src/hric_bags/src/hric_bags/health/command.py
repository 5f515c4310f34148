"""Command `hric health`: examines bags, and salvages damaged ones."""

import argparse
import sys
from dataclasses import asdict
from pathlib import Path

from hric_bags import files
from hric_bags.arguments import run_arguments
from hric_bags.health import examine, seams
from hric_bags.health.examine import DAMAGED, BagHealth
from hric_bags.health.salvage import salvage
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command


class HealthCommand(Command):
    """Examine a bag, or each part of a split bag and their seams: rates, gaps, order, clock, and damage.

    No ROS master is needed.
    """

    epilog = (
        "exit codes: 0 healthy; 3 readable, with problems; 4 damaged; 2 cannot be examined. With --salvage, the "
        "code is for the salvaged bag."
    )

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of `hric health`."""
        return [
            *run_arguments(),
            Argument(
                "--salvage",
                action="store_true",
                help="write the readable messages of a damaged bag to a new, complete bag; the damaged bag is kept",
            ),
            Argument("--json", type=Path, metavar="FILE", help="also write the findings to this file"),
            Argument("--quiet", action="store_true", help="print only the findings, and show no progress bar"),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Examine a bag, and print the report; return 0 (healthy), 3 (readable, with problems) or 4 (damaged)."""
        parts, folder = examine.find(arguments.run, arguments.runs)
        reports = [_examine(path, folder, arguments) for path in parts]
        joined = seams.of_parts([(health.path, health.streams) for health in reports])
        for seam in joined:
            print(seam.render(arguments.quiet), end="", flush=True)
        code = max([health.code for health in reports] + [examine.code_of(seam.findings) for seam in joined])
        if arguments.json is not None:
            bags = [examine.to_dict(health) for health in reports]
            listed = [
                {"before": seam.before, "after": seam.after, "findings": [asdict(finding) for finding in seam.findings]}
                for seam in joined
            ]
            files.write_json(arguments.json, {"exit_code": code, "bags": bags, "seams": listed})
        return code


def _examine(path: Path, folder: RunFolder | None, arguments: argparse.Namespace) -> BagHealth:
    health = examine.examine(path, progress=not arguments.quiet and sys.stderr.isatty())
    _print(health, arguments.quiet)
    return _salvaged(path, folder, arguments.quiet) if arguments.salvage and health.code == DAMAGED else health


def _salvaged(path: Path, folder: RunFolder | None, quiet: bool) -> BagHealth:
    result = salvage(path)
    if folder is not None:
        folder.update(salvaged=True)
    print(f"salvaged {result.messages} messages into {result.bag}; the damaged bag is {result.original.name}\n")
    health = examine.examine(result.bag, doubtful=result.doubtful)
    _print(health, quiet)
    return health


def _print(health: BagHealth, quiet: bool) -> None:
    text = "".join(f"{finding}\n" for finding in health.findings) if quiet else examine.render(health)
    print(text, end="", flush=True)
