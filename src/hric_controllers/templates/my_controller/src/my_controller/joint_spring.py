"""Controller with a spring and a damper at every joint, around the position at the start."""

from hric_control.controller import Controller
from hric_control.hardware_interface import EffortJointInterface


class JointSpring(Controller):
    """Controller that commands the torques stiffness (q_start - q) - damping dq."""

    def init(self, robot_hw, root_node, controller_node):
        """Read parameters and claim the joints. A wrong name raises an error that lists the valid ones."""
        self.joints = robot_hw.get(EffortJointInterface).group(controller_node.param("joints"))
        self.stiffness = controller_node.param("stiffness")  # [N m/rad]
        self.damping = controller_node.param("damping", 10.0)  # [N m s/rad]

    def starting(self, time):
        """Store the start position. This is the first call in the loop; `update` follows in the same cycle."""
        self.q_start = self.joints.position  # shape (n,) [rad]

    def update(self, time, period):
        """Read the joint states, and compute and command the torques, every millisecond.

        This runs in the control loop: it must not call ROS, open files or wait.
        """
        self.joints.command = (
            self.stiffness * (self.q_start - self.joints.position) - self.damping * self.joints.velocity
        )
