"""The parameters of an experiment, as they are on a parameter server: controllers.yaml, overlaid by the experiment,
and the robot's own."""

import copy
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import panda_description
from franka_msgs.srv import SetLoadRequest
from hric_control.plants import BREAKAWAY, PHI, breakaways, refuse_other_joints, sigmoid_parameters
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core import plugins, resources, yaml_text
from hric_core.errors import HricError, check_known
from hric_core.geometry import quaternion_from_rotation, transform_from_rpy
from hric_core.magnitudes import likely_unit
from hric_core.trial.c3d import located
from hric_core.urdf import read
from hric_run.definition.experiment import Experiment, ExperimentError, RobotSpec, Setpoint, package_path

ROBOT = "robot"
"""Namespace of the robot's own parameters, below the robot's namespace."""

HUMAN = "human"
"""Name of who is beside the robot, and of his topics below `hric/`."""
HUMAN_START = f"hric/{HUMAN}/start"
"""Service that lets him begin."""
LOAD_SERVICE = "franka_control/set_load"
"""Service that sets the payload which a Franka holds."""
MOCAP_CLIENT, EMULATED_HUMAN = "natnet_client", "emulated_human"
"""Names of the motion capture's nodes."""
PERSON = "person"
"""Name of the node that tracks a real person."""
SUPERVISOR = "hric/safety/supervisor"
"""Name of the supervisor, below the robot's namespace."""


def description(spec: RobotSpec) -> str:
    """`robot_description`, pure URDF: the Panda by its arguments, or another robot's URDF or xacro.

    Raises:
        HricError: an argument that the description does not have, or a file that cannot be used.
    """
    if spec.urdf:
        return _description_of(spec.urdf)
    valid = [name for name in panda_description.arguments() if name not in ("arm_id", "robot_sim_type")]
    check_known("key", spec.description, valid, "robot.description")
    return str(panda_description.load(arm_id=spec.arm_id, robot_sim_type=spec.hw, **spec.description))


def human_description(experiment: Experiment) -> str:
    """URDF of the human beside the robot.

    Raises:
        HricError: nobody is there, or a parameter of his that cannot be.
    """
    if experiment.human is None:
        raise ExperimentError(f"experiment {experiment.name}: nobody is beside the robot; valid: a section {HUMAN!r}")
    # Only who is there is waited for.
    from hric_human.body import describe
    from hric_human.participant.settings import HumanSettings

    return describe(HumanSettings.of(experiment.human, HUMAN).person).urdf


def human_muscles(experiment: Experiment) -> dict[str, list[list[Any]]]:
    """Where the muscles of the human beside the robot are drawn: by name points of link, x, y, z [m]; empty where
    muscles move nobody.

    Raises:
        HricError: a parameter of his that cannot be.
    """
    from hric_human.body import describe
    from hric_human.muscles.choose import find
    from hric_human.muscles.lines import muscle_lines
    from hric_human.participant.settings import MUSCLE, HumanSettings

    settings = None if experiment.human is None else HumanSettings.of(experiment.human, HUMAN)
    if settings is None or settings.drive != MUSCLE:
        return {}
    anatomy = find(settings.muscles.anatomy, f"{HUMAN}.muscles.anatomy")
    lines = muscle_lines(describe(settings.person), anatomy)
    return {name: [[link, *p_link] for link, p_link in points] for name, points in lines.items()}


def _description_of(address: str) -> str:
    try:
        path = resources.resolve(address)
        if path.suffix == ".xacro":
            return resources.anchored(str(panda_description.process_xacro(path, {}).toxml()), path.parent)
        return resources.read_description(path)
    except HricError as error:
        raise HricError(f"cannot read the robot description {address}: {error}") from error


def controllers_file() -> Path:
    """The controllers' YAML that the bring-up loads too."""
    return package_path("hric_bringup") / "config" / "controllers.yaml"


def defaults(arm_id: str) -> dict[str, dict[str, Any]]:
    """Parameters of all controller instances that come configured.

    Args:
        arm_id: put in place of $(arg arm_id).

    Raises:
        HricError: the file is missing or is not YAML.
    """
    return _configured(controllers_file(), arm_id)


def _configured(path: Path, arm_id: str) -> dict[str, dict[str, Any]]:
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise HricError(f"cannot read {path}: {error}") from error
    data = _parsed(text.replace("$(arg arm_id)", arm_id), str(path))
    return dict(data or {}) if isinstance(data, dict | None) else {}


@cache
def _parsed(text: str, where: str) -> Any:
    """YAML, shared by the runs of a process: not to be changed."""
    return yaml_text.parse(text, where)


