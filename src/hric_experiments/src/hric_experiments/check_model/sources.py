"""What a check compares: the log, the model of the arm that made it, and its friction, by the arguments of the command
and the run."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import panda_description
from franka_hw_interface.arm_log import ArmLog, LogError
from franka_hw_interface.friction_file import JOINTS, read_parameters
from franka_hw_interface.kdl_model import KdlFrankaModel
from hric_control.plants import Phi, breakaways, sigmoid_parameters
from hric_core.resources import read_description
from hric_core.urdf import read
from hric_experiments.check_model import csv_log

FRICTIONS = ("none", "identified")
PANDA = "panda"
CLEARLY = 0.7
"""Share of the residual that the other model has at most, to be the right one (project default, unconfirmed)."""


@dataclass(frozen=True)
class Source:
    """A log and what is known of it.

    Attributes:
        log: the log.
        name: of the file or run.
        folder: where results go by default.
        urdf: of the robot that ran; empty: not known.
        friction: that acted, of a simulated run; "identified" of anything else.
        simulated: values of that friction; None: none, or the published ones.
    """

    log: ArmLog
    name: str
    folder: Path
    urdf: str = ""
    friction: str = "identified"
    simulated: Any = None


def find(given: argparse.Namespace) -> Source:
    """The log that is meant: a CSV file, a bag, a run folder or its name.

    Raises:
        HricError: it is not there, or holds no such log.
    """
    path = Path(given.run).expanduser()
    if path.suffix in (".bag", ".active") or path.is_dir() or not (path.is_file() or path.suffix):
        if given.columns:
            raise LogError("--columns names the columns of a CSV file; of a bag: --topic and --arm-id")
        return _from_bag(given)
    if given.topic:
        raise LogError("--topic is for bags; of a CSV file: --columns")
    names = [f"{given.arm_id or PANDA}_{joint}" for joint in JOINTS]
    log = csv_log.read_csv(path, names, csv_log.parse_columns(given.columns))
    return Source(log, path.name, path.with_name(f"{path.stem}_check_model"))


def _from_bag(given: argparse.Namespace) -> Source:
    from hric_bags.export import recording
    from hric_experiments.check_model import bag_log

    found = recording.find(given.run, given.runs)
    log, topic = bag_log.read_bag(found, given.topic, given.arm_id)
    if found.folder is None:
        return Source(log, f"{found.bag.name}, {topic}", found.bag.with_name(f"{found.bag.stem}_check_model"))
    name, output = f"{found.folder.path.name}, {topic}", found.folder.path / "check_model"
    robot = (found.run.get("parameters") or {}).get("robot") or {}
    if not robot or str(robot.get("robot_hw", "")).startswith("franka_real"):
        return Source(log, name, output, found.urdf)
    plant = robot.get("plant") or {}
    acted = plant.get("friction", "none")
    return Source(
        log, name, output, found.urdf, acted if acted in FRICTIONS else "none", plant.get("friction_parameters")
    )


def model(given: argparse.Namespace, source: Source) -> tuple[KdlFrankaModel, str, str]:
    """The model with its payload, its description, and what to call it.

    Raises:
        HricError: a description or a payload that cannot be used.
    """
    arm_id = source.log.joint_names[0].removesuffix("joint1").rstrip("_")
    text, name, gravity_base = _description(given, source, arm_id)
    made = (
        KdlFrankaModel(text, arm_id)
        if gravity_base is None
        else KdlFrankaModel(text, arm_id, gravity_world=gravity_base)
    )
    return made, text, name + _loaded(made, given.load)


def _description(given: argparse.Namespace, source: Source, arm_id: str) -> tuple[str, str, Sequence[float] | None]:
    """URDF, what to call it, and gravity in the base where the URDF does not have its mounting [m/s^2]."""
    own = given.inertials is not None or given.hand is not None
    if given.urdf is not None:
        if own:
            raise LogError("--urdf brings its own inertials and hand; valid: without --inertials, --hand and --no-hand")
        return read_description(given.urdf), given.urdf.name, None
    if source.urdf and not own:
        return source.urdf, "robot.urdf of the run", None
    hand = _has_hand(source, arm_id) if given.hand is None else given.hand
    name = given.inertials or "barycentric"
    text = panda_description.load(arm_id=arm_id, hand=hand, inertials=name, meshes=False, collision=False)
    mounted = KdlFrankaModel(source.urdf, arm_id).gravity_base.tolist() if source.urdf else None
    return text, f"inertials {name}, {'with' if hand else 'without'} hand", mounted


def _has_hand(source: Source, arm_id: str) -> bool:
    """Return True if the run's robot has the hand, or nothing is known of the robot."""
    return not source.urdf or f'"{arm_id}_hand"' in source.urdf


