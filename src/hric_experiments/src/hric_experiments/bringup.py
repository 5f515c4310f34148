"""What the launch files ask of an experiment: the robot's description and parameters, and its controllers.

Without an experiment ("none") the same code serves a plain bring-up: a Panda with the overrides of the launch arguments.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import yaml

from hric_control.errors import HricError
from hric_experiments import description, experiment, overrides, parameters
from hric_experiments.experiment import Experiment

NONE = "none"
PLAIN: dict[str, Any] = {
    "description": "plain bring-up",
    "robot": {"hw": "franka_sim/FrankaHWSim", "description": {"hand": True}},
    "controllers": ["joint_state_controller", "franka_state_controller", "joint_pd_controller"],
    "duration": 1.0,
}
"""What a bring-up without an experiment is, in the form of an experiment file; its duration has no meaning."""


def load(name: str, given: Sequence[str]) -> Experiment:
    """An experiment by name or path, or the plain bring-up, with overrides.

    Raises:
        HricError: no such experiment, or a mistake in an override.
    """
    return experiment.parse("bringup", overrides.apply(PLAIN, given)) if name == NONE else experiment.load(name, given)


def robot_parameters(definition: Experiment) -> dict[str, Any]:
    """Private parameters of the robot node."""
    return parameters.robot(definition, seed=0) | {"robot_hw": definition.robot.hw}


def print_for_launch(arguments: Sequence[str]) -> str:
    """What `rosrun hric_experiments describe WHAT EXPERIMENT key:=value ...` prints; WHAT is urdf or robot.

    Raises:
        HricError: a mistake in the arguments.
    """
    if len(arguments) < 2 or arguments[0] not in ("urdf", "robot"):
        raise HricError("usage: rosrun hric_experiments describe urdf|robot EXPERIMENT|none [key:=value ...]")
    definition = load(arguments[1], arguments[2:])
    return description.load(definition.robot) if arguments[0] == "urdf" else str(yaml.safe_dump(robot_parameters(definition)))
