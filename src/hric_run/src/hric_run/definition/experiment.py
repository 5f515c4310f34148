"""Experiment files: robot, controllers, setpoints, duration, and sensors.

The same file is used for live runs (nodes in ROS) and headless runs (one process without ROS)."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, make_dataclass, replace
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any, cast

from hric_bags.run_file import Definition, NodeParameters, with_own
from hric_control.plant import REPLACEMENT
from hric_core import plugins, resources
from hric_core.errors import HricError, ParameterError, ParameterErrors, UnknownNameError, message_about
from hric_core.geometry import ORIGIN, Vector
from hric_core.magnitudes import likely_unit
from hric_core.node import REQUIRED
from hric_core.parameters import (
    Mistakes,
    Parameter,
    Settings,
    as_number,
    declared,
    either,
    json_schema,
    listing,
    mapping,
    number,
    numbers,
    read_yaml,
    refused,
    section,
    text,
    unknown,
)
from hric_core.parameters import names as names_
from hric_core.trial.c3d import located

if TYPE_CHECKING:
    from hric_perception.section import SensorSection
    from hric_run.definition.sections import ExperimentSection, MocapSection, SyncSection


class ExperimentError(HricError):
    """Mistake in an experiment file or an override; the message names file, key and valid values."""


_ARM_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")
_PI = re.compile(
    r"\s*(?P<sign>[-+]?)\s*(?:(?P<factor>\d+(?:\.\d*)?)\s*\*\s*)?pi\s*(?:/\s*(?P<divisor>\d+(?:\.\d*)?))?\s*"
)


def _angle(value: Any, where: str, joints: Sequence[str]) -> float:
    match = _PI.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return as_number(value)
    if float(match["divisor"] or 1) == 0.0:
        raise ValueError
    angle = float(match["factor"] or 1) * math.pi / float(match["divisor"] or 1)
    return -angle if match["sign"] == "-" else angle


def _angle_shape() -> dict[str, object]:
    multiple_of_pi = "^" + re.sub(r"\?P<\w+>", "?:", _PI.pattern) + "$"  # group names differ between languages
    return {"anyOf": [{"type": "number"}, {"type": "string", "pattern": multiple_of_pi}]}


ANGLE = Parameter(
    "angle", "a finite number or a multiple of pi such as -3*pi/4", _angle, unit="rad", shape=_angle_shape
)
ANGLES: Any = listing(ANGLE, range(1, 100))


@dataclass(frozen=True)
class Setpoint(Settings):
    """Joint setpoint that is sent to a controller during the run."""

    time: float = number(
        minimum=0.0, unit="s", text="robot time at which the setpoint is sent, from the start of the controllers"
    )
    controller: str = text(empty=False, text="name of the controller; the setpoint is sent on its topic `command`")
    positions: tuple[float, ...] = listing(
        ANGLE, range(1, 100), text="joint positions, one per joint of the controller"
    )

    def check_reachable(self, joints: Sequence[str], limits: Mapping[str, Mapping[str, float]]) -> None:
        """Check a setpoint as the controller will check it, but before the run begins.

        Args:
            joints: names of the controller's joints.
            limits: position limits {"lower": ..., "upper": ...} [rad] by joint, for joints that have limits.

        Raises:
            ExperimentError: the setpoint has the wrong length, or is outside the range of a joint.
        """
        where = f"setpoint at {self.time:g} s for {self.controller}"
        if len(self.positions) != len(joints):
            raise ExperimentError(
                f"{where} has {len(self.positions)} positions; valid: {len(joints)}, for {', '.join(joints)}"
            )
        for joint, position in zip(joints, self.positions, strict=True):
            bounds = limits.get(joint, {})
            low, high = bounds.get("lower", -math.inf), bounds.get("upper", math.inf)
            if not low <= position <= high:
                likely = likely_unit(position, "rad", low, high)
                raise ExperimentError(f"{where}: {joint} {position:g} rad is outside {low:g} to {high:g}{likely}")


LARGEST_PAYLOAD = 50.0
"""Largest valid payload [kg], above that of any collaborative arm (project default, unconfirmed)."""


@dataclass(frozen=True)
class LoadSpec(Settings):
    """Payload that is configured in the robot by the service `franka_control/set_load`."""

    mass: float = number(
        0.0,
        minimum=0.0,
        maximum=LARGEST_PAYLOAD,
        unit="kg",
        text="mass of the payload set by `franka_control/set_load` before the controllers start; 0: no payload",
    )
    com: Vector = numbers(
        3, ORIGIN, minimum=-1.0, maximum=1.0, unit="m", text="centre of mass of the payload in the flange frame"
    )

    def check(self, where: str) -> None:
        """Refuse a centre of mass without a mass."""
        if self.mass == 0.0 and self.com != ORIGIN:
            raise ParameterError(f"{where}com has no effect without a mass; valid: with {where}mass above 0 [kg]")


OF_THE_BRINGUP = {
    "real_time_factor": "scripts/bringup real_time_factor:=FACTOR; a headless run is as fast as it can",
    "wait_for_log_listener": "scripts/bringup record:=true",
}
"""Parameters of the robot node that only the bring-up sets, as headless runs ignore them -> text on how to set them."""


@dataclass(frozen=True)
class RobotSpec(Settings):
    """Robot of an experiment: type, description, start pose, plant and payload."""

    separator = "."
    hw: str = text(empty=False, text='plugin type of the RobotHW, e.g. "franka_sim/FrankaHWSim"')
    arm_id: str = text(
        "panda", empty=False, text="name of the arm; of a Franka: prefix of the names of joints and links"
    )
    description: NodeParameters = mapping(default={}, text="arguments of `panda_description.load`")
    urdf: str = text("", text="path or package:// address of another robot's URDF or xacro; empty: the Panda")
    q_start: tuple[float, ...] | Mapping[str, float] | None = either(
        mapping(ANGLE), ANGLES, default=None, text="start position by joint, or in joint order; none: the robot's own"
    )
    plant_type: str = text(REPLACEMENT, text="plugin type of the plant; empty: the robot's default")
    plant: NodeParameters = mapping(default={}, text="parameters of the plant")
    parameters: NodeParameters = mapping(default={}, text="further private parameters of the RobotHW")
    load: LoadSpec = section(LoadSpec)

    def check(self, where: str) -> None:
        """Refuse keys that have no effect because of another key of the robot."""
        mistakes = Mistakes()
        set_elsewhere = {key: f"{where}{key}" for key in declared(RobotSpec)} | {
            "robot_hw": f"{where}hw",
            **OF_THE_BRINGUP,
        }
        for key in sorted(set_elsewhere.keys() & self.parameters.keys()):
            with mistakes.noted():
                raise ParameterError(f"{where}parameters.{key} has no effect; valid: {set_elsewhere[key]}")
        with mistakes.noted():
            # The bring-up always sets the pose of the base, so zeros are no mistake.
            unread = [key for key, value in self.description.items() if value not in ("0 0 0", list(ORIGIN))]
            if self.urdf and unread:
                raise ParameterError(
                    f"{where}description.{unread[0]} has no effect with {where}urdf, which is another robot's "
                    "description; valid: only one of the two"
                )
        with mistakes.noted():
            friction = self.plant.get("friction", self.description.get("friction", "none"))
            if "friction_parameters" in self.plant and friction == "none":
                where = f"{where}plant."
                raise ParameterError(
                    f"{where}friction_parameters has no effect; valid: with {where}friction: identified"
                )
        mistakes.raise_all()


@dataclass(frozen=True)
class MetricsSpec(Settings):
    """Settings for the evaluation of a run: tolerances of the settling time, and a reference to compare with."""

    tolerances: tuple[float, ...] = listing(
        number(above=0.0, maximum=0.5, unit="rad"),
        range(1, 100),
        (1e-2, 1e-3),
        made=lambda values: tuple(sorted(values, reverse=True)),
        unit="rad",
        text="error bands for which the settling time is computed, at most 0.5 rad each",
    )
    reference: str = text("", text="name of a file in config/references with results to compare with; empty: none")

    def check(self, where: str) -> None:
        """Refuse a reference that does not exist."""
        if self.reference and self.reference not in names("references"):
            raise unknown("reference", self.reference, names("references"), where.rstrip("."))


CONTROLLERS: Any = names_(text="names of the controllers, started in this order")
PARAMETERS: Any = mapping(
    mapping(), {}, text="parameters that override those of controllers.yaml, by name of the controller"
)
SETPOINTS: Any = listing(
    section(Setpoint),
    default=(),
    made=lambda values: tuple(sorted(values, key=lambda setpoint: setpoint.time)),
    text="joint setpoints sent during the run; sorted by time",
)


@dataclass(frozen=True)
class ArmSection(Settings):
    """One of several arms in one world: its robot, controllers and setpoints, in its own namespace."""

    separator = "."
    robot: NodeParameters = mapping(
        default={}, text="keys of `robot` that differ from those of the experiment; `arm_id` is the name of the arm"
    )
    controllers: tuple[str, ...] = CONTROLLERS
    parameters: Mapping[str, NodeParameters] = PARAMETERS
    setpoints: tuple[Setpoint, ...] = SETPOINTS


def _is_ros_value(value: object) -> bool:
    """Return True if ROS's parameter server can hold a value."""
    if isinstance(value, Mapping):
        return all(isinstance(key, str) and _is_ros_value(item) for key, item in value.items())
    if isinstance(value, list | tuple):
        return all(map(_is_ros_value, value))
    return -(2**31) <= value < 2**31 if isinstance(value, int) else isinstance(value, float | str)


