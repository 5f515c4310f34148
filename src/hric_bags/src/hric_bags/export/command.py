"""Commands `export`, `inverse_kinematics` and `inverse_dynamics`."""

import argparse
import sys
from pathlib import Path

from hric_bags.arguments import run_arguments
from hric_bags.export import recording
from hric_bags.export.exporting import Request, default_folder, export, formats
from hric_core.command import Argument, Command
from hric_core.errors import FAILURE


class ExportCommand(Command):
    """Write a bag in other formats, with units, axes and rates in the files.

    What is there already is left alone, so that an interrupted export goes on. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *_run_arguments("export/ of the run, anonymised/ with --anonymise, or <bag>_export/ beside a bag"),
            Argument(
                "--format",
                nargs="+",
                required=True,
                metavar=f"{{{','.join(formats())}}}",
                dest="formats",
                help="what to write",
                complete=formats,
            ),
            Argument("--topics", nargs="+", default=[], metavar="TOPIC", help="to which to keep (default: all)"),
            Argument(
                "--load-body",
                default="",
                metavar="BODY",
                help="external_loads: a set-up file that applies the plates' loads to this body",
            ),
            Argument(
                "--surface",
                type=float,
                default=0.0,
                metavar="METRES",
                help="external_loads, c3d: height of the plates' surface over their electrical origin (c3d: else as in "
                "the run)",
            ),
            Argument(
                "--anonymise",
                nargs="*",
                metavar="NAME",
                help="write only what is known to name nobody (no notes, texts, paths, dates, sex, strength), coarsen "
                "mass and height; write run.yaml, metrics.json and a list of what was done, too. NAME: words that name "
                "the person though they are words of this project",
            ),
            Argument("--again", action="store_true", help="write also what is there already"),
            Argument("--quiet", action="store_true", help="no progress bar"),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Export a bag; return FAILURE if a format could not be written."""
        names = None if given.anonymise is None else tuple(given.anonymise)
        kinds = tuple(dict.fromkeys(given.formats))
        request = Request(kinds, tuple(given.topics), given.load_body, given.surface, names)
        source = recording.find(given.run, given.runs)
        folder = default_folder(source, request) if given.output is None else given.output
        result = export(source, request, folder, again=given.again, progress=not given.quiet and sys.stderr.isatty())
        if result.reading:
            print(f"read in {result.reading:.1f} s")
        for kind, paths in result.files.items():
            took = f"{result.seconds[kind]:.1f} s" if kind in result.seconds else "there already"
            size = sum(path.stat().st_size for path in paths) / 1e6
            print(f"{kind:<14}  {took:>13}  {len(paths)} files, {size:.1f} MB")
        for note in result.notes:
            print(note)
        print(f"export: {folder.absolute()}")
        for kind, reason in result.failures.items():
            print(f"export: {kind} was not written: {reason}", file=sys.stderr)
        return FAILURE if result.failures else 0


class InverseKinematicsCommand(Command):
    """Solve OpenSim's inverse kinematics of a free body with the markers of the motion capture.

    Prints how far it is from the poses that the motion capture sent. Exports the markers (.trc) if that was not done
    yet. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *_run_arguments("inverse_kinematics/ of the run"),
            Argument("--topic", default="", help="of the motion capture (default: the only one)"),
            Argument("--body", default="", help="whose markers (default: the first with three)"),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Solve the inverse kinematics of a body with markers."""
        from hric_bags.export import inverse_kinematics as kinematics

        source = recording.find(given.run, given.runs)
        print(kinematics.render(kinematics.solve(source, given.topic, given.body, given.output)), end="")


class InverseDynamicsCommand(Command):
    """Solve OpenSim's inverse dynamics of the converted robot along the motion of a run.

    Prints how far it is from the torque that was logged. External forces on the robot are not in it. Exports the
    coordinates (.mot) if that was not done yet. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *_run_arguments("inverse_dynamics/ of the run"),
            Argument("--topic", default="", help="of the control log (default: the only one)"),
            Argument(
                "--lowpass",
                type=float,
                default=-1.0,
                metavar="HZ",
                help="cut-off of the coordinates' filter (default: none)",
            ),
            Argument(
                "--rotor-inertia",
                type=float,
                default=0.0,
                metavar="KGM2",
                help="of all joints, for a log of motor torques (default: 0, for torques behind the rotors)",
            ),
        ]

    def run(self, given: argparse.Namespace) -> None:
        """Solve the inverse dynamics of the robot along a run."""
        from hric_bags.export import inverse_dynamics as dynamics

        source = recording.find(given.run, given.runs)
        solution = dynamics.solve(source, given.topic, given.lowpass, given.rotor_inertia, given.output)
        print(dynamics.render(solution), end="")


def _run_arguments(output: str) -> list[Argument]:
    """Return run, folder of the runs and folder of the results; output: default of the latter, for --help."""
    folder = Argument("--output", type=Path, metavar="DIR", help=f"where to write (default: {output})")
    return [*run_arguments(), folder]
