"""Commands `hric export`, `hric inverse_kinematics` and `hric inverse_dynamics`."""

import argparse
import sys
from pathlib import Path

from hric_bags.arguments import run_arguments, run_names
from hric_bags.export import exporting, recording
from hric_bags.export.job import RATE, ExportRequest, formats
from hric_core.command import Argument, Command
from hric_core.errors import FAILURE

_OPTIONS = (
    Argument(
        "--anonymise",
        nargs="*",
        metavar="NAME",
        help="leave out everything that may identify the person (notes, texts, paths, dates, sex, strength), "
        "round mass and height; also write run.yaml, metrics.json and a list of the changes. NAME: words that "
        "identify the person, although this project uses them, too",
    ),
    Argument("--again", action="store_true", help="write existing files again"),
    Argument("--quiet", action="store_true", help="show no progress bar"),
)


class ExportCommand(Command):
    """Write a bag in other formats, with units, axes and rates in the files.

    Existing files are not written again, so that an interrupted export continues. No ROS master is needed.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of the command."""
        return [
            *_run_arguments("export/ of the run, anonymised/ with --anonymise, or <bag>_export/ beside a bag"),
            Argument(
                "others",
                nargs="*",
                metavar="RUN",
                help="further runs for --format lerobot: each run is an episode of the data set",
                complete=run_names,
            ),
            Argument(
                "--rate", type=int, default=RATE, metavar="HZ", help=f"lerobot: frames per second (default: {RATE})"
            ),
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
                help="external_loads: also write a set-up file that applies the plates' loads to this body of a model",
            ),
            Argument(
                "--surface",
                type=float,
                default=0.0,
                metavar="METRES",
                help="external_loads, c3d: height of the plates' surface above their electrical origin (default: 0; "
                "c3d: as in the run)",
            ),
            *_OPTIONS,
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Export a bag, and print what was written; return FAILURE if a format could not be written."""
        names = None if arguments.anonymise is None else tuple(arguments.anonymise)
        kinds = tuple(dict.fromkeys(arguments.formats))
        request = ExportRequest(
            kinds, tuple(arguments.topics), arguments.load_body, arguments.surface, names, arguments.rate
        )
        source, *others = (recording.find(name, arguments.runs) for name in (arguments.run, *arguments.others))
        folder = exporting.default_folder(source, request) if arguments.output is None else arguments.output
        progress = not arguments.quiet and sys.stderr.isatty()
        result = exporting.export(source, request, folder, others, again=arguments.again, progress=progress)
        if result.reading:
            print(f"bag read in {result.reading:.1f} s")
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

    The difference from the poses that the motion capture measured is printed. The markers are exported (.trc) if they
    were not before. No ROS master is needed.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of the command."""
        return [
            *_run_arguments("inverse_kinematics/ of the run"),
            Argument("--topic", default="", help="topic of the motion capture (default: the only one in the bag)"),
            Argument("--body", default="", help="body whose markers are used (default: the first with three markers)"),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Solve the inverse kinematics of a body with markers, and print the result."""
        from hric_bags.export import inverse_kinematics as kinematics

        source = recording.find(arguments.run, arguments.runs)
        print(kinematics.render(kinematics.solve(source, arguments.topic, arguments.body, arguments.output)), end="")


class InverseDynamicsCommand(Command):
    """Solve OpenSim's inverse dynamics of the converted robot along the motion of a run.

    The difference from the logged torque is printed. External forces on the robot are not considered. The coordinates
    are exported (.mot) if they were not before. No ROS master is needed.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of the command."""
        return [
            *_run_arguments("inverse_dynamics/ of the run"),
            Argument("--topic", default="", help="topic of the control log (default: the only one in the bag)"),
            Argument(
                "--lowpass",
                type=float,
                default=-1.0,
                metavar="HZ",
                help="cut-off frequency of the low-pass of the coordinates (default: no filter)",
            ),
            Argument(
                "--rotor-inertia",
                type=float,
                default=0.0,
                metavar="KGM2",
                help="rotor inertia of each joint, if the log has motor torques (default: 0, torques on the link side)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Solve the inverse dynamics of the robot along a run, and print the result."""
        from hric_bags.export import inverse_dynamics as dynamics

        source = recording.find(arguments.run, arguments.runs)
        solution = dynamics.solve(source, arguments.topic, arguments.lowpass, arguments.rotor_inertia, arguments.output)
        print(dynamics.render(solution), end="")


def _run_arguments(output: str) -> list[Argument]:
    """Return the arguments run, --runs and --output; output: default folder of the results, for --help."""
    folder = Argument("--output", type=Path, metavar="DIR", help=f"folder of the results (default: {output})")
    return [*run_arguments(), folder]
