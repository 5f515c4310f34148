"""Command line: inverse_dynamics."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from hric_experiments.export import recording
from hric_experiments.run_folder import runs_root


def main(arguments: Sequence[str]) -> int:
    """Solve the inverse dynamics of the robot along a run."""
    parser = argparse.ArgumentParser(
        "rosrun hric_experiments inverse_dynamics",
        description="OpenSim's inverse dynamics of the converted robot along the motion of a run; tells how far it is from the torque that was "
        "logged. External forces on the robot are not in it. Exports the coordinates (.mot) if that was not done yet. Needs no ROS master.",
    )
    parser.add_argument("run", nargs="?", default="latest", metavar="RUN", help="run folder, its name, or latest (default)")
    parser.add_argument("--topic", default="", help="of the control log (default: the only one)")
    parser.add_argument("--lowpass", type=float, default=-1.0, metavar="HZ", help="cut-off of the coordinates' filter (default: none)")
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        default=0.0,
        metavar="KGM2",
        help="of all joints, for a log of motor torques (default: 0, for torques behind the rotors)",
    )
    parser.add_argument("--output", type=Path, metavar="DIR", help="where to write (default: inverse_dynamics/ of the run)")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    given = parser.parse_args(list(arguments))
    from hric_experiments.export import inverse_dynamics

    source = recording.find(given.run, runs_root(given.runs))
    print(inverse_dynamics.render(inverse_dynamics.solve(source, given.topic, given.lowpass, given.rotor_inertia, given.output)), end="")
    return 0
