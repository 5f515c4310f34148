"""Where an engine puts the links of an experiment's robot at its start: what thesis fig. 18 shows, told by the engine itself."""

from __future__ import annotations

from hric_control import urdf
from hric_control.errors import HricError
from hric_control.local_node import LocalNode
from hric_control.plant import FloatArray, Plant
from hric_control.robot_app import RobotApp
from hric_experiments import description, parameters
from hric_experiments.experiment import Experiment


def start_poses(definition: Experiment) -> dict[str, FloatArray]:
    """T_world_link of each link that the engine knows, shape (4, 4), in the order of the description.

    Raises:
        HricError: the robot cannot be built, or has no plant.
    """
    text = description.load(definition.robot)
    values = parameters.robot(definition) | {"real_time_factor": 0.0}
    node = LocalNode({"robot_description": text, "joint_limits": parameters.joint_limits(definition), parameters.ROBOT: values})
    app = RobotApp(node, node.child(parameters.ROBOT))
    try:
        plant = getattr(app.hw, "plant", None)
        if not isinstance(plant, Plant):
            raise HricError(f"{definition.robot.hw} has no plant: its links cannot be asked for")
        found = {}
        for link in urdf.parse(text).findall("link"):
            name = link.get("name", "")
            found[name] = plant.link_state(name)[0]
        return found
    finally:
        app.shutdown()
