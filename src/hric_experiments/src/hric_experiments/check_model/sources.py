"""Inputs of a model check, from command line and run: log of the arm, model of the arm, and friction."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import panda_description
from franka_hw_interface.arm_log import ArmLog, LogError
from franka_hw_interface.friction_file import JOINTS, read_parameters
from franka_hw_interface.kdl_model import KdlFrankaModel
from hric_bags.run_file import robot_parameters
from hric_control.plants import Phi, breakaways, sigmoid_parameters
from hric_core.command import Argument
from hric_core.resources import read_description
from hric_core.urdf import read
from hric_experiments.check_model import csv_log
from panda_description.inertial_sets import INERTIAL_SETS

FRICTIONS = ("none", "identified")
PANDA = "panda"
CLEARLY = 0.7
"""Ratio of the residuals of two models (with and without the hand) below which the one with the smaller residual counts
as right [1] (project default, unconfirmed)."""


@dataclass(frozen=True)
class LogSource:
    """Log of an arm with its origin.

    Attributes:
        log: motion and torques of the arm.
        name: name of the file or run.
        folder: default folder of the results.
        urdf: robot description of the run; empty: not known.
        friction: kind of friction in a simulated run, "none" or "identified"; "identified" for other logs.
        simulated: parameters of the simulated friction; None: no friction, or the published values.
    """

    log: ArmLog
    name: str
    folder: Path
    urdf: str = ""
    friction: str = "identified"
    simulated: Any = None


def arm_arguments(without_run: str) -> list[Argument]:
    """Return the options that select the signals of a log and describe the arm.

    without_run: default of the option --hand if the log is not a run, as text for --help.
    """
    return [
        Argument(
            "--columns",
            nargs="+",
            default=[],
            metavar="KEY=NAME",
            help="columns of a CSV file: t=NAME; q=, dq=, tau= with {} for 1 to 7, or seven names with commas",
        ),
        Argument(
            "--topic",
            default="",
            help="topic of a bag with control log, Franka states or joint states (default: control log, else the topic "
            "with most messages)",
        ),
        Argument(
            "--arm-id", default="", help="prefix of the joint names (default: prefix of the bag's only arm, else panda)"
        ),
        Argument("--inertials", choices=INERTIAL_SETS, help="inertial set (default: set of the run, else barycentric)"),
        Argument(
            "--hand",
            action=argparse.BooleanOptionalAction,
            help=f"the arm had the Franka hand, or none (default: as in the run, else {without_run})",
        ),
        Argument(
            "--urdf",
            type=Path,
            metavar="FILE",
            help="another robot description, e.g. the output of: hric urdf rpy:='3.14 0 0'",
        ),
    ]


def find(arguments: argparse.Namespace) -> LogSource:
    """Find and read the log that the command line names: a CSV file, a bag, a run folder or its name.

    Raises:
        HricError: the file or run does not exist, or has no log of an arm.
    """
    path = Path(arguments.run).expanduser()
    if path.suffix in (".bag", ".active") or path.is_dir() or not (path.is_file() or path.suffix):
        if arguments.columns:
            raise LogError("--columns selects columns of a CSV file; valid for a bag: --topic and --arm-id")
        return _from_bag(arguments)
    if arguments.topic:
        raise LogError("--topic selects a topic of a bag; valid for a CSV file: --columns")
    names = [f"{arguments.arm_id or PANDA}_{joint}" for joint in JOINTS]
    log = csv_log.read_csv(path, names, csv_log.parse_columns(arguments.columns))
    return LogSource(log, path.name, path.with_name(f"{path.stem}_check_model"))


def _from_bag(arguments: argparse.Namespace) -> LogSource:
    from hric_bags.export import recording
    from hric_experiments.check_model import bag_log

    recorded = recording.find(arguments.run, arguments.runs)
    log, topic = bag_log.read_bag(recorded, arguments.topic, arguments.arm_id)
    if recorded.folder is None:
        return LogSource(
            log, f"{recorded.bag.name}, {topic}", recorded.bag.with_name(f"{recorded.bag.stem}_check_model")
        )
    name, output = f"{recorded.folder.path.name}, {topic}", recorded.folder.path / "check_model"
    robot = robot_parameters(recorded.run)
    if not robot or str(robot.get("robot_hw", "")).startswith("franka_real"):
        return LogSource(log, name, output, recorded.urdf)
    plant = robot.get("plant") or {}
    acted = plant.get("friction", "none")
    return LogSource(
        log, name, output, recorded.urdf, acted if acted in FRICTIONS else "none", plant.get("friction_parameters")
    )


def model(arguments: argparse.Namespace, source: LogSource) -> tuple[KdlFrankaModel, str, str]:
    """Return the robot model with its payload, its URDF, and a name for the report.

    Raises:
        HricError: the robot description or the payload is invalid.
    """
    arm_id = source.log.joint_names[0].removesuffix("joint1").rstrip("_")
    text, name, gravity_base = _description(arguments, source, arm_id)
    made = (
        KdlFrankaModel(text, arm_id)
        if gravity_base is None
        else KdlFrankaModel(text, arm_id, gravity_world=gravity_base)
    )
    return made, text, name + _loaded(made, arguments.load)


def _description(
    arguments: argparse.Namespace, source: LogSource, arm_id: str
) -> tuple[str, str, Sequence[float] | None]:
    """Return the URDF, its name, and the gravity in the base frame [m/s^2]; None: gravity as mounted in the URDF."""
    is_chosen = arguments.inertials is not None or arguments.hand is not None
    if arguments.urdf is not None:
        if is_chosen:
            raise LogError(
                "--urdf already defines inertials and hand; valid: without --inertials, --hand and --no-hand"
            )
        return read_description(arguments.urdf), arguments.urdf.name, None
    if source.urdf and not is_chosen:
        return source.urdf, "robot.urdf of the run", None
    hand = _has_hand(source, arm_id) if arguments.hand is None else arguments.hand
    name = arguments.inertials or "barycentric"
    text = panda_description.load(arm_id=arm_id, hand=hand, inertials=name, meshes=False, collision=False)
    mounted = KdlFrankaModel(source.urdf, arm_id).gravity_base.tolist() if source.urdf else None
    return text, f"inertials {name}, {'with' if hand else 'without'} hand", mounted


def _has_hand(source: LogSource, arm_id: str) -> bool:
    """Return True if the robot of the run has the hand, or if the robot is unknown."""
    return not source.urdf or f'"{arm_id}_hand"' in source.urdf


@dataclass(frozen=True)
class HandTrial:
    """Result of comparing the models with and without the hand.

    Attributes:
        arguments: command-line arguments that select the model to use.
        lines: text lines for the report.
    """

    arguments: argparse.Namespace
    lines: tuple[str, ...] = ()


def try_hand(
    arguments: argparse.Namespace, source: LogSource, coarse_rms: Callable[[KdlFrankaModel], float]
) -> HandTrial:
    """Compare the models with and without the hand if the command line does not select one of them.

    For an unknown arm the model with the smaller residual is used. For the robot of a run, a warning is given if the
    other model fits better.

    Args:
        arguments: command-line arguments.
        source: log with its origin.
        coarse_rms: function that returns the residual of a robot model [N m].
    """
    if arguments.hand is not None or arguments.urdf is not None:
        return HandTrial(arguments)
    with_hand = _has_hand(source, source.log.joint_names[0].removesuffix("joint1").rstrip("_"))
    other = argparse.Namespace(**{**vars(arguments), "hand": not with_hand})
    own_rms, other_rms = (coarse_rms(model(tried, source)[0]) for tried in (arguments, other))
    better = other_rms < CLEARLY * own_rms
    names = ("with the hand", "without a hand") if with_hand else ("without a hand", "with the hand")
    sums = f"the sum of the residuals is {own_rms:.3g} N m {names[0]}, {other_rms:.3g} N m {names[1]}"
    if source.urdf:
        option = "--no-hand" if with_hand else "--hand"
        return HandTrial(
            arguments, (f"WARNING: {sums}; try {option}, or check if hand:= of the run was right",) if better else ()
        )
    return HandTrial(other if better else arguments, (f"neither --hand nor --no-hand is given: {sums}",))


def _loaded(made: KdlFrankaModel, load: Sequence[float] | None) -> str:
    """Set the payload of the model; return a text that describes it, "" without a payload."""
    if load is None:
        return ""
    if len(load) not in (4, 10):
        raise LogError(
            f"--load has {len(load)} values; valid: 4 (mass x y z) or 10 (mass x y z ixx ixy ixz iyy iyz izz)"
        )
    mass, com, (xx, xy, xz, yy, yz, zz) = load[0], load[1:4], load[4:] or (0.0,) * 6
    made.set_load(mass, com, (xx, xy, xz, xy, yy, yz, xz, yz, zz))
    return f", load {mass:g} kg at {' '.join(f'{value:g}' for value in com)} m"


def ranges(text: str, joint_names: Sequence[str]) -> tuple[list[float], list[float]]:
    """Return the lower and the upper position limits of the joints [rad]; `text`: URDF of the robot."""
    described = read(text).joints
    joints = [described[name] for name in joint_names]
    return [joint.lower for joint in joints], [joint.upper for joint in joints]


def published() -> list[Phi]:
    """Return the published friction parameters phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the Panda's joints 1 to 7."""
    values = panda_description.friction_parameters(PANDA)
    return sigmoid_parameters(values, list(values))


def friction(arguments: argparse.Namespace, source: LogSource) -> tuple[list[Phi] | None, list[float], str]:
    """Return friction parameters of each joint (None: no friction), breakaway torques [N m], and a name for the report.

    Raises:
        HricError: the friction file is missing or invalid.
    """
    chosen = arguments.friction or source.friction
    if chosen == "none":
        return None, [], "none"
    if chosen != "identified":
        path = Path(chosen).expanduser()
        if not path.is_file():
            raise LogError(
                f"--friction {chosen}: no such file; valid: {', '.join(FRICTIONS)}, or a YAML file written by "
                "--fit friction"
            )
        parameters, joints, name = read_parameters(path), JOINTS, f"of {path.name}"
    elif arguments.friction is None and source.simulated:
        parameters, joints = source.simulated, source.log.joint_names
        name = "identified, as in the simulation"
    else:
        return published(), [], "identified (published values)"
    return sigmoid_parameters(parameters, joints), breakaways(parameters, joints), name
