"""Publishes the state of the Franka arm on the topics of franka_ros."""

from __future__ import annotations

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from franka_hw_interface.interfaces import FrankaStateInterface
from franka_msgs.msg import FrankaState
from hric_control import realtime
from hric_control.controller import Controller
from hric_control.errors import ParameterError
from hric_control.node import Node
from hric_control.robot_hw import RobotHW
from hric_controllers import franka_message
from hric_controllers.joint_state import joint_state
from hric_controllers.parameters import Every, joint_names, number


class FrankaStateController(Controller):
    """`franka_states`, `joint_states`, `joint_states_desired`, `F_ext` below the controller, and the end-effector frames on /tf."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Parameters: `arm_id`, `joint_names` (7), `publish_rate` (30 Hz by default)."""
        node = self._node = controller_node
        self._arm_id = node.param("arm_id")
        if not isinstance(self._arm_id, str) or not self._arm_id:
            raise ParameterError(f"{node.resolve('arm_id')} is {self._arm_id!r}; valid: the arm's name, e.g. panda")
        self._joints = joint_names(node, "joint_names")
        if len(self._joints) != 7:
            raise ParameterError(f"{node.resolve('joint_names')} has {len(self._joints)} names; valid: the 7 joints of the arm")
        self._time = Every(number(node, "publish_rate", 30.0, above=0.0))
        self._state = robot_hw.get(FrankaStateInterface).handle(f"{self._arm_id}_robot").robot_state
        self._states = realtime.publisher(node, "franka_states", FrankaState)
        self._measured = realtime.publisher(node, "joint_states", JointState)
        self._desired = realtime.publisher(node, "joint_states_desired", JointState)
        self._wrench = realtime.publisher(node, "F_ext", WrenchStamped)
        self._tf = realtime.publisher(node, "/tf", TFMessage)

    def starting(self, time: float) -> None:
        """Publish in the first cycle."""
        self._time.restart()

    def update(self, time: float, period: float) -> None:
        """Publish at the rate; the messages are built outside the loop from a snapshot."""
        if not self._time.due(time):
            return
        state, stamp = self._state.snapshot(), self._node.now()
        self._states.publish(franka_message.franka_state, state, stamp)
        self._measured.publish(joint_state, stamp, self._joints, state.q, state.dq, state.tau_J)
        self._desired.publish(joint_state, stamp, self._joints, state.q_d, state.dq_d, state.tau_J_d)
        self._wrench.publish(franka_message.external_wrench, state.K_F_ext_hat_K, self._arm_id, stamp)
        self._tf.publish(franka_message.end_effector_frames, state.F_T_NE, state.NE_T_EE, state.EE_T_K, self._arm_id, stamp)

    def shutdown(self) -> None:
        """Stop advertising."""
        for publisher in (self._states, self._measured, self._desired, self._wrench, self._tf):
            publisher.unregister()
