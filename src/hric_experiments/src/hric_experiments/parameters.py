"""The parameters of an experiment, as they stand on a parameter server: controllers.yaml, overlaid by the experiment, and the robot's own."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

import panda_description
from hric_control.errors import HricError
from hric_control.plants.friction import PHI, sigmoid_parameters
from hric_experiments import config
from hric_experiments.experiment import Experiment, ExperimentError, RobotSpec, SetPoint
from mocap_natnet.trial import located

ROBOT = "robot"
"""Namespace of the robot's own parameters, below the robot's namespace."""

GENERIC = "pybullet_ros_control/RobotHWSim"
"""The robot of any URDF, which has no control box that could believe anything."""

MOCAP_CLIENT, EMULATED_HUMAN = "natnet_client", "emulated_human"
"""Names of the motion capture's nodes."""


def controllers_file() -> Path:
    """The controllers' YAML that the bring-up loads too."""
    return config.package_path("hric_bringup") / "config" / "controllers.yaml"


def defaults(arm_id: str) -> dict[str, dict[str, Any]]:
    """Parameters of all controller instances that come configured.

    Args:
        arm_id: put in place of $(arg arm_id).

    Raises:
        HricError: the file is missing or is not YAML.
    """
    try:
        data = yaml.safe_load(controllers_file().read_text().replace("$(arg arm_id)", arm_id))
    except (OSError, yaml.YAMLError) as error:
        raise HricError(f"cannot read {controllers_file()}: {error}") from error
    return dict(data or {})


def controllers(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """Parameters of the instances that the experiment starts.

    Raises:
        ExperimentError: an instance without a type; lists those that come configured.
    """
    known = defaults(experiment.robot.arm_id)
    result: dict[str, dict[str, Any]] = {}
    for name in experiment.controllers:
        values = overlay(known.get(name, {}), experiment.parameters.get(name, {}))
        if "type" not in values:
            raise ExperimentError(
                f"experiment {experiment.name}: controller {name!r} is not in {controllers_file().name} and parameters.{name}.type is not given; "
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
    return values


def _realistic(spec: RobotSpec, plant: dict[str, Any]) -> dict[str, Any]:
    """The plant's parameters with the friction of `realism`, so that run.yaml has the friction that acted."""
    if "realism" not in spec.parameters:
        return plant
    if spec.hw == GENERIC:
        raise ExperimentError(
            f"realism is of the simulated Franka with its control box (robot.hw franka_sim/FrankaHWSim); this experiment has {GENERIC}"
        )
    from franka_sim.realism import parse  # with the control box's settings, which other experiments need not wait for

    return parse(spec.parameters["realism"], "realism").with_friction(plant, spec.arm_id)


def _friction(spec: RobotSpec) -> dict[str, Any]:
    """What the plant needs for the friction of the Panda's description."""
    wanted = spec.plant.get("friction", spec.description.get("friction", "none"))
    if spec.urdf or wanted == "none":
        return {}
    if wanted != "identified":
        return {"friction": wanted}
    published = panda_description.friction_parameters(spec.arm_id)
    values = sigmoid_parameters(spec.plant.get("friction_parameters") or published, list(published))
    # By the joints' names, as the control box takes them: a fitted file has the values in their order, whatever the arm is called.
    return {
        "friction": wanted,
        "friction_parameters": {joint: dict(zip(PHI, phi, strict=True)) for joint, phi in zip(published, values, strict=True)},
    }


def joint_limits(experiment: Experiment) -> dict[str, dict[str, Any]]:
    """What stands below `joint_limits/` in the robot's namespace: the Panda's limits under ros_control's names, the rate of torque among them,
    which a URDF cannot carry. Empty for another robot."""
    return {} if experiment.robot.urdf else panda_description.joint_limit_parameters(experiment.robot.arm_id)


def mocap(experiment: Experiment, seed: int = 0) -> dict[str, dict[str, Any]]:
    """Private parameters of the motion capture's nodes, by their names: the client, and the emulated human with his Motive. Empty without a
    section `mocap`."""
    spec = experiment.mocap
    if spec is None:
        return {}
    base = {} if spec.base_from_mocap is None else {"base_from_mocap": dict(spec.base_from_mocap)}
    frame = f"{experiment.robot.arm_id}_link0"
    ports = {key: spec.stream[key] for key in ("command_port", "data_port") if key in spec.stream}
    client = {"body": spec.body, "up_axis": spec.stream.get("up_axis", "y"), **ports, **base, **({"base_frame": frame} if base else {})}
    human = {"human": located(spec.human, Path.cwd()), "stream": dict(spec.stream), **base, "base_frame": frame, "seed": seed}
    return {MOCAP_CLIENT: client, EMULATED_HUMAN: human}


def check_setpoint(setpoint: SetPoint, joints: Sequence[str], limits: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse a set point that the controller would refuse, before anything moves.

    Args:
        setpoint: what is to be sent.
        joints: the controller's joints.
        limits: per joint, lower and upper if there are any [rad].

    Raises:
        ExperimentError: wrong length, or outside the range of a joint.
    """
    where = f"set point at {setpoint.time:g} s for {setpoint.controller}"
    if len(setpoint.positions) != len(joints):
        raise ExperimentError(f"{where} has {len(setpoint.positions)} positions; valid: {len(joints)}, for {', '.join(joints)}")
    for joint, position in zip(joints, setpoint.positions, strict=True):
        bounds = limits.get(joint, {})
        low, high = bounds.get("lower", -math.inf), bounds.get("upper", math.inf)
        if not low <= position <= high:
            raise ExperimentError(f"{where}: {joint} {position:g} rad is outside {low:g} to {high:g}")


def overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes`, group by group."""
    result = copy.deepcopy(dict(base))
    for key, value in changes.items():
        old = result.get(key)
        result[key] = overlay(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else copy.deepcopy(value)
    return result
