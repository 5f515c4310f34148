"""Commands `export`, `inverse_kinematics` and `inverse_dynamics`."""

import argparse
import sys
from pathlib import Path

from hric_bags.arguments import run_arguments
from hric_bags.export import recording
from hric_bags.export.exporting import ExportRequest, default_folder, export, formats
from hric_core.command import Argument, Command
from hric_core.errors import FAILURE


class ExportCommand(Command):
    """Write a bag in other formats, with units, axes and rates in the files.

    Existing files are kept, so an interrupted export continues. Needs no ROS master.
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
                help="formats to write",
                complete=formats,
            ),
            Argument("--topics", nargs="+", default=[], metavar="TOPIC", help="topics to export (default: all)"),
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
                help="leave out everything that may identify the person (notes, texts, paths, dates, sex, strength), "
                "round mass and height; write also run.yaml, metrics.json and a list of the changes. NAME: words that "
                "identify the person although they are words of this project",
            ),
            Argument("--again", action="store_true", help="write existing files again"),
            Argument("--quiet", action="store_true", help="no progress bar"),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Export a bag; return FAILURE if a format could not be written."""
        names = None if arguments.anonymise is None else tuple(arguments.anonymise)
        kinds = tuple(dict.fromkeys(arguments.formats))
        request = ExportRequest(kinds, tuple(arguments.topics), arguments.load_body, arguments.surface, names)
        source = recording.find(arguments.run, arguments.runs)
        folder = default_folder(source, request) if arguments.output is None else arguments.output
        progress = not arguments.quiet and sys.stderr.isatty()
        result = export(source, request, folder, again=arguments.again, progress=progress)
        if result.reading:
            print(f"read in {result.reading:.1f} s")
        for kind, paths in result.files.items():
            took = f"{result.seconds[kind]:.1f} s" if kind in result.seconds else "existed"
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
            Argument("--topic", default="", help="topic of the motion capture (default: the only one)"),
            Argument("--body", default="", help="body whose markers are used (default: the first with three)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Solve the inverse kinematics of a body with markers."""
        from hric_bags.export import inverse_kinematics as kinematics

        source = recording.find(arguments.run, arguments.runs)
        print(kinematics.render(kinematics.solve(source, arguments.topic, arguments.body, arguments.output)), end="")


class InverseDynamicsCommand(Command):
    """Solve OpenSim's inverse dynamics of the converted robot along the motion of a run.

    Prints how far it is from the torque that was logged. External forces on the robot are not in it. Exports the
    coordinates (.mot) if that was not done yet. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            *_run_arguments("inverse_dynamics/ of the run"),
            Argument("--topic", default="", help="topic of the control log (default: the only one)"),
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
                help="rotor inertia of all joints, for a log of motor torques (default: 0, torques behind the rotors)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Solve the inverse dynamics of the robot along a run."""
        from hric_bags.export import inverse_dynamics as dynamics

        source = recording.find(arguments.run, arguments.runs)
        solution = dynamics.solve(source, arguments.topic, arguments.lowpass, arguments.rotor_inertia, arguments.output)
        print(dynamics.render(solution), end="")


def _run_arguments(output: str) -> list[Argument]:
    """Return run, folder of the runs and folder of the results; output: default of the latter, for --help."""
    folder = Argument("--output", type=Path, metavar="DIR", help=f"where to write (default: {output})")
    return [*run_arguments(), folder]
