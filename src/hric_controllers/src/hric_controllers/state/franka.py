"""Controller that publishes the state of the Franka arm on the topics of franka_ros."""

from dataclasses import dataclass

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from franka_hw_interface.interfaces import FrankaStateInterface
from franka_msgs.msg import FrankaState
from hric_control.controller import Controller
from hric_control.robot_hw import RobotHW
from hric_controllers.parameters import HIGHEST_RATE, LOWEST_RATE, ArmSettings
from hric_controllers.state import messages
from hric_core import realtime
from hric_core.node import Node
from hric_core.parameters import names, number


@dataclass(frozen=True)
class FrankaStateSettings(ArmSettings):
    """Parameters of the Franka state controller."""

    joint_names: tuple[str, ...] = names(7, text="names in the joint states")
    publish_rate: float = number(30.0, minimum=LOWEST_RATE, maximum=HIGHEST_RATE, unit="Hz")


class FrankaStateController(Controller):
    """Publisher of `franka_states`, `joint_states`, `joint_states_desired` and `F_ext`, and of the EE frames on /tf."""

    settings = (FrankaStateSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters `arm_id`, `joint_names` and `publish_rate` (30 Hz by default); advertise topics."""
        node = self._node = controller_node
        settings = FrankaStateSettings.read(node)
        self._arm_id, self._joints = settings.arm_id, list(settings.joint_names)
        self._time = realtime.Throttle(settings.publish_rate)
        self._state = robot_hw.get(FrankaStateInterface).handle(f"{self._arm_id}_robot").robot_state
        self._states = realtime.publisher(node, "franka_states", FrankaState)
        self._measured = realtime.publisher(node, "joint_states", JointState)
        self._desired = realtime.publisher(node, "joint_states_desired", JointState)
        self._wrench = realtime.publisher(node, "F_ext", WrenchStamped)
        self._tf = realtime.publisher(node, "/tf", TFMessage)
        self._publishers = self._states, self._measured, self._desired, self._wrench, self._tf

    def starting(self, time: float) -> None:
        """Make the first cycle publish."""
        self._time.restart()

    def update(self, time: float, period: float) -> None:
        """Publish if it is time to do so, by `publish_rate`; messages are built outside the loop from a snapshot."""
        if not self._time.due(time) or not any(publisher.needed for publisher in self._publishers):
            return
        state, stamp = self._state.snapshot(), self._node.now()
        self._states.publish(messages.franka_state, state, stamp)
        self._measured.publish(messages.joint_state, stamp, self._joints, state.q, state.dq, state.tau_J)
        self._desired.publish(messages.joint_state, stamp, self._joints, state.q_d, state.dq_d, state.tau_J_d)
        self._wrench.publish(messages.external_wrench, state.K_F_ext_hat_K, self._arm_id, stamp)
        self._tf.publish(messages.end_effector_frames, state.F_T_NE, state.NE_T_EE, state.EE_T_K, self._arm_id, stamp)