def _optional(name: str) -> Any:
    """Return the parameter of an optional section, whose settings class is imported only if a file has the section.

    This saves time: the bring-up reads an experiment once for each set of parameters.
    """

    def convert(value: Any, where: str, joints: Sequence[str]) -> Any:
        from hric_run.definition.sections import section_of

        checked = section(section_of(name)).convert(value, where, joints)
        return dict(value or {}) if name in _UNPARSED else checked

    def shape() -> dict[str, object]:
        from hric_run.definition.sections import section_of

        return json_schema(section_of(name))

    text = f"section with the keys {name}.* below; none: the run is without this section"
    return Parameter("mapping", "a mapping", convert, None, text=text, shape=shape)


_OPTIONAL = {name: _optional(name) for name in ("mocap", "sync", "human", "person", "supervisor")}
_UNPARSED = ("human", "person", "supervisor")
"""Sections that are checked but stay mappings, as their nodes read them."""
SENSORS = {name: info.description for name, info in plugins.names(plugins.SENSOR).items()}
"""Sections of sensors that packages export as plugins: description by name of the section."""
ADDED = {name: info.description for name, info in plugins.names(plugins.SECTION).items()}
"""Other sections that packages export as plugins, for headless runs only: description by name of the section."""


@dataclass(frozen=True)
class _Motion(Settings):
    """Part of an experiment: robot, controllers, setpoints, duration and motion capture."""

    separator = "."
    name: str = ""
    description: str = text("", figures=True, text="description in one line")
    robot: RobotSpec = section(RobotSpec, REQUIRED)
    arms: Mapping[str, ArmSection] = mapping(
        section(ArmSection),
        {},
        text="two or more arms in one world, by name, each with the keys below; `robot` then has what they have in "
        "common, and `controllers` those of all arms together",
    )
    controllers: tuple[str, ...] = CONTROLLERS
    parameters: Mapping[str, NodeParameters] = PARAMETERS
    global_parameters: NodeParameters = mapping(
        default={},
        text="ROS parameters that controllers read outside their own namespaces, by name: absolute, or relative to "
        "the namespace of the robot",
    )
    setpoints: tuple[Setpoint, ...] = SETPOINTS
    duration: float = number(above=0.0, unit="s", text="robot time of the complete run")
    metrics: MetricsSpec = section(MetricsSpec)
    mocap: "MocapSection | None" = _OPTIONAL["mocap"]


