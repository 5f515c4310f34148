"""Command `hric trial`: joint angles with their uncertainty, and joint moments, of a person from recorded trials."""

import argparse
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from tqdm import tqdm

from hric_bags import text
from hric_bags.files import write_text
from hric_core.command import Argument, Command
from hric_core.errors import NOT_GOOD, HricError, ParameterError
from hric_core.geometry import UP_AXES
from hric_human.body import load
from hric_motion.formats import trials_in
from hric_motion.hand_loads import hand_load, loaded_moments
from hric_motion.handovers import is_handover
from hric_motion.marker_sets import mapping_text, maps_markers
from hric_motion.moments import MASS_DEVIATION, UNKNOWN_MASS_DEVIATION, JointMoments
from hric_motion.trial import DEFAULT, MEASURES, TrialMotion, prefixes, read, trial_motion
from hric_report.trial import emg, files, summary

T = TypeVar("T")
ALL = "all"
"""Value of --prefix that requests results for each person in a file."""


def trial_arguments() -> list[Argument]:
    """Return the arguments of `hric trial` and `hric validate human`: trials, person, and folder of the results."""
    person = "subject"
    return [
        Argument(
            "motions",
            nargs="+",
            type=Path,
            metavar="MOTION",
            help="trial, or folder of OpenCap or Pose2Sim; several are possible",
        ),
        Argument(
            "--static",
            type=Path,
            metavar="FILE",
            help="trial of the same person standing still; the body is fitted to both",
        ),
        Argument("--up", choices=UP_AXES, default="", help="vertical axis in the files (default: as stated in them)"),
        Argument("--prefix", metavar="P", help="prefix of the labels of one person, or all: results for each person"),
        Argument(
            "--labels",
            type=Path,
            metavar="FILE",
            help="YAML file with lines LABEL: MARKER, and muscles of EMG channels; if it does not exist, it is written "
            "with all labels, to be edited",
        ),
        Argument(
            "-o",
            "--output",
            type=Path,
            metavar="FOLDER",
            help="folder for the results, NAME_trial for each file (default: beside the file)",
        ),
        Argument("--subject", type=Path, metavar="FILE", help="YAML file of the subject", group=person),
        Argument("--mass", type=float, metavar="KG", help="mass (default: as in the file)", group=person),
        Argument("--height", type=float, metavar="M", help="height (default: as in the file)", group=person),
        Argument("--sex", choices=("female", "male"), help="sex (default: male)", group=person),
        *_hand_arguments(),
    ]


def _hand_arguments() -> list[Argument]:
    """Return the options about the load on the hands."""
    hands = "load on the hands"
    return [
        Argument("--load", type=float, metavar="KG", help="mass of a lifted object (needs --hand)", group=hands),
        Argument(
            "--handle",
            type=int,
            metavar="PLATE",
            help="number of the force plate in the file that is a handle in one hand, at rest in the laboratory "
            "(needs --hand)",
            group=hands,
        ),
        Argument(
            "--hand", choices=("right", "left", "both"), help="hand with the load; both: half of it each", group=hands
        ),
        Argument("--from", dest="begin", type=float, metavar="S", help="time of lifting (default: start)", group=hands),
        Argument("--to", dest="end", type=float, metavar="S", help="time of putting down (default: end)", group=hands),
    ]


