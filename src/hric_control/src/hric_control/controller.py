"""Controller base class: methods that the manager calls in the order of ros_control's life cycle."""

from hric_control.robot_hw import RobotHW
from hric_core.node import Node


class Controller:
    """Base of all controllers.

    A controller class is found by its type string through the package.xml plugin export, is constructed without
    arguments, and gets everything else in `init`. States: constructed -> initialized -> running <-> stopped.
    """

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read parameters, take handles, advertise and subscribe. Called once, outside the loop; may take its time.

        Args:
            robot_hw: interfaces; a handle of a command interface claims its joints.
            root_node: the robot's namespace (robot_description, other topics).
            controller_node: the controller's own namespace (its parameters, `command`, `state`).

        Raises:
            HricError: the controller cannot run; the manager refuses to load it with this text.
        """

    def starting(self, time: float) -> None:
        """Prepare to run, as first call in the loop after a start or restart; `update` follows in the same cycle.

        Must not block.

        Args:
            time: robot time, never backwards [s].
        """

    def update(self, time: float, period: float) -> None:
        """Read the state and write the command, each cycle in the loop's thread. Must not block on ROS, disk or locks.

        Args:
            time: robot time [s].
            period: time since the last cycle [s].

        Raises:
            HricError: the control law cannot continue; the manager stops this controller and the robot holds.
        """

    def stopping(self, time: float) -> None:
        """Finish, as last call in the loop before the joints are released. Must not block."""

    def shutdown(self) -> None:
        """Release what `init` took. Called once at unload, outside the loop.

        What it advertised, subscribed and offered through its nodes is taken back by the manager afterwards.
        """
