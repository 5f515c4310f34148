"""Conversion of an experiment to ROS parameters: of the robot, its controllers, the sensors and the supervisor."""

import copy
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import panda_description
from franka_msgs.srv import SetLoadRequest
from hric_control.plants import BREAKAWAY, PHI, breakaways, refuse_other_joints, sigmoid_parameters
from hric_control.sim.robot_hw_sim import RobotHWSim
from hric_core import plugins, yaml_text
from hric_core.errors import HricError
from hric_core.geometry import quaternion_from_rotation, transform_from_rpy
from hric_core.trial.c3d import located
from hric_core.urdf import read
from hric_run.definition.experiment import Experiment, ExperimentError, RobotSpec, package_path
from hric_run.definition.robot_description import all_joints, base_link, description, of_experiment, with_joints

COMBINED = "hric_control/CombinedHWSim"
"""Type of the RobotHW of several arms in one world."""
SEED_STEP = 1_000_003
"""Difference of the seeds of two arms (prime, so that runs with neighbouring seeds share none)."""
ROBOT = "robot"
"""Private namespace of the robot node, relative to the robot's namespace."""

HUMAN = "human"
"""Name of the simulated human in the robot's plant, and of the namespace of their topics in `hric/`."""
HUMAN_START = f"hric/{HUMAN}/start"
"""Service that starts the motion of the simulated human."""
LOAD_SERVICE = "franka_control/set_load"
"""Service that sets the payload in the control box of a Franka arm."""
MOCAP_CLIENT, EMULATED_HUMAN = "natnet_client", "emulated_human"
"""Names of the nodes for motion capture: the client, and the emulated human with an emulated Motive."""
PERSON = "person"
"""Name of the node that tracks a real person."""
SUPERVISOR = "hric/safety/supervisor"
"""Name of the supervisor node, relative to the robot's namespace."""


def human_description(experiment: Experiment) -> str:
    """Return the URDF of the simulated human in the robot's plant.

    Raises:
        HricError: the experiment has no human, or one of their parameters is not valid.
    """
    if experiment.human is None:
        raise ExperimentError(f"experiment {experiment.name}: there is no human; valid: a section {HUMAN!r}")
    # Imported only for runs with a human.
    from hric_human.participant.settings import HumanSettings

    return HumanSettings.of(experiment.human, HUMAN).body().urdf


def human_muscles(experiment: Experiment) -> dict[str, list[list[Any]]]:
    """Return the paths of the simulated human's muscles, by name of the muscle.

    A path is a list of points [link, x, y, z], in the link's frame [m]. The result is empty unless muscles drive the
    human.

    Raises:
        HricError: one of the human's parameters is not valid.
    """
    from hric_human.participant.muscles import muscle_paths
    from hric_human.participant.settings import MUSCLE, HumanSettings

    settings = None if experiment.human is None else HumanSettings.of(experiment.human, HUMAN)
    if settings is None or settings.drive != MUSCLE:
        return {}
    paths = muscle_paths(settings, f"{HUMAN}.muscles.")
    return {name: [[link, *p_link] for link, p_link in points] for name, points in paths.items()}


def controllers_file() -> Path:
    """Return the path of controllers.yaml, the default parameters of controllers, which the bring-up uses, too."""
    return package_path("hric_bringup") / "config" / "controllers.yaml"


def defaults(*arm_ids: str) -> dict[str, dict[str, object]]:
    """Return the parameters of all controllers in controllers.yaml, by name of the controller.

    Args:
        arm_ids: value that replaces $(arg arm_id) in the file; of several, the parameters are for all joints.

    Raises:
        HricError: the file is missing or is not YAML.
    """
    return _joined([_configured(controllers_file(), arm_id) for arm_id in arm_ids])