def configured_by_packages(arm_id: str) -> dict[str, dict[str, Any]]:
    """Parameters of the controller instances, mappings with a type, in config/*.yaml of all packages that export
    controllers.

    Args:
        arm_id: put in place of $(arg arm_id).

    Raises:
        HricError: a file is not YAML.
    """
    folders = sorted({info.source.parent for info in plugins.names(plugins.CONTROLLER).values()})
    found: dict[str, dict[str, Any]] = {}
    for path in (path for folder in folders for path in sorted(folder.glob("config/*.yaml"))):
        for name, values in _configured(path, arm_id).items():
            if isinstance(values, dict) and "type" in values:
                found.setdefault(name, values)
    return found


def controllers(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """Parameters of the instances that the experiment starts.

    Raises:
        ExperimentError: an instance without a type; lists those that come configured.
    """
    known = defaults(experiment.robot.arm_id)
    if set(experiment.controllers) - set(known) - set(experiment.parameters):
        known = configured_by_packages(experiment.robot.arm_id) | known
    result: dict[str, dict[str, Any]] = {}
    for name in experiment.controllers:
        values = overlay(known.get(name, {}), experiment.parameters.get(name, {}))
        if "type" not in values:
            raise ExperimentError(
                f"experiment {experiment.name}: controller {name!r} is not in {controllers_file().name} nor in "
                f"config/*.yaml of a package that exports controllers, and parameters.{name}.type is not given; "
                f"configured: {', '.join(sorted(known))}"
            )
        result[name] = values
    return result


def robot(experiment: Experiment, seed: int = 0) -> dict[str, Any]:
    """Private parameters of the RobotHW.

    Raises:
        HricError: a realism that there is not, or of a robot that knows none.
    """
    spec = experiment.robot
    plant = _realistic(spec, {"seed": seed, **spec.plant, **_friction(spec)})
    values: dict[str, Any] = {"robot_hw": spec.hw, "arm_id": spec.arm_id, **spec.parameters, "plant": plant}
    if spec.plant_type:
        values["plant_type"] = spec.plant_type
    if spec.q_start is not None:
        values["q_start"] = dict(spec.q_start) if isinstance(spec.q_start, Mapping) else list(spec.q_start)
    return values | participants(experiment, seed)


def load_request(spec: RobotSpec) -> Any:
    """Request of `LOAD_SERVICE`, of a payload without inertia of its own; None: the experiment has none."""
    if spec.load.mass == 0.0:
        return None
    return SetLoadRequest(mass=spec.load.mass, F_x_center_load=list(spec.load.com), load_inertia=[0.0] * 9)


def participants(experiment: Experiment, seed: int) -> dict[str, Any]:
    """Who acts in the robot's plant, as its parameter `participants`; empty where nobody does."""
    if experiment.human is None:
        return {}
    return {
        "participants": {HUMAN: {"type": "hric_human/Human", "seed": seed, **located(experiment.human, Path.cwd())}}
    }


def _realistic(spec: RobotSpec, plant: dict[str, Any]) -> dict[str, Any]:
    """The plant's parameters with the friction of `realism`, so that run.yaml has the friction that acted."""
    if "realism" not in spec.parameters:
        return plant
    if issubclass(plugins.find(plugins.ROBOT_HW, spec.hw), RobotHWSim):  # it has no control box with a model of its own
        raise ExperimentError(
            "realism is of the simulated Franka with its control box (robot.hw franka_sim/FrankaHWSim); this "
            f"experiment has {spec.hw}"
        )
    from franka_sim.realism import parse  # with the control box's settings, which other experiments need not wait for

    return parse(spec.parameters["realism"], "realism").with_friction(plant, spec.arm_id)


def _friction(spec: RobotSpec) -> dict[str, Any]:
    """What the plant needs for the friction of the Panda's description."""
    friction = spec.plant.get("friction", spec.description.get("friction", "none"))
    if friction == "coulomb" and not any(joint.friction for joint in read(description(spec)).joints.values()):
        raise ExperimentError(
            "friction: coulomb has no effect: no joint has <dynamics friction>; valid: none, identified, a file"
        )
    if spec.urdf or friction == "none":
        return {}
    if friction != "identified":
        return {"friction": friction}
    published = panda_description.friction_parameters(spec.arm_id)
    given = spec.plant.get("friction_parameters", {})
    chosen = published if given == {} else given
    refuse_other_joints(chosen, list(published))
    values = [dict(zip(PHI, phi, strict=True)) for phi in sigmoid_parameters(chosen, list(published))]
    held = breakaways(chosen, list(published))
    if BREAKAWAY in chosen or any(held):
        values = [{**phi, BREAKAWAY: value} for phi, value in zip(values, held, strict=True)]
    # By the joints' names, as the control box takes them: a fitted file has the values in their order, whatever the arm
    # is called.
    return {"friction": friction, "friction_parameters": dict(zip(published, values, strict=True))}


def joint_limits(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """The parameters below `joint_limits/` in the robot's namespace: the Panda's limits under ros_control's names, the
    rate of torque among them, which a URDF cannot carry. Empty for another robot."""
    return {} if experiment.robot.urdf else panda_description.joint_limit_parameters(experiment.robot.arm_id)


def mocap(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Private parameters of the motion capture's nodes, by their names: the client, and the emulated human with his
    Motive. Empty without a section `mocap`."""
    if experiment.mocap is None:
        return {}
    return experiment.mocap.nodes(experiment.robot.arm_id, seed, person(experiment))


def person(experiment: Experiment) -> dict[str, Any]:
    """What a device that measures the human in the plant knows of him: `person`, the section that describes him, and
    `world_from_base`. Empty where nobody is there."""
    if experiment.human is None:
        return {}
    xyz, rpy = (_three(experiment.robot.description, name) for name in ("xyz", "rpy"))
    base = {"xyz": xyz, "xyzw": list(quaternion_from_rotation(transform_from_rpy(xyz, rpy)[:3, :3]))}
    return {"person": dict(located(experiment.human, Path.cwd())), "world_from_base": base}


def _three(description: Mapping[str, Any], name: str) -> list[float]:
    """An argument of the robot's description: a list, or a text with spaces."""
    given = description.get(name, [0.0, 0.0, 0.0])
    try:
        x, y, z = map(float, given.split() if isinstance(given, str) else given)
    except (TypeError, ValueError):
        raise ExperimentError(f"robot.description.{name} is {given!r}; valid: three numbers") from None
    return [x, y, z]


def sensors(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Private parameters of the sensors' nodes, by their names: drivers, emulated devices, and the synchroniser of all
    that measures. Empty without a sensor and the sections `sync`, `person`."""
    human = person(experiment)
    found = {name: values for sensor in experiment.sensors for name, values in sensor.nodes(seed, human).items()}
    if experiment.sync is not None:
        found |= experiment.sync.nodes(_joints(experiment), [part.source for part in experiment.sources])
    if experiment.person is not None:
        found[PERSON] = _from_root(experiment.person, "subject", "calibration")
    return found


def supervisor(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """Private parameters of the supervisor, by its name; empty without a section `supervisor`."""
    if experiment.supervisor is None:
        return {}
    seen: dict[str, Any] = {}
    if experiment.person is not None:
        seen["person"] = _from_root(experiment.person, "subject", "calibration")
    if experiment.human is not None:
        seen["human"] = dict(located(experiment.human, Path.cwd()))
    return {SUPERVISOR: {**_from_root(experiment.supervisor, "limits", "stops"), **seen}}


def beside(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """Private parameters of all nodes that run beside the robot, by the last part of their names."""
    found = mocap(experiment) | sensors(experiment) | supervisor(experiment)
    return {name.rpartition("/")[2]: values for name, values in found.items()}


def _from_root(section: Mapping[str, Any], *keys: str) -> dict[str, Any]:
    """A section whose files, at these keys, have their path from the root: the node runs in another folder."""
    given = {key: value for key in keys if isinstance(value := section.get(key), str)}
    files = {key: value for key, value in given.items() if value.endswith((".yaml", ".yml"))}
    return {**section, **{key: str(Path(value).expanduser().absolute()) for key, value in files.items()}}


def _joints(experiment: Experiment) -> list[str]:
    """As a controller names them, else those of a Panda."""
    for values in controllers(experiment).values():
        if isinstance(values.get("joints"), list) and values["joints"]:
            return [str(joint) for joint in values["joints"]]
    return [f"{experiment.robot.arm_id}_joint{number}" for number in range(1, 8)]


def check_setpoint(setpoint: Setpoint, joints: Sequence[str], limits: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse a setpoint that the controller would refuse, before anything moves.

    Args:
        setpoint: what is to be sent.
        joints: the controller's joints.
        limits: per joint, lower and upper if there are any [rad].

    Raises:
        ExperimentError: wrong length, or outside the range of a joint.
    """
    where = f"setpoint at {setpoint.time:g} s for {setpoint.controller}"
    if len(setpoint.positions) != len(joints):
        raise ExperimentError(
            f"{where} has {len(setpoint.positions)} positions; valid: {len(joints)}, for {', '.join(joints)}"
        )
    for joint, position in zip(joints, setpoint.positions, strict=True):
        bounds = limits.get(joint, {})
        low, high = bounds.get("lower", -math.inf), bounds.get("upper", math.inf)
        if not low <= position <= high:
            likely = likely_unit(position, "rad", low, high)
            raise ExperimentError(f"{where}: {joint} {position:g} rad is outside {low:g} to {high:g}{likely}")


def overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes`, group by group."""
    result = copy.deepcopy(dict(base))
    for key, value in changes.items():
        old = result.get(key)
        result[key] = (
            overlay(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else copy.deepcopy(value)
        )
    return result
