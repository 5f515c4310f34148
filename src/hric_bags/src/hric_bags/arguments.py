"""Command-line arguments that several commands share: a run, and the folder of all runs.

A run is given by its folder, by its name below the folder of all runs, or as the newest one.
"""

from hric_bags.run_folder import runs_root
from hric_core.command import Argument

LATEST = "latest"
"""Name by which the newest run is opened."""
RUNS = Argument(
    "--runs",
    type=runs_root,
    default="",
    metavar="DIR",
    help="folder of all runs (default: $HRIC_RUNS, else runs/ of the workspace)",
)
"""Option `--runs`, the folder of all runs; it has a value even if the option is not given."""


def run_names() -> list[str]:
    """Return the names by which runs can be opened."""
    return [LATEST, *(path.parent.name for path in runs_root().glob("*/run.yaml"))]


def run_arguments(others: str = "or a bag", metavar: str = "RUN|BAG") -> list[Argument]:
    """Return the argument `run`, which may be missing, and `--runs`.

    Args:
        others: text for --help on what the argument may be besides a run.
        metavar: name of the argument in the usage line.
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