if TYPE_CHECKING:
    _Sensed = _Motion
else:
    _fields = [(name, Any, _optional(name)) for name in (*SENSORS, *ADDED)]
    _Sensed = make_dataclass("_Sensed", _fields, bases=(_Motion,), frozen=True)


@dataclass(frozen=True)
class Experiment(_Sensed):
    """Checked content of an experiment file, with the sections of SENSORS and ADDED.

    `name` is the name of the file without its extension."""

    sync: "SyncSection | None" = _OPTIONAL["sync"]
    human: NodeParameters | None = _OPTIONAL["human"]
    person: NodeParameters | None = _OPTIONAL["person"]
    supervisor: NodeParameters | None = _OPTIONAL["supervisor"]

    def _check_global_parameters(self) -> None:
        """Refuse invalid names, and those of parameters that other keys of the experiment set."""
        taken = {*self._other_names(), *self.arms}
        for name in self.global_parameters:
            if not re.fullmatch(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", name):
                raise ParameterError(
                    f"global_parameters: {name!r} is no name of a ROS parameter; valid: such as /robot_ip"
                )
            if (first := name.strip("/").split("/")[0]) in taken:
                raise ParameterError(f"global_parameters.{name}: other keys of the experiment already set {first}")
            if not _is_ros_value(self.global_parameters[name]):
                valid = "numbers, integers of 32 bits, texts, true, false, and lists and mappings of them"
                raise refused(f"global_parameters.{name}", self.global_parameters[name], valid)

    def _other_names(self) -> list[str]:
        """Return the names of parameters in the namespace of the experiment other than those of arms."""
        return ["robot", "robot_description", "joint_limits", "use_sim_time", *self.controllers]

    def each_arm(self) -> "dict[str, Experiment]":
        """Return the part of the experiment that concerns one arm, by name of the arm; empty unless there are `arms`.

        Such a part is an experiment with this robot alone: without surroundings, sensors and person.

        Raises:
            HricError: a key of an arm's robot is invalid.
        """
        return {name: self._arm(name) for name in self.arms}

    def _arm(self, name: str) -> "Experiment":
        arm, common = self.arms[name], {**asdict(self.robot), "arm_id": name}
        robot = RobotSpec.of(with_own(common, arm.robot), f"arms.{name}.robot")
        part: dict[str, Any] = {key: getattr(arm, key) for key in ("controllers", "parameters", "setpoints")}
        left_out: dict[str, Any] = dict.fromkeys((*_OPTIONAL, *SENSORS, *ADDED))
        return replace(self, arms={}, robot=robot, **part, **left_out)

    def robots(self) -> "dict[str, Experiment]":
        """Return the experiment and the part of each arm, by the namespace of their controllers: "" and "left/"."""
        return {"": self} | {f"{name}/": part for name, part in self.each_arm().items()}

    @property
    def base_robot(self) -> RobotSpec:
        """Robot in whose base motion capture and emulated devices measure: of several arms, that of `mocap.arm`."""
        arm = "" if self.mocap is None else self.mocap.arm
        return self._arm(arm).robot if arm else self.robot

    @property
    def all_setpoints(self) -> list[Setpoint]:
        """Setpoints of the experiment and its arms, sorted by time; the controller of an arm is `ARM/CONTROLLER`."""
        of_arms = [
            replace(setpoint, controller=f"{name}/{setpoint.controller}")
            for name, arm in self.arms.items()
            for setpoint in arm.setpoints
        ]
        return sorted([*self.setpoints, *of_arms], key=lambda setpoint: setpoint.time)

    @property
    def sensor_sections(self) -> "list[SensorSection]":
        """Sensor sections that are in the file."""
        return [sensor for name in SENSORS if (sensor := getattr(self, name)) is not None]

    @property
    def sensors(self) -> "list[SensorSection]":
        """Sensor sections that are used in the run."""
        return [sensor for sensor in self.sensor_sections if sensor.used]

    @property
    def added_sections(self) -> "dict[str, ExperimentSection]":
        """Sections of ADDED that are in the file, by name."""
        return {name: added for name in ADDED if (added := getattr(self, name)) is not None}

    @property
    def sources(self) -> "list[MocapSection | SensorSection]":
        """Sections of all measuring devices except the robot: motion capture and sensors."""
        return [*([] if self.mocap is None else [self.mocap]), *self.sensors]

    def check(self, where: str) -> None:
        """Refuse settings that cannot take effect, and devices that measure a human who is not simulated.

        Examples are setpoints and parameters of controllers that are not started, and setpoints after the end.
        """
        mistakes, valid = Mistakes(), f"not started; valid: {', '.join(self.controllers)}"
        for i, setpoint in enumerate(self.setpoints):
            with mistakes.noted():
                if setpoint.controller not in self.controllers:
                    raise ParameterError(f"setpoints[{i}].controller: {setpoint.controller!r} is {valid}")
            with mistakes.noted():
                if setpoint.time >= self.duration:
                    end = f"not before the end ({self.duration} s)"
                    raise ParameterError(f"setpoints[{i}].time {setpoint.time} s is {end}")
            with mistakes.noted():
                if (setpoint.time, setpoint.controller) in ((p.time, p.controller) for p in self.setpoints[:i]):
                    raise ParameterError(
                        f"setpoints[{i}].time {setpoint.time} s is used twice for {setpoint.controller}; valid: "
                        "different times for one controller"
                    )
        with mistakes.noted():
            self._check_global_parameters()
            if others := sorted(set(self.parameters) - set(self.controllers)):
                raise ParameterError(f"parameters for {', '.join(others)}, which is {valid}")
        for key in filter(None, (source.follows for source in self.sources)):
            with mistakes.noted():
                if self.human is None:
                    valid = "a section human, or another program"
                    raise ParameterError(
                        f"{key}.program is body, but there is no human in the robot's plant; valid: {valid}"
                    )
            with mistakes.noted():
                if (self.human or {}).get("walk"):
                    raise ParameterError(
                        f"{key}.program is body, which does not support a walking human; valid: no human.walk"
                    )
        self._check_arms(mistakes)
        with mistakes.noted():
            self._check_supervisor()
        if (area := (self.human or {}).get("contact_area")) is not None:
            from hric_assessment.contact.area import check_area  # imported only for runs with a person

            with mistakes.noted():
                check_area(as_number(area), name="human.contact_area")
        mistakes.raise_all()

    def _check_arms(self, mistakes: Mistakes) -> None:
        """Refuse a single arm, arms with an invalid key, and motion capture that names no arm."""
        with mistakes.noted():
            arm = "" if self.mocap is None else self.mocap.arm
            if arm not in self.arms if self.mocap is not None and self.arms else arm:
                valid = f"one of {', '.join(self.arms)}" if self.arms else "no mocap.arm, as there is one robot only"
                raise ParameterError(f"mocap.arm is {arm or 'not given'}; valid: {valid}")
        if not self.arms:
            return
        with mistakes.noted():
            if len(self.arms) < 2:
                raise ParameterError(f"arms has only {', '.join(self.arms)}; valid: two arms or more")
        with mistakes.noted():
            if wrong := [name for name in self.arms if not _ARM_NAME.fullmatch(name)]:
                raise ParameterError(
                    f"arms: {wrong[0]!r} is no name of an arm; valid: a letter, then letters, digits, _"
                )
        with mistakes.noted():
            if taken := [name for name in self.arms if name in self._other_names()]:
                raise ParameterError(f"arms: {taken[0]} is also the name of other parameters; valid: another name")
        for name in self.arms:
            with mistakes.noted():
                try:
                    self._arm(name).check("")
                except HricError as error:
                    lines = [line.removeprefix(f"arms.{name}.") for line in str(error).splitlines()]
                    raise ParameterErrors([ParameterError(f"arms.{name}: {line}") for line in lines]) from error

    def _check_supervisor(self) -> None:
        """Refuse a supervisor whose source of the person's pose is missing."""
        if self.supervisor is None:
            return
        source = self.supervisor.get("source", "human")
        sources = [source] if isinstance(source, str) else list(source)
        if "human" in sources and self.human is None:
            valid = "a section human, or another source"
            raise ParameterError(
                f"supervisor.source is human, but there is no human in the robot's plant; valid: {valid}"
            )
        if "person" in sources and self.person is None:
            valid = "a section person, or another source"
            raise ParameterError(f"supervisor.source is person, but there is no section person; valid: {valid}")
        if sources != ["human"] and (self.mocap is None or self.mocap.base_from_mocap is None):
            raise ParameterError(
                f"supervisor.source is {', '.join(sources)}, but the pose of the mocap frame in the robot's base frame "
                "is not known; valid: a section mocap with base_from_mocap, or the source human"
            )


EXAMPLE = """\
robot: {hw: franka_sim/FrankaHWSim}
controllers: [joint_state_controller, franka_state_controller, joint_pd_controller]
setpoints:
  - {time: 1.0, controller: joint_pd_controller, positions: [0.3, -pi/4, 0, -3*pi/4, 0, pi/2, pi/4]}   # [s], [rad]
duration: 4.0   # [s]
"""
"""Example of an experiment file, with the required keys and a setpoint."""
NONE = "none"
"""Experiment name for a bring-up without an experiment."""


PACKAGE = "hric_experiments"


def package_path(package: str = PACKAGE) -> Path:
    """Return the folder of a ROS package.

    Raises:
        UnknownNameError: there is no such package on ROS_PACKAGE_PATH.
    """
    sibling = Path(__file__).resolve().parents[4] / PACKAGE
    return sibling if package == PACKAGE and (sibling / "config").is_dir() else resources.package_path(package)


def config_path(kind: str) -> Path:
    """Return the folder with files of a kind: "experiments", "studies" or "references" (results to compare with)."""
    return package_path() / "config" / kind


def names(kind: str = "experiments") -> list[str]:
    """Return the names, without extension, of the workspace's files of a kind, by default the experiments."""
    return sorted(path.stem for path in config_path(kind).glob("*.yaml"))


def find(name: str) -> Path:
    """Return the path of an experiment file; `name`: name of an experiment, path of a YAML file, or "none".

    Raises:
        UnknownNameError: there is no such experiment; the message lists the existing ones.
    """
    if name == NONE:
        return package_path() / "config" / "bringup.yaml"
    if name.endswith((".yaml", ".yml")):
        path = Path(name).expanduser()
        if path.is_file():
            return path
        raise ExperimentError(f"no experiment file {name}; experiments by name: {', '.join(names())}")
    if name not in names():
        raise UnknownNameError("experiment", name, names(), "experiments")
    return config_path("experiments") / f"{name}.yaml"


def read(name: str) -> dict[str, object]:
    """Return the unchecked contents of an experiment file; relative paths of recorded trials become absolute.

    Raises:
        HricError: there is no such experiment, or the file is not YAML.
    """
    path = find(name)
    raw = read_yaml(path)
    if not isinstance(raw, dict):
        raise ExperimentError(f"{path.name} must be a mapping with the keys {', '.join(declared(Experiment))}")
    return dict(located(raw, path.parent))


def parse(name: str, raw: Mapping[str, object]) -> Experiment:
    """Check the contents of an experiment file and return the experiment.

    Args:
        name: name of the experiment, used in messages and for the run folder.
        raw: contents of the file.

    Raises:
        ExperimentError: keys are unknown or missing, types are wrong, or values out of range; all are listed at once.
    """
    try:
        return replace(Experiment.of(raw, ""), name=name)
    except HricError as error:
        raise ExperimentError(message_about(f"experiment {name}", error)) from error


def load(name: str, changes: Iterable[str] = ()) -> Experiment:
    """Read an experiment file, apply overrides, and check the result.

    Args:
        name: name of the experiment, or path of a YAML file.
        changes: overrides, `key:=value`.

    Raises:
        HricError: there is no such experiment, or the file or an override has a mistake; for a user's own file, the
            message includes an example.
    """
    from hric_run.definition import overrides

    raw = read(name)
    try:
        return parse(Path(name).stem, overrides.apply(raw, changes))
    except ExperimentError as error:
        if name in (*names(), NONE):
            raise
        raise ExperimentError(f"{error}\nan experiment file, for example:\n{indent(EXAMPLE.rstrip(), '  ')}") from error


def to_dict(experiment: Experiment) -> Definition:
    """Return an experiment as plain data for run.yaml: the keys of an experiment file, plus `name`."""
    sensors = {sensor.name: sensor.record() for sensor in experiment.sensor_sections}
    return cast(Definition, asdict(experiment) | sensors)
