"""Command line of check_model."""

import argparse
import functools
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tqdm import tqdm

from franka_hw_interface import model_check
from franka_hw_interface.arm_log import LogError, check_log
from franka_hw_interface.friction_file import friction_text
from franka_hw_interface.friction_fit import JointFriction, fit_friction
from franka_hw_interface.log_signals import CUTOFF, condition
from franka_hw_interface.model_check import ModelCheck
from hric_bags import files
from hric_control.plants import Phi
from hric_experiments.check_model import csv_log, report, sources
from panda_description.inertial_sets import INERTIAL_SETS

PROGRAM = "rosrun hric_experiments check_model"


def main(arguments: Sequence[str]) -> int:
    """Compare the robot model with the log of an arm."""
    given = _parser().parse_args([f" {one}" if _is_negative(one) else one for one in arguments])
    if given.fitted is not None and given.fit is None:
        raise LogError("-o names the file of a fit; valid: with --fit friction")
    source = sources.find(given)
    friction, breakaway, named = sources.friction(given, source)
    model, description, described = sources.model(given, source)
    check_log(source.log, *sources.ranges(description, source.log.joint_names))
    signals = condition(source.log, given.cutoff)
    hand = sources.try_hand(given, source, lambda other: model_check.coarse_rms(other, signals, friction))
    if hand.given is not given:
        model, description, described = sources.model(hand.given, source)
    counting = functools.partial(tqdm, unit=" instants", desc="model", disable=not sys.stderr.isatty(), leave=False)
    check = model_check.check(model, source.log.joint_names, signals, friction, counting, breakaway)
    about = [
        f"{source.name}: {len(source.log.time)} samples, {signals.duration:.3f} s of "
        f"{signals.time[-1] - signals.time[0]:.3f} s count",
        signals.summary(),
        f"model: {described}; friction {named}",
        *hand.lines,
    ]
    fits = fit_friction(check, friction or sources.published()) if given.fit else []
    text = report.render(check, about) + (f"\n{report.render_fit(fits)}" if fits else "")
    print(text)
    _write(given, source, check, friction, fits, text)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        PROGRAM,
        description="Compare the robot model with the log of an arm: the torque that its motion needs, tau = M(q) "
        "ddq + C dq + g + friction(dq), "
        "against the torque measured behind the gears (tau_J). Prints the residual of each joint, draws, and "
        "can fit friction. Needs no ROS master.",
    )
    _add_log(parser.add_argument)
    _add_results(parser.add_argument)
    return parser


def _add_log(add: Callable[..., Any]) -> None:
    """Add the options that select the log and describe the arm."""
    add(
        "log",
        nargs="?",
        default="latest",
        metavar="LOG",
        help=f"CSV file with a header ({csv_log.USUAL}), bag, run folder, its name, or latest",
    )
    add(
        "--columns",
        nargs="+",
        default=[],
        metavar="KEY=NAME",
        help="columns of a CSV: t=NAME; q=, dq=, tau= with {} for 1 to 7, or seven names",
    )
    add(
        "--topic",
        default="",
        help="of a bag: control log, Franka states or joint states (default: control log, else the one with most "
        "messages)",
    )
    add("--arm-id", default="", help="prefix of the joints (default: that of the bag's only arm, else panda)")
    add("--inertials", choices=INERTIAL_SETS, help="inertial set (default: the run's, else barycentric)")
    add(
        "--hand",
        action=argparse.BooleanOptionalAction,
        help="the arm had the Franka hand, or none (default: the run's robot, else what fits the log better)",
    )
    add(
        "--urdf",
        type=Path,
        metavar="FILE",
        help="another description, such as one of: rosrun panda_description urdf rpy:='3.14 0 0'",
    )
    load = (
        "payload: mass [kg], centre of mass in the flange frame [m], and ixx ixy ixz iyy iyz izz about it "
        "[kg m^2] (default: 0)"
    )
    add("--load", nargs="+", type=float, metavar="VALUE", help=load)
    add(
        "--friction",
        metavar="none|identified|FILE",
        help="identified: the published values (default; of a simulated run: what acted)",
    )


def _add_results(add: Callable[..., Any]) -> None:
    """Add the options for the computation and its output."""
    add(
        "--cutoff",
        type=_positive,
        default=CUTOFF,
        metavar="HZ",
        help="of the low-pass on motion and torques (%(default)g)",
    )
    add(
        "--fit",
        choices=("friction",),
        help="fit the friction of each joint, and write it for --friction FILE and friction:=FILE",
    )
    add(
        "-o",
        dest="fitted",
        type=Path,
        metavar="FILE",
        help="where the fitted friction goes (default: friction.yaml beside the figures)",
    )
    add(
        "--out",
        "--output",
        dest="out",
        type=Path,
        metavar="DIR",
        help="where to write (default: check_model/ of the run, or <log>_check_model/)",
    )
    add("--no-figures", action="store_true", help="text and fitted friction only")
    add("--runs", metavar="DIR", help="folder of all runs")


def _is_negative(text: str) -> bool:
    """Return True for a negative number: argparse takes -1e-3 for an option unless a space precedes it."""
    try:
        return text.startswith("-") and float(text) <= 0.0
    except ValueError:
        return False


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a frequency above 0 [Hz]")
    return value


def _write(
    given: argparse.Namespace,
    source: sources.Source,
    check: ModelCheck,
    friction: Sequence[Phi] | None,
    fits: list[JointFriction],
    text: str,
) -> None:
    """Write report, figures and fitted friction."""
    folder = (given.out or source.folder).expanduser().absolute()
    files.make_folder(folder)
    if fits:
        path = (given.fitted or folder / "friction.yaml").expanduser()
        files.make_folder(path.parent)
        about = (f"Joint friction, fitted to {source.name} by: {PROGRAM} --fit friction", check.signals.summary())
        files.write_text(path, friction_text(fits, about))
        print(f"friction: {path}")
    files.write_text(folder / "summary.txt", text)
    if not given.no_figures:
        from hric_experiments.check_model import figures  # slow to import

        figures.draw_all(folder, check, friction, fits, source.name)
    print(f"{'summary' if given.no_figures else 'figures'}: {folder}")
