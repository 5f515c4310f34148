"""Experiment files: what robot, which controllers, which set points, how long; the same file serves live and headless runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import yaml

from hric_control.errors import HricError, UnknownNameError
from hric_experiments import config
from hric_experiments.checks import angle, fields, mapping, names_list, number, strings_of
from hric_experiments.mocap_spec import MocapSpec
from hric_experiments.sensor_spec import SensorSpec, SyncSpec
from mocap_natnet.trial import located


class ExperimentError(HricError):
    """An experiment file or an override that cannot be used; the message gives the file, the key and what would be valid."""


@dataclass(frozen=True)
class SetPoint:
    """A joint set point sent during the run.

    Attributes:
        time: run time at which it is sent, from the start of the controllers [s].
        controller: instance name of the controller; sent on its `command` topic.
        positions: one per joint of the controller [rad].
    """

    time: float
    controller: str
    positions: tuple[float, ...]


@dataclass(frozen=True)
class RobotSpec:
    """The robot of an experiment.

    Attributes:
        hw: plugin type of the RobotHW, e.g. "franka_sim/FrankaHWSim".
        arm_id: prefix of joints and links.
        description: arguments of `panda_description.load`.
        urdf: path or package:// address of another robot's URDF or xacro; empty: the Panda.
        q_start: start position, list in joint order or joint -> value; None: the robot's own default [rad].
        plant_type: plugin type of the plant; empty: the robot's default.
        plant: parameters of the plant.
        parameters: further private parameters of the RobotHW.
    """

    hw: str
    arm_id: str = "panda"
    description: Mapping[str, Any] = field(default_factory=dict)
    urdf: str = ""
    q_start: tuple[float, ...] | Mapping[str, float] | None = None
    plant_type: str = ""
    plant: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class MetricsSpec:
    """How a run is judged.

    Attributes:
        tolerances: bands for the settling time [rad].
        reference: name of a set-up in config/references that the report compares with; empty: none.
    """

    tolerances: tuple[float, ...] = (1e-2, 1e-3)
    reference: str = ""


@dataclass(frozen=True)
class Experiment:
    """One experiment, checked.

    Attributes:
        name: name of the file without its ending.
        description: one line for people.
        robot: the robot.
        controllers: instance names, started in this order.
        parameters: parameters that overlay the controllers' YAML, by instance name.
        setpoints: in order of time.
        duration: run time of the whole run [s].
        metrics: how it is judged.
        mocap: the motion capture and who moves before it; None: none.
        emg, force_plate: sensors beside the robot; None: none.
        sync: what brings all sources to common instants; None: nothing.
    """

    name: str
    description: str
    robot: RobotSpec
    controllers: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Any]]
    setpoints: tuple[SetPoint, ...]
    duration: float
    metrics: MetricsSpec
    mocap: MocapSpec | None = None
    emg: SensorSpec | None = None
    force_plate: SensorSpec | None = None
    sync: SyncSpec | None = None


NONE = "none"
"""Name of the run that is no experiment: what the bring-up starts by itself."""
SENSOR_SECTIONS = ("mocap", "emg", "force_plate", "sync")
"""Sections of what runs beside the robot; an experiment has those that it names."""
EXPERIMENT_KEYS = tuple(sorted(("controllers", "description", "duration", "metrics", "parameters", "robot", "setpoints", *SENSOR_SECTIONS)))
ROBOT_KEYS = ("arm_id", "description", "hw", "parameters", "plant", "plant_type", "q_start", "urdf")
SETPOINT_KEYS = ("controller", "positions", "time")
METRICS_KEYS = ("reference", "tolerances")


def names() -> list[str]:
    """Names of the experiments that come with the workspace."""
    return sorted(path.stem for path in config.experiments_path().glob("*.yaml"))


def find(name: str) -> Path:
    """File of an experiment, by name or by the path of a YAML file; "none" is the bring-up without an experiment.

    Raises:
        UnknownNameError: neither; lists the names.
    """
    if name == NONE:
        return config.package_path() / "config" / "bringup.yaml"
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser()
        if path.is_file():
            return path
        raise ExperimentError(f"no experiment file {name}; experiments by name: {', '.join(names())}")
    if name not in names():
        raise UnknownNameError("experiment", name, names(), str(config.experiments_path().name))
    return config.experiments_path() / f"{name}.yaml"


def read(name: str) -> dict[str, Any]:
    """Contents of an experiment file, not checked yet; recorded trials are looked for beside it.

    Raises:
        HricError: no such experiment, or it is not YAML.
    """
    path = find(name)
    try:
        raw = yaml.safe_load(path.read_text())
    except yaml.YAMLError as error:
        raise ExperimentError(f"{path.name} is not valid YAML: {error}") from error
    if not isinstance(raw, dict):
        raise ExperimentError(f"{path.name} must be a mapping with the keys {', '.join(EXPERIMENT_KEYS)}")
    return dict(located(raw, path.parent))


def parse(name: str, raw: Mapping[str, Any]) -> Experiment:
    """Check the contents of an experiment file.

    Args:
        name: used in messages and for the run folder.
        raw: the contents.

    Raises:
        ExperimentError: an unknown or missing key, a wrong type, or a value out of range.
    """
    try:
        fields(raw, EXPERIMENT_KEYS, ("robot", "controllers", "duration"), "")
        controllers = names_list(raw["controllers"], "controllers")
        experiment = Experiment(
            name=name,
            description=str(raw.get("description", "")),
            robot=_robot(mapping(raw["robot"], "robot")),
            controllers=controllers,
            parameters={key: mapping(value, f"parameters.{key}") for key, value in mapping(raw.get("parameters"), "parameters").items()},
            setpoints=_setpoints(raw.get("setpoints") or []),
            duration=number(raw["duration"], "duration", minimum=0.0, exclusive=True),
            metrics=_metrics(mapping(raw.get("metrics"), "metrics")),
            **_beside_the_robot({key: raw[key] for key in SENSOR_SECTIONS if raw.get(key) is not None}),
        )
        _check_together(experiment)
    except (ValueError, HricError) as error:
        raise ExperimentError(f"experiment {name}: {error}") from error
    return experiment


def _beside_the_robot(given: Mapping[str, Any]) -> dict[str, Any]:
    """The sections of SENSOR_SECTIONS that there are, read."""
    if not given:
        return {}  # without loading what reads them: a bring-up reads its experiment once for each set of parameters, and its user waits
    from hric_experiments.sensor_sections import READERS

    return {key: READERS[key](raw) for key, raw in given.items()}


def _robot(raw: Mapping[str, Any]) -> RobotSpec:
    fields(raw, ROBOT_KEYS, ("hw",), "robot")
    return RobotSpec(
        description=mapping(raw.get("description"), "robot.description"),
        q_start=_start(raw.get("q_start")),
        plant=mapping(raw.get("plant"), "robot.plant"),
        parameters=mapping(raw.get("parameters"), "robot.parameters"),
        **strings_of(raw, {"hw": "", "arm_id": "panda", "urdf": "", "plant_type": ""}, "robot"),
    )


def _start(raw: Any) -> tuple[float, ...] | dict[str, float] | None:
    if raw is None:
        return None
    if isinstance(raw, Mapping):
        return {str(joint): angle(value, f"robot.q_start.{joint}") for joint, value in raw.items()}
    return _angles(raw, "robot.q_start")


def _angles(raw: Any, where: str) -> tuple[float, ...]:
    if not isinstance(raw, Sequence) or isinstance(raw, str) or not raw:
        raise ValueError(f"{where} must be a list of angles [rad], such as [0, -pi/4, 0.5]; got {raw!r}")
    return tuple(angle(value, f"{where}[{i}]") for i, value in enumerate(raw))


def _setpoints(raw: Any) -> tuple[SetPoint, ...]:
    if not isinstance(raw, Sequence) or isinstance(raw, str):
        raise ValueError(f"setpoints must be a list of {{time, controller, positions}}; got {raw!r}")
    result = []
    for i, item in enumerate(raw):
        where = f"setpoints[{i}]"
        item = mapping(item, where)
        fields(item, SETPOINT_KEYS, SETPOINT_KEYS, where)
        time = number(item["time"], f"{where}.time", minimum=0.0)
        result.append(SetPoint(time, str(item["controller"]), _angles(item["positions"], f"{where}.positions")))
    return tuple(sorted(result, key=lambda setpoint: setpoint.time))


def _metrics(raw: Mapping[str, Any]) -> MetricsSpec:
    fields(raw, METRICS_KEYS, (), "metrics")
    default = MetricsSpec()
    tolerances = raw.get("tolerances", list(default.tolerances))
    if not isinstance(tolerances, Sequence) or isinstance(tolerances, str) or not tolerances:
        raise ValueError(f"metrics.tolerances must be a list of angles [rad]; got {tolerances!r}")
    values = tuple(number(value, f"metrics.tolerances[{i}]", minimum=0.0, exclusive=True) for i, value in enumerate(tolerances))
    reference = str(raw.get("reference") or "")
    known = sorted(path.stem for path in config.references_path().glob("*.yaml"))
    if reference and reference not in known:
        raise ValueError(f"metrics.reference: no reference {reference!r}; valid: {', '.join(known)}")
    return MetricsSpec(tuple(sorted(values, reverse=True)), reference)


def _check_together(experiment: Experiment) -> None:
    for i, setpoint in enumerate(experiment.setpoints):
        if setpoint.controller not in experiment.controllers:
            raise ValueError(f"setpoints[{i}].controller: {setpoint.controller!r} is not started; valid: {', '.join(experiment.controllers)}")
        if setpoint.time >= experiment.duration:
            raise ValueError(f"setpoints[{i}].time {setpoint.time} s is not before the end (duration {experiment.duration} s)")
    unknown = sorted(set(experiment.parameters) - set(experiment.controllers))
    if unknown:
        raise ValueError(f"parameters for {', '.join(unknown)}, which is not started; valid: {', '.join(experiment.controllers)}")


def load(name: str, given: Iterable[str] = ()) -> Experiment:
    """Read an experiment, apply overrides, check it.

    Args:
        name: name, or path of a YAML file.
        given: overrides, `key:=value`.

    Raises:
        HricError: no such experiment, or a mistake in it or in an override.
    """
    from hric_experiments import overrides

    return parse(Path(name).stem, overrides.apply(read(name), given))


def to_dict(experiment: Experiment) -> dict[str, Any]:
    """Plain data for run.yaml, in the form of an experiment file plus its name."""
    return asdict(experiment)