def _joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the parameters of several arms as one mapping.

    Lists that differ are joined, mappings are united; other values that differ, such as `arm_id`, are left out.
    """
    result: dict[str, Any] = {}
    for key in dict.fromkeys(key for part in parts for key in part):
        values = [part[key] for part in parts if key in part]
        if all(value == values[0] for value in values):
            result[key] = values[0]
        elif all(isinstance(value, Mapping) for value in values):
            result[key] = _joined(values)
        elif all(isinstance(value, list) for value in values):
            result[key] = [item for value in values for item in value]
    return result


def _configured(path: Path, arm_id: str) -> dict[str, dict[str, object]]:
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise HricError(f"cannot read {path}: {error}") from error
    data = _parsed(text.replace("$(arg arm_id)", arm_id), str(path))
    return dict(data or {}) if isinstance(data, dict | None) else {}


@cache
def _parsed(text: str, where: str) -> Any:
    """Return parsed YAML; it is cached and shared by the runs of a process, so it must not be changed."""
    return yaml_text.parse(text, where)


def configured_by_packages(arm_id: str) -> dict[str, dict[str, object]]:
    """Return the parameters of controllers that are configured in config/*.yaml of packages that export controllers.

    The result is by name of the controller; entries without a `type` are no controllers.

    Args:
        arm_id: value that replaces $(arg arm_id) in the files.

    Raises:
        HricError: a file is not YAML.
    """
    folders = sorted({info.source.parent for info in plugins.names(plugins.CONTROLLER).values()})
    instances: dict[str, dict[str, object]] = {}
    for path in (path for folder in folders for path in sorted(folder.glob("config/*.yaml"))):
        for name, values in _configured(path, arm_id).items():
            if isinstance(values, dict) and "type" in values:
                instances.setdefault(name, values)
    return instances


def controllers(experiment: Experiment) -> dict[str, dict[str, object]]:
    """Return the parameters of the controllers that an experiment starts, by name, with its changes applied.

    Raises:
        ExperimentError: a controller has no type; the message lists the configured ones.
    """
    parts = experiment.each_arm() or {"": experiment}
    known = _joined([_known(experiment, part.robot) for part in parts.values()])
    result: dict[str, dict[str, object]] = {}
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


def _known(experiment: Experiment, spec: RobotSpec) -> dict[str, dict[str, object]]:
    """Return the configured parameters of controllers for a robot, by name of the controller."""
    known = defaults(spec.arm_id)
    if any(
        "type" not in {**known.get(name, {}), **experiment.parameters.get(name, {})} for name in experiment.controllers
    ):
        known = configured_by_packages(spec.arm_id) | known
    return with_joints(known, spec)


def robot(experiment: Experiment, seed: int = 0) -> dict[str, object]:
    """Return the private parameters of the robot node for an experiment, with the seed of its plant.

    Of several arms, each has another seed, so that their noise differs.

    Raises:
        HricError: the value of `realism` is not valid, or the robot does not support it.
    """
    if experiment.arms:
        own = {key: value for key, value in experiment.robot.parameters.items() if key == "control_log"}
        arms = {
            name: namespace(part, seed + index * SEED_STEP)
            for index, (name, part) in enumerate(experiment.each_arm().items())
        }
        return {"robot_hw": COMBINED, "arms": arms, **own, **participants(experiment, seed)}
    spec = experiment.robot
    plant = _realistic(spec, {"seed": seed, **spec.plant, **_friction(spec)})
    values: dict[str, object] = {"robot_hw": spec.hw, "arm_id": spec.arm_id, **spec.parameters, "plant": plant}
    if spec.plant_type:
        values["plant_type"] = spec.plant_type
    if spec.q_start is not None:
        values["q_start"] = dict(spec.q_start) if isinstance(spec.q_start, Mapping) else list(spec.q_start)
    return values | participants(experiment, seed)


def namespace(experiment: Experiment, seed: int = 0) -> dict[str, Any]:
    """Return all parameters of the robot's namespace for an experiment: description, limits, controllers, robot node.

    Raises:
        HricError: the experiment has a mistake.
    """
    return {
        "robot_description": of_experiment(experiment),
        "joint_limits": joint_limits(experiment),
        **controllers(experiment),
        ROBOT: robot(experiment, seed),
    }


def global_tree(experiment: Experiment) -> dict[str, Any]:
    """Return the parameters outside the controllers as nested mappings from the root."""
    tree: dict[str, Any] = {}
    for name, value in experiment.global_parameters.items():
        for part in reversed(name.strip("/").split("/")):
            value = {part: value}
        tree = overlay(tree, value)
    return tree


def load_request(spec: RobotSpec) -> Any:
    """Return the request to the service `LOAD_SERVICE` for `robot.load` (inertia zero); None: there is no payload.

    Raises:
        HricError: the robot has no control box of a Franka arm.
    """
    if spec.load.mass == 0.0:
        return None
    if issubclass(plugins.find(plugins.ROBOT_HW, spec.hw), RobotHWSim):
        raise ExperimentError(
            f"robot.load is a payload in the control box of a Franka arm, which {spec.hw} does not have; valid for "
            "this robot: the payload as a link of its description"
        )
    return SetLoadRequest(mass=spec.load.mass, F_x_center_load=list(spec.load.com), load_inertia=[0.0] * 9)


def participants(experiment: Experiment, seed: int) -> dict[str, object]:
    """Return the robot's parameter `participants` with the simulated human; empty if the experiment has none."""
    if experiment.human is None:
        return {}
    return {
        "participants": {HUMAN: {"type": "hric_human/Human", "seed": seed, **located(experiment.human, Path.cwd())}}
    }


def _realistic(spec: RobotSpec, plant: dict[str, object]) -> dict[str, object]:
    """Return the plant's parameters with the friction of `realism`, so that run.yaml has the actual friction."""
    if "realism" not in spec.parameters:
        return plant
    if issubclass(plugins.find(plugins.ROBOT_HW, spec.hw), RobotHWSim):  # it has no emulated control box
        raise ExperimentError(
            "realism applies only to the simulated Franka with control box (robot.hw franka_sim/FrankaHWSim); this "
            f"experiment has {spec.hw}"
        )
    from franka_sim.realism import parse  # imported only for experiments with realism

    return parse(spec.parameters["realism"], "realism").with_friction(plant, spec.arm_id)


def _friction(spec: RobotSpec) -> dict[str, object]:
    """Return the plant's friction parameters that follow from `friction` in plant or description."""
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
    fitted = spec.plant.get("friction_parameters", {})
    chosen = published if fitted == {} else fitted
    refuse_other_joints(chosen, list(published))
    values = [dict(zip(PHI, phi, strict=True)) for phi in sigmoid_parameters(chosen, list(published))]
    held = breakaways(chosen, list(published))
    if BREAKAWAY in chosen or any(held):
        values = [{**phi, BREAKAWAY: value} for phi, value in zip(values, held, strict=True)]
    # The control box needs values by joint name; a fitted file has them in the order of joints, for any arm_id.
    return {"friction": friction, "friction_parameters": dict(zip(published, values, strict=True))}


def joint_limits(experiment: Experiment) -> Mapping[str, Mapping[str, object]]:
    """Return the parameters in `joint_limits/` of the robot's namespace; empty for a robot other than the Panda.

    They are the limits of the Panda, or of the FR3 with `robot.description.limits`. Their names are those of
    ros_control; they include the torque rate, which a URDF cannot contain.
    """
    if experiment.arms:
        return {name: limit for part in experiment.each_arm().values() for name, limit in joint_limits(part).items()}
    spec = experiment.robot
    chosen: Any = spec.description.get("limits", "panda")
    return {} if spec.urdf else panda_description.joint_limit_parameters(spec.arm_id, chosen)


def mocap(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, object]]:
    """Return the private parameters of the motion capture nodes, by node name; empty without a section `mocap`.

    The nodes are the NatNet client, and the emulated human with an emulated Motive.

    Raises:
        ExperimentError: the emulated human reacts to a robot that does not publish its pose.
    """
    if experiment.mocap is None:
        return {}
    program = experiment.mocap.human.get("program")
    spec = experiment.base_robot
    if program == "reactive" and spec.urdf:
        raise ExperimentError(
            "mocap.human.program is reactive, but only a Franka arm publishes the pose that it reacts to; valid: "
            "another program"
        )
    return experiment.mocap.nodes(base_link(spec), seed, person(experiment))


def person(experiment: Experiment) -> dict[str, object]:
    """Return the parameters by which emulated devices measure the simulated human; empty without a human.

    `person` is the section `human` of the experiment, `world_from_base` the pose of the robot's base in the world.
    """
    if experiment.human is None:
        return {}
    xyz, rpy = (_three(experiment.base_robot.description, name) for name in ("xyz", "rpy"))
    base = {"xyz": xyz, "xyzw": list(quaternion_from_rotation(transform_from_rpy(xyz, rpy)[:3, :3]))}
    return {"person": dict(located(experiment.human, Path.cwd())), "world_from_base": base}


def _three(description: Mapping[str, object], name: str) -> list[float]:
    """Return an argument of the robot's description as three numbers; it is a list, or a text with spaces."""
    value: Any = description.get(name, [0.0, 0.0, 0.0])
    try:
        x, y, z = map(float, value.split() if isinstance(value, str) else value)
    except (TypeError, ValueError):
        raise ExperimentError(f"robot.description.{name} is {value!r}; valid: three numbers") from None
    return [x, y, z]


def sensors(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, object]]:
    """Return the private parameters of all nodes for sensors, by node name.

    They are drivers, emulated devices, the synchroniser, and the tracker of a real person.
    """
    human = person(experiment)
    nodes = {name: values for sensor in experiment.sensors for name, values in sensor.nodes(seed, human).items()}
    if experiment.sync is not None:
        nodes |= experiment.sync.nodes(_joints(experiment), [part.source for part in experiment.sources])
    if experiment.person is not None:
        nodes[PERSON] = _from_root(experiment.person, "subject", "calibration")
    return nodes


def supervisor(experiment: Experiment) -> dict[str, dict[str, object]]:
    """Return the private parameters of the supervisor, by node name; empty without a section `supervisor`."""
    if experiment.supervisor is None:
        return {}
    seen: dict[str, object] = {}
    if experiment.person is not None:
        seen["person"] = _from_root(experiment.person, "subject", "calibration")
    if experiment.human is not None:
        seen["human"] = dict(located(experiment.human, Path.cwd()))
    return {SUPERVISOR: {**_from_root(experiment.supervisor, "limits", "stops"), **seen}}


def other_nodes(experiment: Experiment) -> dict[str, dict[str, object]]:
    """Return the private parameters of all nodes except the robot node, by the last part of the node's name."""
    nodes = mocap(experiment) | sensors(experiment) | supervisor(experiment)
    return {name.rpartition("/")[2]: values for name, values in nodes.items()}


def _from_root(section: Mapping[str, object], *keys: str) -> dict[str, object]:
    """Return a section with the YAML file names at these keys made absolute, as the node runs in another folder."""
    texts = {key: value for key in keys if isinstance(value := section.get(key), str)}
    files = {key: value for key, value in texts.items() if value.endswith((".yaml", ".yml"))}
    return {**section, **{key: str(Path(value).expanduser().absolute()) for key, value in files.items()}}


def _joints(experiment: Experiment) -> list[str]:
    """Return the joint names of the first controller that has a list of them, else the robot's."""
    for values in controllers(experiment).values():
        joints = values.get("joints")
        if isinstance(joints, list) and joints:
            return [str(joint) for joint in joints]
    return all_joints(experiment)


def overlay(base: Mapping[str, object], changes: Mapping[str, object]) -> dict[str, object]:
    """Return a copy of `base` with the values of `changes`; nested mappings are merged."""
    result = copy.deepcopy(dict(base))
    for key, value in changes.items():
        old = result.get(key)
        result[key] = (
            overlay(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else copy.deepcopy(value)
        )
    return result
