"""Command line: inverse_kinematics."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from hric_experiments.export import recording
from hric_experiments.run_folder import runs_root


def main(arguments: Sequence[str]) -> int:
    """Solve the inverse kinematics of a body with markers."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments inverse_kinematics",
        description="OpenSim's inverse kinematics of a free body with the markers of the motion capture; tells how far it is from the poses "
        "that the motion capture sent. Exports the markers (.trc) if that was not done yet. Needs no ROS master.",
    )
    parser.add_argument("run", nargs="?", default="latest", metavar="RUN|BAG", help="run folder, its name, latest (default), or a bag")
    parser.add_argument("--topic", default="", help="of the motion capture (default: the only one)")
    parser.add_argument("--body", default="", help="whose markers (default: the first with three)")
    parser.add_argument("--output", type=Path, metavar="DIR", help="where to write (default: inverse_kinematics/ of the run)")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    given = parser.parse_args(list(arguments))
    from hric_experiments.export import inverse_kinematics

    source = recording.find(given.run, runs_root(given.runs))
    print(inverse_kinematics.render(inverse_kinematics.solve(source, given.topic, given.body, given.output)), end="")
    return 0
