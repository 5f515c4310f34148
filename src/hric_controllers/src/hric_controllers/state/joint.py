"""Controller that publishes all joints on `joint_states`, like ros_control's joint_state_controller."""

from dataclasses import dataclass

from sensor_msgs.msg import JointState

from hric_control.controller import Controller
from hric_control.hardware_interface import JointStateInterface
from hric_control.robot_hw import RobotHW
from hric_controllers.parameters import HIGHEST_RATE, LOWEST_RATE
from hric_controllers.state.messages import joint_state
from hric_core import realtime
from hric_core.node import Node
from hric_core.parameters import Settings, listing, number, refused, section, text


@dataclass(frozen=True)
class ExtraJoint(Settings):
    """Joint that the robot does not measure, with constant values."""

    name: str = text(empty=False)
    position: float = number(0.0, unit="rad")
    velocity: float = number(0.0, unit="rad/s")
    effort: float = number(0.0, unit="N m")


@dataclass(frozen=True)
class JointStateSettings(Settings):
    """Parameters of the joint state controller."""

    publish_rate: float = number(minimum=LOWEST_RATE, maximum=HIGHEST_RATE, unit="Hz")
    extra_joints: tuple[ExtraJoint, ...] = listing(
        section(ExtraJoint),
        default=(),
        unit="rad, rad/s, N m",
        text="`{name, position, velocity, effort}`: constant values of joints that the robot does not measure",
    )


class JointStateController(Controller):
    """Publisher of sensor_msgs/JointState for every joint, on `joint_states` in the robot's namespace."""

    settings = (JointStateSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters `publish_rate` (required) and `extra_joints`, and advertise the topic."""
        self._node = controller_node
        self._group = robot_hw.get(JointStateInterface).group()
        settings = JointStateSettings.read(controller_node)
        self._time = realtime.Throttle(settings.publish_rate)
        extra = settings.extra_joints
        for joint in extra:
            if joint.name in self._group.names:
                raise refused(
                    controller_node.resolve("extra_joints"), joint.name, "a name that the robot does not have"
                )
        self._names = [*self._group.names, *(joint.name for joint in extra)]
        self._extra = (
            [joint.position for joint in extra],
            [joint.velocity for joint in extra],
            [joint.effort for joint in extra],
        )
        self._publisher = realtime.publisher(root_node, "joint_states", JointState)

    def starting(self, time: float) -> None:
        """Make the first cycle publish."""
        self._time.restart()

    def update(self, time: float, period: float) -> None:
        """Publish if it is time to do so, by `publish_rate`."""
        if self._time.due(time):
            stamp, group = self._node.now(), self._group
            position, velocity, effort = group.positions(), group.velocities(), group.efforts()
            more = self._extra
            self._publisher.publish(
                joint_state, stamp, self._names, position + more[0], velocity + more[1], effort + more[2]
            )
