"""Parameters common to all robots, and the plugin that they name."""

from dataclasses import dataclass

from hric_control.robot_hw import RobotHW
from hric_control.sim.sim_loop import REAL_TIME_FACTOR
from hric_control.transmission import robot_sim_type
from hric_core import plugins
from hric_core.errors import DescriptionError
from hric_core.node import Node
from hric_core.parameters import Settings, flag, number, text

COMMON_PARAMETERS = ("arm_id", "failure", "participants", "plant", "plant_type", "q_start", "realism")
"""Private parameters that are valid for every robot, as one experiment file is used for simulated and real robots.

An experiment sets them, except `failure`, in which the robot node reports why it ended."""


@dataclass(frozen=True)
class RobotSettings(Settings):
    """Parameters common to all robots; each type of robot has further ones."""

    robot_hw: str = text(
        "", valid="a type", text="plugin type of the RobotHW; empty: `robotSimType` of the description"
    )
    real_time_factor: float = REAL_TIME_FACTOR
    control_log: bool = flag(True, text="publish `control_log`")
    wait_for_log_listener: float = number(
        0.0,
        minimum=0.0,
        unit="s of wall time",
        text="longest time for which the run waits at robot time 0 until `control_log` has a subscriber, so that a "
        "recording has every cycle",
    )


def robot_hw_type(root_node: Node, robot_hw_node: Node) -> str:
    """Return the type of the RobotHW plugin: the parameter `robot_hw`, or else `robotSimType` in the description.

    Raises:
        HricError: neither is set; the message lists the existing types.
    """
    type_name = RobotSettings.read(robot_hw_node).robot_hw or robot_sim_type(
        root_node.search_param("robot_description", "<robot/>")
    )
    if not type_name:
        valid = ", ".join(sorted(plugins.names(plugins.ROBOT_HW))) or "none"
        raise DescriptionError(
            f"{robot_hw_node.resolve('robot_hw')} is not set and robot_description has no robotSimType; valid: {valid}"
        )
    return type_name


def new_robot_hw(root_node: Node, robot_hw_node: Node) -> tuple[str, RobotHW]:
    """Return the RobotHW type, as `robot_hw_type`, and a new robot of that plugin. Raises HricError."""
    name = robot_hw_type(root_node, robot_hw_node)
    return name, plugins.find(plugins.ROBOT_HW, name)()
