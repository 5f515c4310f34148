"""Controller that publishes the wrenches of the robot's force-torque sensors on the topics of ros_controllers."""

from dataclasses import dataclass

from geometry_msgs.msg import WrenchStamped

from hric_control.controller import Controller
from hric_control.hardware_interface import ForceTorqueSensorInterface
from hric_control.robot_hw import RobotHW
from hric_controllers.parameters import HIGHEST_RATE, LOWEST_RATE
from hric_core import realtime
from hric_core.geometry import stamped
from hric_core.node import Node
from hric_core.parameters import Settings, number


@dataclass(frozen=True)
class ForceTorqueSettings(Settings):
    """Parameter of the force-torque sensor controller."""

    publish_rate: float = number(minimum=LOWEST_RATE, maximum=HIGHEST_RATE, unit="Hz", text="rate of the wrenches")


class ForceTorqueSensorController(Controller):
    """Publisher of each sensor's wrench, on a topic with the name of the sensor in the robot's namespace."""

    settings = (ForceTorqueSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the sensors, and advertise their topics."""
        self._node = controller_node
        self._time = realtime.Throttle(ForceTorqueSettings.read(controller_node).publish_rate)
        interface = robot_hw.get(ForceTorqueSensorInterface)
        sensors = [interface.handle(name) for name in interface.names]
        self._publishers = [(sensor, realtime.publisher(root_node, sensor.name, WrenchStamped)) for sensor in sensors]

    def starting(self, time: float) -> None:
        """Make the first cycle publish."""
        self._time.restart()

    def update(self, time: float, period: float) -> None:
        """Publish if it is time to do so, by `publish_rate`."""
        if self._time.due(time):
            stamp = self._node.now()
            for sensor, publisher in self._publishers:
                head = stamped.header(stamp, sensor.frame_id)
                publisher.publish(stamped.wrench_stamped, head, [*sensor.force, *sensor.torque])
