"""Functions of `Simulation` for callers that run it in short parts: commands to controllers, and reset in place."""

from collections.abc import Sequence
from dataclasses import dataclass
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
from hric_run.definition.parameters import HUMAN, LOAD_SERVICE, ROBOT, SEED_STEP, load_request

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


@dataclass(frozen=True)
class ControlledRobot:
    """Robot with its controller manager and the controllers that an experiment starts in it.

    Attributes:
        app: robot and controller manager.
        node: node of the robot's namespace.
        definition: the experiment; of one of several arms, the part that concerns this arm.
        prefix: namespace of the robot below that of the run, with a slash at its end; empty if it is the same.
    """

    app: RobotApp
    node: LocalNode
    definition: Experiment
    prefix: str = ""

    @property
    def controllers(self) -> list[str]:
        """Names of the controllers, with the namespace of the robot."""
        return [f"{self.prefix}{name}" for name in self.definition.controllers]

    def load_controllers(self) -> None:
        """Load the controllers, set the payload, and start the controllers; errors are raised."""
        for name in self.definition.controllers:
            self.app.manager.load(name)
        request = None if self.definition.arms else load_request(self.definition.robot)
        if request is not None:
            response = self.node.call(LOAD_SERVICE, request)
            if not response.success:
                raise HricError(f"{self.prefix}robot.load: {response.error}")
        self.app.manager.switch(list(self.definition.controllers), [], loop_running=False)

    def failures(self) -> list[str]:
        """Return a text for each controller that was stopped by an error."""
        items = self.app.manager.list()
        return [f"controller {self.prefix}{item.name} was stopped, {item.error}" for item in items if item.error]


def controlled_robots(app: RobotApp, node: LocalNode, definition: Experiment) -> list[ControlledRobot]:
    """Return the robot of an experiment and, if there are several arms, each arm."""
    apps = app.hw.apps
    return [
        ControlledRobot(apps[prefix[:-1]] if prefix else app, node.child(prefix) if prefix else node, part, prefix)
        for prefix, part in definition.robots().items()
    ]


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


def return_to_start(
    app: RobotApp, node: LocalNode, definition: Experiment, robots: Sequence[ControlledRobot], seed: int
) -> None:
    """Reset robot, plant, person and controllers, so that the next run equals that of a new simulation bit for bit.

    Args:
        app: robot and controller manager; called by the thread that runs the cycles.
        node: node of the robot's namespace.
        definition: the experiment.
        robots: result of `controlled_robots`.
        seed: seed of all random numbers.
    """
    hw = simulated(app)
    for index, robot in enumerate(robots[1:] or robots):
        own = robot.definition.robot.plant.get("seed", seed + index * SEED_STEP)
        node.set_param(f"{robot.prefix}{ROBOT}/plant/seed", own)
    if definition.human is not None:
        node.set_param(f"{ROBOT}/participants/{HUMAN}/seed", definition.human.get("seed", seed))
    for robot in robots:
        manager = robot.app.manager
        manager.switch([], [item.name for item in manager.list() if item.state == "running"])
    hw.reset()
    # A cycle without effect takes the request to restart controllers, which a new process does not have.
    hw.loop.run(lambda *_: False)
    hw.loop.cycles, hw.loop.time = 0, 0.0
    for robot in robots:
        robot.app.cycles = 0
        robot.app.manager.update(0.0, hw.period)
    for robot in robots:
        robot.app.hw.read(0.0, 0.0)  # as before the controllers of a new process start
    for robot in robots:
        robot.app.manager.switch(list(robot.definition.controllers), [])
