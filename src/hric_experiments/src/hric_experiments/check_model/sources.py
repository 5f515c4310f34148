"""Inputs of a model check from the arguments and the run: the log, the model of its arm, and the friction."""

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
from hric_core.resources import read_description
from hric_core.urdf import read
from hric_experiments.check_model import csv_log

FRICTIONS = ("none", "identified")
PANDA = "panda"
CLEARLY = 0.7
"""Residual of the other model relative to that of this one below which the other is taken as right [1] (project
default, unconfirmed)."""


@dataclass(frozen=True)
class LogSource:
    """Log of an arm with its origin.

    Attributes:
        log: the log.
        name: name of the file or run.
        folder: default folder of the results.
        urdf: description of the robot in the run; empty: not known.
        friction: friction that acted in a simulated run; "identified" for any other log.
        simulated: parameters of this friction; None: no friction, or the published values.
    """

    log: ArmLog
    name: str
    folder: Path
    urdf: str = ""
    friction: str = "identified"
    simulated: Any = None


def find(arguments: argparse.Namespace) -> LogSource:
    """Find and read the log that the arguments name: a CSV file, a bag, a run folder or its name.

    Raises:
        HricError: it does not exist, or has no log of an arm.
    """
    path = Path(arguments.run).expanduser()
    if path.suffix in (".bag", ".active") or path.is_dir() or not (path.is_file() or path.suffix):
        if arguments.columns:
            raise LogError("--columns is for CSV files; for a bag use --topic and --arm-id")
        return _from_bag(arguments)
    if arguments.topic:
        raise LogError("--topic is for bags; for a CSV file use --columns")
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
    """Return the model with its payload, its description, and its name.

    Raises:
        HricError: the description or the payload cannot be used.
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
    """Return the URDF, its name, and gravity in the base if the URDF lacks the mounting of the run [m/s^2]."""
    is_chosen = arguments.inertials is not None or arguments.hand is not None
    if arguments.urdf is not None:
        if is_chosen:
            raise LogError("--urdf brings its own inertials and hand; valid: without --inertials, --hand and --no-hand")
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
    """Outcome of a trial of the model with and without the hand.

    Attributes:
        arguments: arguments of the model to use.
        lines: lines for the report.
    """

    arguments: argparse.Namespace
    lines: tuple[str, ...] = ()


def try_hand(
    arguments: argparse.Namespace, source: LogSource, coarse_rms: Callable[[KdlFrankaModel], float]
) -> HandTrial:
    """Compare the model with and without the hand if the arguments do not select one.

    For an unknown arm the better model is used; for the robot of a run a warning says if the other model fits better.

    Args:
        arguments: arguments of the command.
        source: log with its origin.
        coarse_rms: function that returns the residual of a model [N m].
    """
    if arguments.hand is not None or arguments.urdf is not None:
        return HandTrial(arguments)
    with_hand = _has_hand(source, source.log.joint_names[0].removesuffix("joint1").rstrip("_"))
    other = argparse.Namespace(**{**vars(arguments), "hand": not with_hand})
    own_rms, other_rms = (coarse_rms(model(tried, source)[0]) for tried in (arguments, other))
    better = other_rms < CLEARLY * own_rms
    names = ("with the hand", "without a hand") if with_hand else ("without a hand", "with the hand")
    sums = f"the residual's sum is {own_rms:.3g} N m {names[0]}, {other_rms:.3g} {names[1]}"
    if source.urdf:
        option = "--no-hand" if with_hand else "--hand"
        return HandTrial(
            arguments, (f"WARNING: {sums}: try {option}, or hand:= of the run was wrong",) if better else ()
        )
    return HandTrial(other if better else arguments, (f"hand not given (--hand, --no-hand): {sums}",))


def _loaded(made: KdlFrankaModel, load: Sequence[float] | None) -> str:
    """Set the payload of the model; return its description, "" without a payload."""
    if load is None:
        return ""
    if len(load) not in (4, 10):
        raise LogError(f"--load has {len(load)} values; valid: 4 (mass x y z) or 10 (and ixx ixy ixz iyy iyz izz)")
    mass, com, (xx, xy, xz, yy, yz, zz) = load[0], load[1:4], load[4:] or (0.0,) * 6
    made.set_load(mass, com, (xx, xy, xz, xy, yy, yz, xz, yz, zz))
    return f", load {mass:g} kg at {' '.join(f'{value:g}' for value in com)} m"


def ranges(text: str, joint_names: Sequence[str]) -> tuple[list[float], list[float]]:
    """Return the lower and upper position limits of the joints [rad]; text: the description."""
    described = read(text).joints
    joints = [described[name] for name in joint_names]
    return [joint.lower for joint in joints], [joint.upper for joint in joints]


def published() -> list[Phi]:
    """Return the published friction parameters phi1 [N m], phi2 [s/rad], phi3 [rad/s] of the Panda's joints 1 to 7."""
    values = panda_description.friction_parameters(PANDA)
    return sigmoid_parameters(values, list(values))


def friction(arguments: argparse.Namespace, source: LogSource) -> tuple[list[Phi] | None, list[float], str]:
    """Return the friction sigmoid of each joint (None: no friction), the breakaway torques [N m], and a name.

    Raises:
        HricError: the friction file cannot be used.
    """
    chosen = arguments.friction or source.friction
    if chosen == "none":
        return None, [], "none"
    if chosen != "identified":
        path = Path(chosen).expanduser()
        if not path.is_file():
            raise LogError(
                f"--friction {chosen}: no such file; valid: {', '.join(FRICTIONS)}, or a YAML file as --fit friction "
                "writes it"
            )
        parameters, joints, name = read_parameters(path), JOINTS, f"of {path.name}"
    elif arguments.friction is None and source.simulated:
        parameters, joints = source.simulated, source.log.joint_names
        name = "identified, as it acted in the simulation"
    else:
        return published(), [], "identified (published values)"
    return sigmoid_parameters(parameters, joints), breakaways(parameters, joints), name
