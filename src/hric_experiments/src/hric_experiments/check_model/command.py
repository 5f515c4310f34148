"""Command `check_model`: compare the robot model with the log of an arm, and fit joint friction."""

import argparse
import functools
import math
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from franka_hw_interface import model_check
from franka_hw_interface.arm_log import LogError, check_log
from franka_hw_interface.friction_file import friction_text
from franka_hw_interface.friction_fit import JointFriction, fit_friction
from franka_hw_interface.log_signals import CUTOFF, condition
from franka_hw_interface.model_check import ModelCheck
from hric_bags import files
from hric_bags.arguments import run_arguments
from hric_control.plants import Phi
from hric_core.command import Argument, Command
from hric_experiments.check_model import csv_log, report, sources


class CheckModelCommand(Command):
    """Compare the robot model with the log of an arm.

    The model's torque for the logged motion, tau = M(q) ddq + C dq + g + friction(dq), is compared with the torque
    measured behind the gears (tau_J). Prints the residual of each joint, draws figures, and can fit friction.
    Needs no ROS master.
    """

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments."""
        return [
            *run_arguments(f"bag, or CSV file with a header ({csv_log.USUAL})", "LOG"),
            *_log_arguments(),
            *_results_arguments(),
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Compare the model with the log; print and write the results."""
        if arguments.fitted is not None and arguments.fit is None:
            raise LogError("-o is the file for the fitted friction; valid: -o only together with --fit friction")
        source = sources.find(arguments)
        friction, breakaway, named = sources.friction(arguments, source)
        model, description, described = sources.model(arguments, source)
        check_log(source.log, *sources.ranges(description, source.log.joint_names))
        signals = condition(source.log, arguments.cutoff)
        hand = sources.try_hand(arguments, source, lambda other: model_check.coarse_rms(other, signals, friction))
        if hand.arguments is not arguments:
            model, description, described = sources.model(hand.arguments, source)
        counting = functools.partial(tqdm, unit=" instants", desc="model", disable=not sys.stderr.isatty(), leave=False)
        check = model_check.check(model, source.log.joint_names, signals, friction, counting, breakaway)
        about = [
            f"{source.name}: {len(source.log.time)} samples, {signals.duration:.3f} s of "
            f"{signals.time[-1] - signals.time[0]:.3f} s are used",
            signals.summary(),
            f"model: {described}; friction {named}",
            *hand.lines,
        ]
        fits = fit_friction(check, friction or sources.published()) if arguments.fit else []
        text = report.render(check, about) + (f"\n{report.render_fit(fits)}" if fits else "")
        print(text)
        _write(arguments, source, check, friction, fits, text)


def _log_arguments() -> list[Argument]:
    """Return the options that select the log and describe the arm."""
    return [
        *sources.arm_arguments("the model that fits the log better"),
        Argument(
            "--load",
            nargs="+",
            type=float,
            metavar="VALUE",
            help="payload: mass [kg], centre of mass in the flange [m], ixx ixy ixz iyy iyz izz about it [kg m^2]",
        ),
        Argument(
            "--friction",
            metavar="none|identified|FILE",
            help="friction of the model; identified: published values (default; for a simulated run: its friction)",
        ),
    ]


def _results_arguments() -> list[Argument]:
    """Return the options for the computation and its output."""
    return [
        Argument(
            "--cutoff",
            type=_positive,
            default=CUTOFF,
            metavar="HZ",
            help="cut-off frequency of the low-pass filter for motion and torques [Hz] (default: %(default)g)",
        ),
        Argument(
            "--fit",
            choices=("friction",),
            help="fit the friction of each joint, and write a file for --friction FILE and friction:=FILE",
        ),
        Argument(
            "-o",
            dest="fitted",
            type=Path,
            metavar="FILE",
            help="file for the fitted friction (default: friction.yaml in the output folder)",
        ),
        Argument(
            "--out",
            "--output",
            dest="out",
            type=Path,
            metavar="DIR",
            help="output folder (default: check_model/ in the run folder, or <log>_check_model/ next to the log)",
        ),
        Argument("--no-figures", action="store_true", help="write only the text and the fitted friction"),
    ]


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a frequency above 0 [Hz]")
    return value


def _write(
    arguments: argparse.Namespace,
    source: sources.LogSource,
    check: ModelCheck,
    friction: Sequence[Phi] | None,
    fits: list[JointFriction],
    text: str,
) -> None:
    """Write the text report, figures and fitted friction, and print their paths."""
    folder = (arguments.out or source.folder).expanduser().absolute()
    files.make_folder(folder)
    if fits:
        path = (arguments.fitted or folder / "friction.yaml").expanduser()
        files.make_folder(path.parent)
        about = (
            f"Joint friction, fitted to {source.name} by: hric check_model --fit friction",
            check.signals.summary(),
        )
        files.write_text(path, friction_text(fits, about))
        print(f"friction: {path}")
    files.write_text(folder / "summary.txt", text)
    if not arguments.no_figures:
        from hric_experiments.check_model import figures  # slow to import

        figures.draw_all(folder, check, friction, fits, source.name)
    print(f"{'summary' if arguments.no_figures else 'figures'}: {folder}")
