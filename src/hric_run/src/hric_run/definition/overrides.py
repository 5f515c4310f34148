"""Overrides of an experiment on the command line, `key:=value`.

The key is a shortcut such as `kp`, or the dotted path of a key in the experiment file."""

import copy
import shlex
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from franka_hw_interface.friction_file import read_parameters
from hric_bags.run_file import NodeParameters
from hric_core import plugins, yaml_text
from hric_core.errors import ParameterError
from hric_core.parameters import declared
from hric_run.definition import experiment
from hric_run.definition.experiment import ExperimentError, MetricsSpec, RobotSpec

SHORTCUTS: dict[str, tuple[str, str]] = {
    "kp": ("parameters.{controller}.kp", "proportional gain, number or list [N m/rad]"),
    "kd": ("parameters.{controller}.kd", "derivative gain, number or list [N m s/rad]"),
    "gravity": ("parameters.{controller}.gravity", "true: the controller adds the gravity torques g(q)"),
    "rotatum_limit": (
        "parameters.{controller}.rotatum_limit",
        "largest rate of torque of the controller, 0 = off [N m/s]",
    ),
    "profile": (
        "parameters.{controller}.profile.enabled",
        "true: trapezoidal velocity profile for setpoints; false: setpoints act at once",
    ),
    "mode": ("parameters.{controller}.mode", "mode of a marker-following controller: retarget or thesis"),
    "duration": ("duration", "robot time of the complete run [s]"),
    "hw": ("robot.hw", "plugin type of the robot, e.g. franka_sim/FrankaHWSim"),
    "arm_id": ("robot.arm_id", "prefix of the names of joints and links"),
    "urdf": ("robot.urdf", "path or package:// address of another robot's URDF or xacro"),
    "q_start": ("robot.q_start", "joint positions at the start [rad]"),
    "hand": ("robot.description.hand", "true: the arm has the Franka hand; false: it has none"),
    "inertials": ("robot.description.inertials", "masses and inertias of the links: barycentric, fr3 or thesis"),
    "damping": ("robot.description.damping", "viscous joint damping [N m s/rad]"),
    "friction": (
        "robot.description.friction",
        "none, coulomb, identified, or a YAML file as check_model --fit friction writes it",
    ),
    "realism": (
        "robot.parameters.realism",
        "realism of the simulated Franka: ideal, measured, or {preset: measured, dq_noise: 0, ...}",
    ),
    "simulator": ("robot.plant_type", "engine (pybullet, mujoco, ...) or the plugin type of a plant"),
    "rotor_inertia": ("robot.plant.rotor_inertia", "rotor inertia seen at the joint, number or list [kg m^2]"),
    "world": ("robot.plant.world", "world file, path or package:// address"),
    "noise": ("mocap.stream.noise", "motion capture noise, standard deviation per axis [m]"),
    "gui": ("robot.plant.gui", "show the engine's window"),
    "limits": ("robot.parameters.enforce_limits", "enforced joint limits: true, false, or a list of kinds"),
}
"""Short names of frequently changed keys: (dotted path, help text).

{controller} is the controller of the first setpoint."""

SENSORS = {
    "mocap": "motion capture",
    **experiment.SENSORS,
    **experiment.ADDED,
    "sync": "synchroniser",
    "human": "human",
    "person": "real person in front of the cameras",
    "supervisor": "supervisor of the collaboration",
}
"""Optional sections of an experiment, with their names for users.

An override can add a sensor to an experiment by the key `device`, which only the bring-up uses."""
ADDED_BY = {"supervisor": ["mode"]}
"""Keys by which an override adds a section to an experiment: `supervisor.mode`; `device` for all sensors."""
DOTTED = (
    "parameters.<controller>.<name>, robot.<key>, arms.<arm>.<key>, metrics.<key>, "
    + "".join(f"{group}.<key>, " for group in SENSORS)
    + "setpoints.<i>.<key>"
)
GROUPS = {"robot": RobotSpec, "metrics": MetricsSpec}
VALUES = ("controllers", "description", "duration", "setpoints")
ARMS = "arms"
ARMS_TEXT = "several arms in place of the robot, for example left,right; each with the controllers of the experiment"
SPACING = 1.0
"""Distance of the bases of two arms that replace one robot [m] (project default, unconfirmed)."""
PLANT_FRICTION = ["robot", "plant", "friction"]
FRICTIONS = ("none", "coulomb", "identified")


