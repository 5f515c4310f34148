"""Parser of the command line of scripts/replay, which also runs before the set-up.

This file needs only Python and the source code of the workspace."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path += [str(Path(__file__).resolve().parents[2] / "src" / name / "src") for name in ("hric_bags", "hric_core")]
from hric_bags.run_folder import RunFolder, runs_root
from hric_core.errors import HricError


def parsed(argv: Sequence[str]) -> argparse.Namespace:
    """Return the parsed command line; exit with code 2 if an argument is invalid or the run does not exist."""
    parser = argparse.ArgumentParser(
        "scripts/replay",
        description="Play the bag of a run with its recorded clock, and show its robot in rviz. The space bar pauses, "
        "Ctrl-C ends it.",
    )
    parser.add_argument("run", metavar="RUN", help="run folder, its name below runs/, or latest")
    parser.add_argument(
        "--rate",
        type=_rate,
        default=1.0,
        metavar="R",
        help="speed of the replay as a multiple of the recorded speed (default 1)",
    )
    parser.add_argument("--no-rviz", action="store_true", help="do not start rviz; default without a display")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    arguments = parser.parse_args(argv)
    try:
        RunFolder.open(arguments.run, runs_root(arguments.runs))
    except HricError as error:
        parser.error(str(error))
    return arguments


def _rate(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e3:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not possible; valid: a number above 0 and below 1000, such as 0.5"
        )
    return value


if __name__ == "__main__":
    parsed(sys.argv[1:])
