"""Base class of controllers, with the life cycle of ros_control."""

from hric_control.robot_hw import RobotHW
from hric_core.node import Node
from hric_core.parameters import Settings

SettingsClasses = tuple[type[Settings], ...]
"""Settings classes that together declare the parameters of a controller."""


class Controller:
    """Base class of all controllers.

    The controller manager finds a controller class by its type string, as a plugin exported in package.xml, constructs
    it without arguments, and passes everything else to `init`. States: constructed -> initialized -> running <->
    stopped.

    Attributes:
        settings: settings classes that declare its parameters, for the form of `hric view`; empty: not declared.
    """

    settings: SettingsClasses = ()

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read parameters, get joint handles, advertise and subscribe to topics.

        Called once, when the controller is loaded, outside the control loop; it may block.

        Args:
            robot_hw: robot with its interfaces; getting a handle from a command interface claims the joints.
            root_node: node of the robot's namespace (robot_description, topics of the robot).
            controller_node: node of the controller's namespace (its parameters, `command`, `state`).

        Raises:
            HricError: the controller cannot run; the manager refuses to load it and reports this text.
        """

    def starting(self, time: float) -> None:
        """Prepare to run; called in the control loop at each start or restart, in the cycle of the first `update`.

        Must not block.

        Args:
            time: robot time, which never goes back [s].
        """

    def update(self, time: float, period: float) -> None:
        """Read the joint states and write the command; called in each cycle, in the control loop's thread.

        Must not block on ROS, disk or locks.

        Args:
            time: robot time [s].
            period: time since the last cycle [s].

        Raises:
            HricError: the control law cannot continue; the manager stops this controller, and the robot holds its pose.
        """

    def stopping(self, time: float) -> None:
        """Finish; the last call in the control loop before the joints are released. Must not block."""

    def shutdown(self) -> None:
        """Release resources that `init` acquired; called once, when the controller is unloaded, outside the loop.

        The manager unregisters afterwards all topics, services and actions that were created through the two nodes.
        """