def help_text() -> str:
    """Return the table of shortcuts for --help: name and description, one per line."""
    texts = {name: text for name, (_, text) in SHORTCUTS.items()} | {ARMS: ARMS_TEXT}
    width = max(map(len, texts))
    return "\n".join(f"  {name:<{width}}  {text}" for name, text in texts.items())


def apply(raw: NodeParameters, overrides: Iterable[str]) -> dict[str, Any]:
    """Return the contents of an experiment file with overrides applied.

    Another robot's URDF removes the file's `robot.description`, whatever the order of the overrides.

    Args:
        raw: contents of the file.
        overrides: texts `key:=value`; the value is YAML.

    Raises:
        ExperimentError: an override does not have this form, its key is unknown (the message lists the valid ones), or
            it has no effect because of another one.
    """
    result: dict[str, Any] = copy.deepcopy(dict(raw))
    keys: dict[tuple[str, ...], str] = {}
    for text in sorted(overrides, key=_order):
        key, value = split(text)
        if key == ARMS:
            _divide(result, value, text)
            continue
        path = resolve(key, result)
        if key == "friction":
            value = _friction(result, value, text)
            _note(keys, key, PLANT_FRICTION)
            path = PLANT_FRICTION if result["robot"].get("urdf") else path
        _note(keys, key, path)
        _assign(result, path, value, text)
        if path == ["robot", "urdf"] and value:
            result["robot"].pop("description", None)
    return result


def _order(text: str) -> int:
    """Return the rank of an override: another robot first; the arms after what they have in common."""
    key = text.partition(":=")[0]
    return 0 if key in ("urdf", "robot.urdf") else 3 if key.startswith(f"{ARMS}.") else 2 if key == ARMS else 1


def _divide(raw: dict[str, Any], value: Any, text: str) -> None:
    """Replace the robot of an experiment by several arms, each with its controllers, parameters and setpoints.

    The arms stand next to each other along y, `SPACING` apart and centred at the place of the robot.
    """
    names = [name.strip() for name in value.split(",")] if isinstance(value, str) else list(value or [])
    if raw.get(ARMS):
        raise ExperimentError(f"no override {text!r}: this experiment has the arms {', '.join(raw[ARMS])} already")
    if len(set(names)) != len(names) or len(names) < 2 or not all(isinstance(name, str) and name for name in names):
        raise ExperimentError(f"cannot apply override {text!r}; valid: different names, for example arms:=left,right")
    if raw["robot"].get("urdf"):
        raise ExperimentError(
            f"no override {text!r}: several arms cannot use one robot.urdf, as their poses and names would be "
            "the same; valid: a file with the section arms, and a robot.urdf for each arm"
        )
    base = raw["robot"].get("description", {}).get("xyz") or "0 0 0"
    x, y, z = map(float, base.split() if isinstance(base, str) else base)
    own = {key: raw.pop(key) for key in ("controllers", "parameters", "setpoints") if key in raw}
    raw[ARMS] = {
        name: {
            "robot": {"description": {"xyz": [x, y + SPACING * (0.5 * (len(names) - 1) - i), z]}},
            **copy.deepcopy(own),
        }
        for i, name in enumerate(names)
    }
    raw["controllers"] = ["joint_state_controller"]


