"""Controllers whose end effector follows a marker (thesis ch. 3.3) or moves to commanded poses."""

from franka_hw_interface.interfaces import FrankaPoseCartesianInterface
from hric_control.controller import Controller
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScaleInterface
from hric_controllers.cartesian.impedance import CartesianImpedanceController
from hric_controllers.marker.parameters import TrackingSettings
from hric_controllers.marker.pose_tracking import PoseTracking
from hric_controllers.parameters import ArmSettings
from hric_core.node import Node


class CartesianPoseController(Controller):
    """Controller that moves the end effector to a marker or commanded pose by the arm's own Cartesian pose motion.

    `PoseTracking` computes the desired poses. INTERFACE.md lists the parameters and topics.
    """

    settings = (ArmSettings, TrackingSettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = controller_node
        arm_id = ArmSettings.read(node).arm_id
        self._arm = robot_hw.get(FrankaPoseCartesianInterface).handle(f"{arm_id}_robot")
        scale = robot_hw.get(SpeedScaleInterface).handle()
        beside = (root_node if robot_hw.shared else node).beside
        self._tracking = PoseTracking(node, f"{arm_id}_link0", scale, beside)
        self._tracking.open()

    def starting(self, time: float) -> None:
        """Start the motion at the last commanded pose of the arm."""
        self._tracking.start(self._arm.robot_state.O_T_EE_c)

    def update(self, time: float, period: float) -> None:
        """Advance the motion by one cycle and command its pose to the arm."""
        tracking = self._tracking
        tracking.update(time, period)
        self._arm.set_command(tracking.transform())
        tracking.publish(time, self._arm.robot_state.O_T_EE)

    def stopping(self, time: float) -> None:
        """Stop accepting commanded poses."""
        self._tracking.stop()


class CartesianPoseImpedanceController(CartesianImpedanceController):
    """Cartesian impedance controller whose equilibrium follows a marker or moves to commanded poses.

    `PoseTracking` computes the equilibrium. INTERFACE.md lists the parameters and topics.
    """

    settings = (*CartesianImpedanceController.settings, TrackingSettings)

    def _obeys(self, filter_time: float) -> bool:
        """Return True: the speed scale slows the planned motion of the equilibrium down, with any filter time."""
        return True

    def _read_input(self) -> None:
        self._tracking = PoseTracking(self._node, self._base, self._scale, self._beside)

    def _open_input(self) -> None:
        self._tracking.open()

    def _start_input(self) -> None:
        """Start the equilibrium at the end effector's pose, so that the spring force is zero."""
        self._tracking.start(self._robot.O_T_EE)

    def _lead(self, time: float, period: float) -> None:
        """Set the equilibrium to the desired pose, without filter since its motion is smooth, and set its velocity."""
        tracking, law = self._tracking, self._law
        tracking.update(time, period)
        law.pose = law.target = tracking.pose
        law.twist = tracking.twist
        tracking.publish(time, self._robot.O_T_EE)

    def stopping(self, time: float) -> None:
        """Stop accepting commanded poses."""
        super().stopping(time)
        self._tracking.stop()
