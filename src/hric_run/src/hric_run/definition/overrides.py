"""Overrides on the command line, `key:=value`: a shortcut, or the dotted path of a key of the experiment file."""

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
    "gravity": ("parameters.{controller}.gravity", "true: the controller adds g(q)"),
    "rotatum_limit": (
        "parameters.{controller}.rotatum_limit",
        "largest rate of torque of the controller, 0 = off [N m/s]",
    ),
    "profile": (
        "parameters.{controller}.profile.enabled",
        "lead the setpoint through a trapezoid (true) or take it raw (false)",
    ),
    "mode": ("parameters.{controller}.mode", "mode of a marker-following controller: retarget or thesis"),
    "duration": ("duration", "robot time [s]"),
    "hw": ("robot.hw", "plugin type of the robot, e.g. franka_sim/FrankaHWSim"),
    "arm_id": ("robot.arm_id", "prefix of joints and links"),
    "urdf": ("robot.urdf", "path or package:// address of another robot's URDF or xacro"),
    "q_start": ("robot.q_start", "start position [rad]"),
    "hand": ("robot.description.hand", "with or without the hand"),
    "inertials": ("robot.description.inertials", "barycentric or thesis"),
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
    "limits": ("robot.parameters.enforce_limits", "true, false, or a list of kinds"),
}
"""Short names of the keys that are changed most; {controller} is the controller of the first setpoint."""

SENSORS = {
    "mocap": "motion capture",
    **experiment.SENSORS,
    **experiment.ADDED,
    "sync": "synchroniser",
    "human": "human",
    "person": "real person in front of the cameras",
    "supervisor": "supervisor of the collaboration",
}
"""Groups that an experiment has or has not. The bring-up alone may add a sensor, by its `device`."""
ADDED_BY = {"supervisor": ["mode"]}
"""Keys that add such a group to an experiment: the mode adds a supervisor, the device a sensor."""
DOTTED = (
    "parameters.<controller>.<name>, robot.<key>, metrics.<key>, "
    + "".join(f"{group}.<key>, " for group in SENSORS)
    + "setpoints.<i>.<key>"
)
GROUPS = {"robot": RobotSpec, "metrics": MetricsSpec}
VALUES = ("controllers", "description", "duration", "setpoints")
PLANT_FRICTION = ["robot", "plant", "friction"]
FRICTIONS = ("none", "coulomb", "identified")


def help_text() -> str:
    """Return the table of the shortcuts for --help."""
    width = max(len(name) for name in SHORTCUTS)
    return "\n".join(f"  {name:<{width}}  {text}" for name, (_, text) in SHORTCUTS.items())


def apply(raw: NodeParameters, overrides: Iterable[str]) -> dict[str, Any]:
    """Return the contents of an experiment file with overrides applied.

    Another robot's URDF replaces the file's `robot.description`, in whatever order the overrides are.

    Args:
        raw: contents of the file.
        overrides: `key:=value`; the value is YAML.

    Raises:
        ExperimentError: an override has another form, an unknown key (the message has the valid ones), or a key without
            effect because of another one.
    """
    result: dict[str, Any] = copy.deepcopy(dict(raw))
    keys: dict[tuple[str, ...], str] = {}
    for text in sorted(overrides, key=lambda text: text.partition(":=")[0] not in ("urdf", "robot.urdf")):
        key, value = split(text)
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


def once(words: tuple[str, ...]) -> tuple[str, ...]:
    """Return overrides unchanged. Raises ParameterError if a key is set twice: the first has no effect."""
    keys = [word.partition(":=")[0] for word in words]
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ParameterError(f"{', '.join(twice)} is given more than once; valid: each key once")
    return words


def _note(keys: dict[tuple[str, ...], str], key: str, path: Sequence[str]) -> None:
    """Remember which key set a path; refuse it if it makes another key void."""
    for earlier, other in keys.items():
        if other != key and list(earlier[: len(path)]) == list(path):
            raise ExperimentError(f"{other} has no effect beside {key}: both set {'.'.join(path)}; valid: one of them")
    keys[tuple(path)] = key


def _friction(raw: dict[str, Any], value: Any, text: str) -> str:
    """Set the friction of the plant and return that of the URDF, whose Coulomb values are among the identified."""
    if isinstance(value, str) and value.endswith((".yaml", ".yml")):
        _assign(raw, ["robot", "plant", "friction_parameters"], read_parameters(Path(value).expanduser()), text)
        value = "identified"
    if value not in FRICTIONS:
        raise ExperimentError(
            f"cannot apply {text!r}; valid: {', '.join(FRICTIONS)}, or a YAML file with the friction of each joint"
        )
    _assign(raw, PLANT_FRICTION, value, text)
    return value if raw["robot"].get("urdf") or value == "none" else "identified"


def separate(text: str) -> list[str]:
    """Return the overrides in a text, separated by spaces; a value with spaces is in quotes, as in a shell.

    Raises:
        ExperimentError: a quote is not closed.
    """
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ExperimentError(f"cannot read the overrides {text!r}: {error}") from error


def split(text: str) -> tuple[str, Any]:
    """Return (key, value) of `key:=value`."""
    key, separator, value = text.partition(":=")
    if not separator or not key:
        raise ExperimentError(f"cannot read override {text!r}; write key:=value, for example kp:=200")
    try:
        return key, yaml_text.parse(value, f"the value of {key} in {text!r}") if value else ""
    except ParameterError as error:
        raise ExperimentError(str(error)) from None


def in_yaml(value: Any) -> str:
    """Return a value on one line, as in an override."""
    plain = np.asarray(value).tolist() if isinstance(value, np.ndarray | np.generic | tuple) else value
    return str(yaml.safe_dump(plain, default_flow_style=True, width=float("inf"))).removesuffix("...\n").strip()


def resolve(key: str, raw: NodeParameters) -> list[str]:
    """Return the path in the experiment file that a key means.

    Raises:
        ExperimentError: the key is unknown.
    """
    short = key in SHORTCUTS
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
    """Return the keys of a group of an experiment file; empty: it is no group."""
    if group == "parameters":
        return list(raw.get("controllers") or [])
    if group in SENSORS:
        from hric_run.definition.sections import section_of  # imported only for these overrides

        return sorted(declared(section_of(group)))
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
                    f"cannot apply {text!r}: {above} is a list of {len(target)}; valid: an index from 0"
                )
            key: Any = int(part)
        elif isinstance(target, dict):
            key = part
        else:
            raise ExperimentError(f"cannot apply {text!r}: {above} is a value, not a group")
        if depth == len(path) - 1:
            target[key] = value
        elif isinstance(target, dict) and target.get(key) is None:
            target[key] = {}
        target = target[key]