def once(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return the overrides unchanged. Raises ParameterError if a key is set twice: the first would have no effect."""
    keys = [word.partition(":=")[0] for word in words]
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ParameterError(f"{', '.join(twice)} is given more than once; valid: each key once")
    return words


def _note(keys: dict[tuple[str, ...], str], key: str, path: Sequence[str]) -> None:
    """Record which key has set a path; raise ExperimentError if another key has set this path or a part of it."""
    for earlier, other in keys.items():
        if other != key and list(earlier[: len(path)]) == list(path):
            raise ExperimentError(f"{other} has no effect with {key}: both set {'.'.join(path)}; valid: one of them")
    keys[tuple(path)] = key


def _friction(raw: dict[str, Any], value: Any, text: str) -> str:
    """Set the plant's friction parameters and return the value for `robot.description.friction`.

    The description has Coulomb friction only with "identified", so this value is also used for "coulomb"."""
    if isinstance(value, str) and value.endswith((".yaml", ".yml")):
        _assign(raw, ["robot", "plant", "friction_parameters"], read_parameters(Path(value).expanduser()), text)
        value = "identified"
    if value not in FRICTIONS:
        raise ExperimentError(
            f"cannot apply override {text!r}; valid: {', '.join(FRICTIONS)}, or a YAML file with each joint's friction"
        )
    _assign(raw, PLANT_FRICTION, value, text)
    return value if raw["robot"].get("urdf") or value == "none" else "identified"


def separate(text: str) -> list[str]:
    """Split a text into overrides, which are separated by spaces; values with spaces are quoted, as in a shell.

    Raises:
        ExperimentError: a quotation mark is not closed.
    """
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ExperimentError(f"cannot read the overrides {text!r}: {error}") from error


def split(text: str) -> tuple[str, Any]:
    """Return (key, value) of an override `key:=value`, with the value parsed as YAML. Raises ExperimentError."""
    key, separator, value = text.partition(":=")
    if not separator or not key:
        raise ExperimentError(f"cannot read override {text!r}; write key:=value, for example kp:=200")
    try:
        return key, yaml_text.parse(value, f"the value of {key} in {text!r}") if value else ""
    except ParameterError as error:
        raise ExperimentError(str(error)) from None


def in_yaml(value: Any) -> str:
    """Return a value as YAML on one line, as in an override."""
    plain = np.asarray(value).tolist() if isinstance(value, np.ndarray | np.generic | tuple) else value
    return str(yaml.safe_dump(plain, default_flow_style=True, width=float("inf"))).removesuffix("...\n").strip()


def resolve(key: str, raw: NodeParameters) -> list[str]:
    """Return the path in the experiment file, as a list of keys, for the key of an override.

    Raises:
        ExperimentError: the key is unknown; the message lists valid ones.
    """
    short = key in SHORTCUTS
    if short and raw.get(ARMS) and SHORTCUTS[key][0].startswith("parameters."):
        arm = next(iter(raw[ARMS]))
        raise ExperimentError(
            f"no override {key!r}: this experiment has several arms; valid: for example "
            f"arms.{arm}.parameters.CONTROLLER.{key}"
        )
    path = (SHORTCUTS[key][0].format(controller=_controller(raw)) if short else key).split(".")
    if path[0] in SENSORS and not raw.get(path[0]) and path[1:] != ADDED_BY.get(path[0], ["device"]):
        raise ExperimentError(f"no override {key!r}: this experiment has no {SENSORS[path[0]]}")
    if short:
        return path
    valid = _keys(path[0], raw)
    if valid and len(path) >= 2 and all(path):
        if path[1] not in valid:
            raise ExperimentError(f"no override {key!r}: {path[1]!r} is not one of {', '.join(valid)}")
        return path
    indices = [str(index) for index in range(len(raw.get("setpoints") or []))]
    if key in VALUES or (path[0] == "setpoints" and len(path) == 3 and path[1] in indices):
        return path
    close = get_close_matches(key, SHORTCUTS, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    raise ExperimentError(
        f"no override {key!r}{hint}; valid: {', '.join(sorted(SHORTCUTS))}, or a path in the experiment file: {DOTTED}"
    )


def _keys(group: str, raw: NodeParameters) -> list[str]:
    """Return the valid keys in a section of an experiment file; empty if `group` is not a section."""
    if group == "parameters":
        return list(raw.get("controllers") or [])
    if group in SENSORS:
        from hric_run.definition.sections import section_of  # imported only for these overrides

        return sorted(declared(section_of(group)))
    if group == ARMS:
        return list(raw.get(ARMS) or {})
    return sorted(declared(GROUPS[group])) if group in GROUPS else []


def _controller(raw: NodeParameters) -> str:
    setpoints = raw.get("setpoints") or []
    if setpoints and isinstance(setpoints[0], Mapping) and "controller" in setpoints[0]:
        return str(setpoints[0]["controller"])
    controllers = raw.get("controllers") or [""]
    return str(controllers[-1])


def _assign(raw: dict[str, object], path: list[str], value: Any, text: str) -> None:
    if path == ["robot", "plant_type"] and (engine := plugins.engines().get(str(value))):
        value = engine.name
    target: Any = raw
    for depth, part in enumerate(path):
        above = ".".join(path[:depth])
        if isinstance(target, list):
            if not part.isdigit() or int(part) >= len(target):
                raise ExperimentError(
                    f"cannot apply override {text!r}: {above} is a list of {len(target)}; valid: an index from 0"
                )
            key: Any = int(part)
        elif isinstance(target, dict):
            key = part
        else:
            raise ExperimentError(f"cannot apply override {text!r}: {above} is a value, not a group of keys")
        if depth == len(path) - 1:
            target[key] = value
        elif isinstance(target, dict) and target.get(key) is None:
            target[key] = {}
        target = target[key]
