"""Command lines of export, inverse_kinematics and inverse_dynamics."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from hric_bags.export import recording
from hric_bags.export.exporting import FORMATS, Request, default_folder, export
from hric_bags.run_folder import runs_root


def main(arguments: Sequence[str]) -> int:
    """Export a bag."""
    given = _export_parser().parse_args(list(arguments))
    names = None if given.anonymise is None else tuple(given.anonymise)
    request = Request(tuple(dict.fromkeys(given.formats)), tuple(given.topics), given.load_body, given.surface, names)
    source = recording.find(given.run, runs_root(given.runs))
    folder = default_folder(source, request) if given.output is None else given.output
    result = export(source, request, folder, again=given.again, progress=not given.quiet and sys.stderr.isatty())
    if result.reading:
        print(f"read in {result.reading:.1f} s")
    for kind, paths in result.files.items():
        took = f"{result.seconds[kind]:.1f} s" if kind in result.seconds else "there already"
        print(f"{kind:<14}  {took:>13}  {len(paths)} files, {sum(path.stat().st_size for path in paths) / 1e6:.1f} MB")
    for note in result.notes:
        print(note)
    print(f"export: {folder.absolute()}")
    for kind, reason in result.failures.items():
        print(f"export: {kind} was not written: {reason}", file=sys.stderr)
    return 1 if result.failures else 0


def inverse_kinematics(arguments: Sequence[str]) -> int:
    """Solve the inverse kinematics of a body with markers."""
    parser = _parser(
        "inverse_kinematics",
        "inverse_kinematics/ of the run",
        "OpenSim's inverse kinematics of a free body with the markers of the motion capture; prints how far it is from "
        "the poses that the motion capture sent. Exports the markers (.trc) if that was not done yet.",
    )
    parser.add_argument("--topic", default="", help="of the motion capture (default: the only one)")
    parser.add_argument("--body", default="", help="whose markers (default: the first with three)")
    given = parser.parse_args(list(arguments))
    from hric_bags.export import inverse_kinematics as kinematics

    source = recording.find(given.run, runs_root(given.runs))
    print(kinematics.render(kinematics.solve(source, given.topic, given.body, given.output)), end="")
    return 0


def inverse_dynamics(arguments: Sequence[str]) -> int:
    """Solve the inverse dynamics of the robot along a run."""
    parser = _parser(
        "inverse_dynamics",
        "inverse_dynamics/ of the run",
        "OpenSim's inverse dynamics of the converted robot along the motion of a run; prints how far it is from the "
        "torque that was logged. External forces on the robot are not in it. Exports the coordinates (.mot) if that "
        "was not done yet.",
    )
    parser.add_argument("--topic", default="", help="of the control log (default: the only one)")
    parser.add_argument(
        "--lowpass", type=float, default=-1.0, metavar="HZ", help="cut-off of the coordinates' filter (default: none)"
    )
    parser.add_argument(
        "--rotor-inertia",
        type=float,
        default=0.0,
        metavar="KGM2",
        help="of all joints, for a log of motor torques (default: 0, for torques behind the rotors)",
    )
    given = parser.parse_args(list(arguments))
    from hric_bags.export import inverse_dynamics as dynamics

    source = recording.find(given.run, runs_root(given.runs))
    solution = dynamics.solve(source, given.topic, given.lowpass, given.rotor_inertia, given.output)
    print(dynamics.render(solution), end="")
    return 0


def _parser(command: str, output: str, description: str) -> argparse.ArgumentParser:
    """Return a parser of the common arguments: run, folder of the runs, folder of the results."""
    parser = argparse.ArgumentParser(
        f"rosrun hric_experiments {command}", description=f"{description} Needs no ROS master."
    )
    parser.add_argument(
        "run", nargs="?", default="latest", metavar="RUN|BAG", help="run folder, its name, latest (default), or a bag"
    )
    parser.add_argument("--output", type=Path, metavar="DIR", help=f"where to write (default: {output})")
    parser.add_argument("--runs", metavar="DIR", help="folder of all runs")
    return parser


def _export_parser() -> argparse.ArgumentParser:
    parser = _parser(
        "export",
        "export/ of the run, anonymised/ with --anonymise, or <bag>_export/ beside a bag",
        "Write a bag in other formats, with units, axes and rates in the files. What is there already is left alone, "
        "so that an interrupted export goes on.",
    )
    parser.add_argument(
        "--format", nargs="+", required=True, metavar=f"{{{','.join(FORMATS)}}}", dest="formats", help="what to write"
    )
    parser.add_argument("--topics", nargs="+", default=[], metavar="TOPIC", help="to which to keep (default: all)")
    parser.add_argument(
        "--load-body",
        default="",
        metavar="BODY",
        help="external_loads: a set-up file that applies the plates' loads to this body",
    )
    parser.add_argument(
        "--surface",
        type=float,
        default=0.0,
        metavar="METRES",
        help="external_loads, c3d: height of the plates' surface over their electrical origin (c3d: else as in the "
        "run)",
    )
    parser.add_argument(
        "--anonymise",
        nargs="*",
        metavar="NAME",
        help="write only what is known to name nobody (no notes, texts, paths, dates, sex, strength), coarsen mass and "
        "height; write run.yaml, metrics.json and a list of what was done, too. NAME: words that name the person "
        "though they are words of this project",
    )
    parser.add_argument("--again", action="store_true", help="write also what is there already")
    parser.add_argument("--quiet", action="store_true", help="no progress bar")
    return parser
