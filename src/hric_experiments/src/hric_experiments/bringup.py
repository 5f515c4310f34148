"""What the launch files ask of an experiment: the robot's description and parameters, and its controllers loaded and started.

Without an experiment ("none") the same code serves a plain bring-up: a Panda with the overrides of the launch arguments.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
import yaml

from hric_control.errors import HricError
from hric_control.manager_client import ManagerClient
from hric_control.spawner import Spawner, run_tool
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


def spawn() -> int:
    """The node: sets the controllers' parameters, loads all that are configured, starts those of the experiment. Answers the exit code.

    Parameters, private: experiment, overrides.
    """
    return run_tool(_spawn)


def _spawn() -> None:
    rospy.init_node("spawner")
    definition = load(str(rospy.get_param("~experiment", NONE)), str(rospy.get_param("~overrides", "")).split())
    for name, values in parameters.controllers(definition).items():
        rospy.set_param(name, values)
    client = ManagerClient()
    client.wait(30.0, rospy.logdebug)
    spawner = Spawner(client)
    spawner.up(definition.controllers, start=True)
    others = [name for name in parameters.defaults(definition.robot.arm_id) if name not in definition.controllers]
    if definition.robot.urdf == "":
        spawner.up(others, start=False)
    # The robot ends together with this node and takes its controllers with it: nothing to clean up.
    rospy.spin()