class TrialCommand(Command):
    """Compute joint angles with standard deviations, and joint moments, of a person in trials.

    A trial is a .c3d, .xdf, .trc, .csv (Motive) or .mvnx (Xsens) file, or the folder of a handover; a folder of trials
    is one of OpenCap or Pose2Sim.

    A body is fitted to the markers; values that markers and force plates do not determine are left empty. Writes
    angles.csv, moments.csv, a page (trial.html), the values (trial.json), and files for OpenSim. Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the trials and the options of `hric trial`."""
        text = "trial of maximum voluntary contractions, or YAML file with lines LABEL: ENVELOPE; may be repeated"
        return [
            *trial_arguments(),
            Argument("--mvc", type=Path, action="append", default=[], metavar="FILE", help=text),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Compute the motions, write their files, and print a summary of each; return the exit code."""
        written, code = of_each(arguments, _written)
        _print(written)
        return code


def of_each(
    arguments: argparse.Namespace, function: Callable[[Path, str | None, argparse.Namespace], T]
) -> tuple[list[T], int]:
    """Call a function for each person of each trial, and return its results and the exit code.

    A trial that fails does not stop the others; its error is printed.

    Args:
        arguments: parsed command line.
        function: function of the trial's file, the prefix of the person's labels (None: no prefix) and `arguments`.

    Raises:
        HricError: the arguments contradict each other, or the only trial fails.
    """
    given = [path.expanduser() for path in arguments.motions]
    folders = {path for path in given if path.is_dir() and not is_handover(path)}
    motions = [file for path in given for file in (trials_in(path) if path in folders else [path])]
    if arguments.subject is not None and (measures := _measures(arguments)):
        raise ParameterError(f"--subject and --{next(iter(measures))} contradict each other; valid: one of them")
    if arguments.labels is not None and arguments.prefix is not None:
        raise ParameterError("--labels and --prefix contradict each other; valid: complete labels, without --prefix")
    if arguments.labels is not None and not arguments.labels.exists():
        _write_mapping(motions[0], arguments.labels)
    jobs = [job for path in motions for job in _people(path, arguments.prefix)]
    results = list[T]()
    for path, prefix in jobs:
        try:
            results.append(function(path, prefix, arguments))
        except HricError as error:
            if len(jobs) == 1:
                raise
            print(f"failed: {error}", file=sys.stderr)
    return results, NOT_GOOD if len(results) < len(jobs) else 0


def _measures(arguments: argparse.Namespace) -> dict[str, float | str]:
    """Return mass [kg], height [m] and sex of the subject, as far as options give them, by name."""
    return {key: getattr(arguments, key) for key in MEASURES if getattr(arguments, key) is not None}


def _write_mapping(motion: Path, target: Path) -> None:
    """Write a mapping file with the labels of a trial. Always raises ParameterError: the user must edit the file."""
    labels = read(motion).labels
    write_text(target, mapping_text(labels) + emg.map_text(read(motion)))
    raise ParameterError(
        f"{target} did not exist: it was written with the {len(labels)} labels of {motion.name}; check the marker of "
        "each line, then run the command again"
    )


def _people(path: Path, prefix: str | None) -> list[tuple[Path, str | None]]:
    """Return file and label prefix (None: no prefix) of each person in a trial; `prefix`: value of --prefix."""
    return [(path, one) for one in prefixes(path)] if prefix == ALL else [(path, prefix)]


def moved(path: Path, prefix: str | None, arguments: argparse.Namespace) -> tuple[TrialMotion, JointMoments | None]:
    """Return the motion of a person in a trial and their joint moments (None: not known); show a progress bar.

    Args:
        path: file of the trial.
        prefix: prefix of the person's labels; None: no prefix.
        arguments: parsed command line.
    """
    subject = None if arguments.subject is None else load(arguments.subject)
    hands = hand_load(arguments.hand, arguments.load, arguments.handle, arguments.begin, arguments.end)
    labels = arguments.labels if arguments.labels is not None and maps_markers(arguments.labels) else None
    with tqdm(unit=" frames", desc=path.name, disable=not sys.stderr.isatty() or None, leave=False) as bar:

        def show(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        result: TrialMotion = trial_motion(
            path, arguments.static, subject, arguments.up, prefix, labels, _measures(arguments), show
        )
    mass = UNKNOWN_MASS_DEVIATION if result.sources["mass"] == DEFAULT else MASS_DEVIATION
    try:
        return result, loaded_moments(result.motion, result.trial, hands, mass)
    except ParameterError:
        raise
    except HricError as error:
        return replace(result, notes=(*result.notes, f"joint moments are not known: {error}")), None


def _written(path: Path, prefix: str | None, arguments: argparse.Namespace) -> Path:
    """Compute the motion of one person in a trial and write its files; return their folder."""
    mapped = {} if arguments.labels is None else emg.read_map(arguments.labels)
    result, moments = moved(path, prefix, arguments)
    compared = emg.compared(result.trial, moments, mapped, arguments.mvc)
    sources = {"motion": path} | ({} if arguments.static is None else {"static": arguments.static})
    sources |= {f"mvc_{number}": file for number, file in enumerate(arguments.mvc, 1)}
    folder = path.parent if arguments.output is None else arguments.output
    person = "_" + re.sub(r"\W", "_", result.prefix) if prefix and result.prefix else ""
    return files.write(result, moments, compared, sources, f"{path.stem}{person}_trial", folder, arguments.command)


def _print(folders: Sequence[Path]) -> None:
    """Print the summary of each trial, and a table if there are several."""
    blocks = [f"{summary.render(one.name, files.values(one))}\nfiles: {one.absolute()}" for one in folders]
    if len(folders) > 1:
        blocks.append(summary.render_table([summary.table_cells(one.name, files.values(one)) for one in folders]))
        tables = dict.fromkeys(folder.parent for folder in folders)
        blocks.append("\n".join(f"table of all trials: {files.write_table(parent)}" for parent in tables))
    text.show("\n\n".join(blocks))