@dataclass(frozen=True)
class HandTrial:
    """Outcome of a trial of the model with and without the hand.

    Attributes:
        given: arguments of the model to take.
        lines: what to say of it.
    """

    given: argparse.Namespace
    lines: tuple[str, ...] = ()


def try_hand(given: argparse.Namespace, source: Source, coarse_rms: Callable[[KdlFrankaModel], float]) -> HandTrial:
    """Try the model with and without the hand where the arguments do not say which: take the one that fits a log of an
    unknown arm, and warn where the other one fits better than the run's robot.

    Args:
        coarse_rms: gives the residual of a model [N m].
    """
    if given.hand is not None or given.urdf is not None:
        return HandTrial(given)
    with_hand = _has_hand(source, source.log.joint_names[0].removesuffix("joint1").rstrip("_"))
    other = argparse.Namespace(**{**vars(given), "hand": not with_hand})
    own_rms, other_rms = (coarse_rms(model(arguments, source)[0]) for arguments in (given, other))
    better = other_rms < CLEARLY * own_rms
    names = ("with the hand", "without a hand") if with_hand else ("without a hand", "with the hand")
    sums = f"the residual's sum is {own_rms:.3g} N m {names[0]}, {other_rms:.3g} {names[1]}"
    if source.urdf:
        option = "--no-hand" if with_hand else "--hand"
        return HandTrial(given, (f"WARNING: {sums}: try {option}, or hand:= of the run was wrong",) if better else ())
    return HandTrial(other if better else given, (f"hand not given (--hand, --no-hand): {sums}",))


def _loaded(made: KdlFrankaModel, load: Sequence[float] | None) -> str:
    """Give the model its payload. Returns its description."""
    if load is None:
        return ""
    if len(load) not in (4, 10):
        raise LogError(f"--load has {len(load)} values; valid: 4 (mass x y z) or 10 (and ixx ixy ixz iyy iyz izz)")
    mass, com, (xx, xy, xz, yy, yz, zz) = load[0], load[1:4], load[4:] or (0.0,) * 6
    made.set_load(mass, com, (xx, xy, xz, xy, yy, yz, xz, yz, zz))
    return f", load {mass:g} kg at {' '.join(f'{value:g}' for value in com)} m"


def ranges(text: str, joint_names: Sequence[str]) -> tuple[list[float], list[float]]:
    """Lower and upper end of each joint's range [rad]; text: the description."""
    described = read(text).joints
    joints = [described[name] for name in joint_names]
    return [joint.lower for joint in joints], [joint.upper for joint in joints]


def published() -> list[Phi]:
    """phi1 [N m], phi2 [s/rad], phi3 [rad/s] of joints 1 to 7 of the Panda, as they were published."""
    values = panda_description.friction_parameters(PANDA)
    return sigmoid_parameters(values, list(values))


def friction(given: argparse.Namespace, source: Source) -> tuple[list[Phi] | None, list[float], str]:
    """Sigmoid of each joint (None: none), its breakaway [N m], and what to call this friction.

    Raises:
        HricError: a file that cannot be used.
    """
    chosen = given.friction or source.friction
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
    elif given.friction is None and source.simulated:
        parameters, joints = source.simulated, source.log.joint_names
        name = "identified, as it acted in the simulation"
    else:
        return published(), [], "identified (published values)"
    return sigmoid_parameters(parameters, joints), breakaways(parameters, joints), name
