"""Message printed when a bring-up is ready: what runs, how to move the arm, where data is recorded, how to end."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from bringup_arguments import EMULATED, EXPERIMENTS, UR5E, WORKSPACE
from bringup_master import DEFAULT

from hric_control.plant import DEFAULT_PLANT

PERIOD = 0.2
"""Period of the check whether all nodes are ready [s]."""
POSITIONS = "[0.3, -0.785, 0, -2.356, 0, 1.571, 0.785]"
"""Joint positions of the example command: the default start pose of the arm, with joint 1 moved [rad]."""
UR_POSITIONS = "[2.84, -1.57, 1.57, -1.57, -1.57, 0]"
"""Joint positions of the example command for a UR5e: the start pose of its experiments, with joint 1 moved [rad]."""
UR_JOINTS = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]

Parameter = Callable[[str], Any]
"""Function that returns the value of a ROS parameter, or None if it does not exist."""


def block(
    arguments: Mapping[str, str], master: str, parameter: Parameter, is_running: Callable[[str], bool]
) -> str | None:
    """Return the message, or None if the controllers, the recording or the window have not started yet.

    Args:
        arguments: checked arguments of bringup.launch.
        master: address of the master.
        parameter: function that reads a ROS parameter.
        is_running: function that returns whether a node of the bring-up runs.
    """
    space = namespace(arguments)
    started, folder = parameter(f"{space}/spawner/started"), parameter(f"{space}/recorder/folder")
    if started is None or (_records_at_once(arguments) and not folder):
        return None
    window = parameter(f"{space}/hric/view/address")
    if arguments["view"] == "web" and not window and is_running("window"):
        return None
    terminal = f"source {WORKSPACE}/scripts/env" + ("" if master == DEFAULT else f" && export ROS_MASTER_URI={master}")
    rows = {
        "ready": f"{_robot(arguments)}; controllers {', '.join(started)}",
        **(
            {"see it": window or "the window did not open; its messages are above"}
            if arguments["view"] == "web"
            else {}
        ),
        "terminal": f"{terminal}      # first command in another terminal",
        "move it": _move(arguments, space),
        "record": _recording(arguments, space, folder),
        "end": "Ctrl-C" if arguments["experiment"] == "none" else "automatically after the experiment, or Ctrl-C",
    }
    width = max(map(len, rows))
    return "\n".join(f"  {name:<{width}}  {text}" for name, text in rows.items())


def namespace(arguments: Mapping[str, str]) -> str:
    """Return the robot's namespace with a leading slash; empty if it has none."""
    name = arguments["ns"].strip("/")
    return "" if name in ("", "none") else f"/{name}"


def arm(arguments: Mapping[str, str]) -> str:
    """Return a description of the arm at `robot_ip`."""
    if arguments["robot_ip"] == EMULATED:
        return f"emulated {arguments['robot']} ({engine(arguments)})"
    return f"{arguments['robot']} at {arguments['robot_ip']}"


def engine(arguments: Mapping[str, str]) -> str:
    """Return the name of the physics engine; auto is the one of the experiment file, or the default."""
    if arguments["simulator"] != "auto":
        return arguments["simulator"]
    name = arguments["experiment"]
    path = Path(name) if name.endswith((".yaml", ".yml")) else EXPERIMENTS / f"{name}.yaml"
    text = path.read_text() if name != "none" else ""
    selected = re.search(r"^ +plant_type: (\w+)_ros_control/", text, re.MULTILINE)
    return selected[1] if selected else DEFAULT_PLANT.partition("_ros_control/")[0]


def _records_at_once(arguments: Mapping[str, str]) -> bool:
    return arguments["record"] == "true" or (arguments["record"] == "auto" and arguments["experiment"] != "none")


def _robot(arguments: Mapping[str, str]) -> str:
    if arguments["env"] == "real":
        return arm(arguments)
    factor = float(arguments["real_time_factor"])
    pace = "as fast as possible" if factor == 0.0 else "real time" if factor == 1.0 else f"{factor:g} times real time"
    arms = arguments["arms"]
    what = "simulated Panda" if arms == "none" else f"simulated arms {arms.replace(',', ', ')} in one world"
    return f"{what} ({engine(arguments)}, {pace})"


def _move(arguments: Mapping[str, str], space: str) -> str:
    """Return a command that moves the arm; the manual describes the commands of other controllers."""
    name, arm_id = arguments["controller"], arguments["arm_id"]
    if arguments["arms"] != "none":
        arm_id = arguments["arms"].partition(",")[0]
        space = f"{space}/{arm_id}"
    if arguments["experiment"] != "none":
        return f"automatically, by the experiment {arguments['experiment']}"
    if name == "none":
        return f"rosrun controller_manager controller_manager{f' --namespace {space}' * bool(space)} start CONTROLLER"
    if name == "joint_pd_controller":
        return f"rostopic pub -1 {space}/{name}/command std_msgs/Float64MultiArray '{{data: {POSITIONS}}}'   # [rad]"
    if name.endswith("joint_trajectory_controller"):
        joints = ", ".join(f"{arm_id}_joint{number}" for number in range(1, 8))
        positions = POSITIONS
        if arguments["env"] == "real" and arguments["robot"] == UR5E:
            joints, positions = ", ".join(UR_JOINTS), UR_POSITIONS
        points = f"points: [{{positions: {positions}, time_from_start: {{secs: 3}}}}]"
        return (
            f"rostopic pub -1 {space}/{name}/command trajectory_msgs/JointTrajectory "
            f"'{{joint_names: [{joints}], {points}}}'"
        )
    return f"its topics: rostopic list | grep {space}/{name}/"


def _recording(arguments: Mapping[str, str], space: str, folder: Any) -> str:
    if folder:
        return f"into {folder}"
    if arguments["record"] == "false":
        return "nothing (record:=false)"
    if arguments["record"] == "on_trigger":
        return f"armed; start it with: rostopic pub -1 {space}/hric/experiment/trigger std_msgs/Empty"
    return (
        f"nothing yet; start it with: rosservice call {space}/hric/experiment/start_recording   (record:=true: at once)"
    )
