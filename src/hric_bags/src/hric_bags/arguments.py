"""Arguments that several commands have: a run, and the folder of all runs.

A run is given by its folder, by its name below the folder of all runs, or as the newest one.
"""

from hric_bags.run_folder import runs_root
from hric_core.command import Argument

LATEST = "latest"
"""Name of the newest run."""
RUNS = Argument(
    "--runs",
    type=runs_root,
    default="",
    metavar="DIR",
    help="folder of all runs (default: $HRIC_RUNS, else runs/ of the workspace)",
)
"""Folder of all runs, also where the option is not given."""


def run_names() -> list[str]:
    """Return the names by which runs can be opened."""
    return [LATEST, *(path.parent.name for path in runs_root().glob("*/run.yaml"))]


def run_arguments(others: str = "or a bag", metavar: str = "RUN|BAG") -> list[Argument]:
    """Return the argument `run`, which may be missing, and `--runs`.

    Args:
        others: what it may be beside a run, for --help.
        metavar: as the usage shows it.
    """
    run = Argument(
        "run",
        nargs="?",
        default=LATEST,
        metavar=metavar,
        help=f"run folder, its name, {LATEST} (default), {others}",
        complete=run_names,
    )
    return [run, RUNS]
