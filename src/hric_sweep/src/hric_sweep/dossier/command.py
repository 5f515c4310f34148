"""Command `hric dossier`: writes one folder that documents runs and sweeps for readers without this software."""

import argparse
from pathlib import Path

from hric_assessment.findings import DISCLAIMER
from hric_bags.arguments import RUNS, run_names
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command
from hric_sweep.dossier import build, run_part, sweep_part
from hric_sweep.dossier.part import DossierPart
from hric_sweep.page.study import SETTINGS

FOLDER = "dossier"
"""Name of the dossier's folder in the run folder of the first run or sweep, without --output."""


class DossierCommand(Command):
    """Write a dossier of runs and sweeps: application, hazards looked at, method, numbers, gaps, and hashed files.

    The dossier is one folder with a page that prints well. It is not a risk assessment. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the runs and the options of `hric dossier`."""
        return [
            Argument(
                "items",
                nargs="+",
                metavar="RUN|SWEEP",
                help="run folder of a run or a sweep, or its name",
                complete=run_names,
            ),
            RUNS,
            Argument(
                "--output",
                type=Path,
                metavar="DIR",
                help=f"folder of the dossier (default: {FOLDER} in the folder of the first run or sweep)",
            ),
            Argument("--pdf", action="store_true", help="also print the page as PDF (scripts/setup --with pictures)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Write the dossier and print its path."""
        parts = [_part(name, arguments.runs) for name in arguments.items]
        folder = (arguments.output or parts[0].folder / FOLDER).expanduser()
        content = build.contents(parts)
        if arguments.pdf:
            content[build.PDF] = build.printed(content[build.PAGE])
        build.write(folder, content)
        gaps = sum(len(part.gaps) for part in parts)
        print(f"dossier: {folder / build.PAGE}\n{gaps} gaps are listed under 'Not assessed'\n{DISCLAIMER}")


def _part(name: str, root: Path) -> DossierPart:
    """Return the part of the dossier about a run or sweep. Raises HricError if it does not exist.

    Args:
        name: path or name of the run folder.
        root: folder of the runs, for names.
    """
    for candidate in (Path(name).expanduser(), root / name):
        if (candidate / SETTINGS).is_file():
            return sweep_part.part_of(candidate.resolve())
    return run_part.part_of(RunFolder.open(name, root))
