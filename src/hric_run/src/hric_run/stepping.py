"""Functions of `Simulation` for callers that run it in short parts: commands to controllers, and reset in place."""

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Float64MultiArray

from hric_control.limits import check_start
from hric_control.robot_app import RobotApp
from hric_control.sim.simulated_robot import SimulatedRobot
from hric_core.errors import HricError
from hric_core.geometry import Pose, stamped
from hric_core.local.node import LocalNode
from hric_run.definition.experiment import Experiment
from hric_run.definition.parameters import HUMAN, ROBOT

Command = Sequence[float] | Pose
"""Command to a controller: numbers for its topic `command`, or an equilibrium pose in the robot's base."""


class Commands:
    """Sender of commands to controllers; see `Simulation.command`.

    Args:
        node: node of the robot's namespace.
        controllers: names of the controllers, for error messages.
    """

    def __init__(self, node: LocalNode, controllers: Sequence[str]) -> None:
        self._node, self._controllers = node, controllers
        self._publishers: dict[str, Any] = {}

    def send(self, controller: str, command: Command) -> None:
        """Send a command to a controller. Raises HricError if nothing receives it, or the controller refuses it."""
        message: Any
        if isinstance(command, Pose):
            topic, message = "equilibrium_pose", stamped.pose_stamped(stamped.header(self._node.now(), ""), command)
        else:
            topic, message = "command", Float64MultiArray(data=[float(value) for value in command])
        publisher = self._publisher(f"{controller}/{topic}", PoseStamped if topic != "command" else Float64MultiArray)
        self._node.raises = True
        try:
            publisher.publish(message)
        finally:
            self._node.raises = False

    def _publisher(self, topic: str, kind: Any) -> Any:
        if topic not in self._publishers:
            publisher = self._node.advertise(topic, kind)
            if not publisher.subscribers():
                publisher.unregister()
                raise HricError(
                    f"nothing subscribes to {topic}; valid: a topic of a controller: {', '.join(self._controllers)}"
                )
            self._publishers[topic] = publisher
        return self._publishers[topic]


def simulated(app: RobotApp) -> SimulatedRobot:
    """Return the robot of an app. Raises HricError if it is not simulated in this process."""
    if not isinstance(app.hw, SimulatedRobot):
        raise HricError(f"{app.name} is not simulated in this process; valid for robot.hw: a SimulatedRobot")
    return app.hw


def set_start(app: RobotApp, node: LocalNode, q_start: Sequence[float]) -> None:
    """Set the start position of the robot, n floats [rad or m].

    Raises HricError if a position is far outside the range of its joint.
    """
    hw = simulated(app)
    check_start(hw.description, hw.states.names, q_start, "q_start")
    hw.q_start = [float(value) for value in q_start]
    node.set_param(f"{ROBOT}/q_start", hw.q_start)


def return_to_start(app: RobotApp, node: LocalNode, definition: Experiment, seed: int) -> None:
    """Reset robot, plant, person and controllers, so that the next run equals that of a new simulation bit for bit.

    Args:
        app: robot and controller manager; called by the thread that runs the cycles.
        node: node of the robot's namespace.
        definition: the experiment.
        seed: seed of all random numbers.
    """
    hw = simulated(app)
    node.set_param(f"{ROBOT}/plant/seed", definition.robot.plant.get("seed", seed))
    if definition.human is not None:
        node.set_param(f"{ROBOT}/participants/{HUMAN}/seed", definition.human.get("seed", seed))
    app.manager.switch([], [item.name for item in app.manager.list() if item.state == "running"])
    hw.reset()
    # A cycle without effect takes the request to restart controllers, which a new process does not have.
    hw.loop.run(lambda *_: False)
    hw.loop.cycles, hw.loop.time, app.cycles = 0, 0.0, 0
    app.manager.update(0.0, hw.period)
    hw.read(0.0, 0.0)  # as before the controllers of a new process start
    app.manager.switch(list(definition.controllers), [])
