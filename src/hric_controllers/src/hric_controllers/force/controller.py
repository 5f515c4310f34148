"""Controller that presses the end effector on a surface with a desired force: hybrid force and impedance control."""

import math
from typing import Any

from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Bool

from franka_hw_interface.interfaces import FrankaStateInterface
from hric_control.robot_hw import RobotHW
from hric_controllers.cartesian.impedance import CartesianImpedanceController
from hric_controllers.cartesian.law import CartesianLaw, Compliance
from hric_controllers.force.hybrid_law import HybridLaw
from hric_controllers.force.settings import AXES, ForceSettings
from hric_controllers.force.wrench import TaredWrench
from hric_controllers.parameters import ArmSettings
from hric_core import realtime
from hric_core.errors import CommandError
from hric_core.geometry import Pose, messages, stamped
from hric_core.node import Node


class ForceController(CartesianImpedanceController):
    """Controller of force along some axes of a task frame, and of impedance along the others.

    INTERFACE.md lists its parameters and topics; `force_axis` and `hybrid_law` compute the law.
    """

    settings = (*CartesianImpedanceController.settings, ForceSettings)
    bounded_work = False
    _law: HybridLaw

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Get the estimated external wrench, which only a Franka arm has, and initialise the base class."""
        self._arm_id = ArmSettings.read(controller_node).arm_id
        self._estimate = robot_hw.get(FrankaStateInterface).handle(f"{self._arm_id}_robot").robot_state
        super().init(robot_hw, root_node, controller_node)

    def _new_law(self, compliance: Compliance, filter_time: float) -> CartesianLaw:
        self._pressing = settings = ForceSettings.read(self._node)
        return HybridLaw(compliance, filter_time, settings.gains(), settings.frame == "end_effector")

    def _read_input(self) -> None:
        super()._read_input()
        settings = self._pressing
        self._wrench = TaredWrench(settings.tare_time)
        self._desired = realtime.LatestValue(settings.desired(settings.force))

    def _open_input(self) -> None:
        super()._open_input()
        self._felt = realtime.publisher(self._node, "measured_force", WrenchStamped)
        self._reference = realtime.publisher(self._node, "reference_force", WrenchStamped)
        self._contact = realtime.publisher(self._node, "contact", Bool)
        self._node.subscribe("desired_force", WrenchStamped, self._on_force, queue_size=1)

    def _on_force(self, message: Any) -> None:
        """Check a desired force and pass it to the loop.

        Raises:
            CommandError: the force is refused; the node logs the error's text with the topic's name.
        """
        if not self._running:
            raise CommandError("the controller is not running, the force is ignored; start it first")
        f, torque = message.wrench.force, message.wrench.torque
        x, y, z, *moment = messages.finite("wrench", f.x, f.y, f.z, torque.x, torque.y, torque.z)
        frame = f"{self._arm_id}_{'EE' if self._pressing.frame == 'end_effector' else 'link0'}"
        if message.header.frame_id.lstrip("/") not in ("", frame):
            raise CommandError(f"the force is given in the frame {message.header.frame_id!r}; valid: {frame}")
        if any(moment):
            raise CommandError(f"the desired torque is {moment}; valid: 0, only force is controlled")
        try:
            self._desired.set(self._pressing.desired((x, y, z)))
        except CommandError as error:
            raise CommandError(f"desired force ({x:g}, {y:g}, {z:g}) N refused; valid: {error}") from None

    def _start_input(self) -> None:
        """Start the tare of the wrench; the arm holds its pose meanwhile."""
        super()._start_input()
        self._wrench.start()
        self._desired.set(self._pressing.desired(self._pressing.force))
        self._law.press({})
        self._law.offset, self._stroked, self._rate = [0.0] * 3, 0.0, 0.0

    def _lead(self, time: float, period: float) -> None:
        """Pass the measured and the desired force to the law, and move the equilibrium along the `stroke`."""
        super()._lead(time, period)
        law = self._law
        self._exerted = self._wrench.advance(self._estimate.O_F_ext_hat_K, period)
        if self._exerted is None:
            return
        law.force, law.period, law.pace = self._exerted[:3], period, self._scale.value
        desired = self._desired.take_new()
        if desired == {}:
            if law.desired:  # a repeated 0 does not end the retraction
                self._release(self._pressing.retract)
        elif desired:
            law.press(desired)
        elif law.approached > self._pressing.approach_distance:
            self._give_up(law.approached)
        self._move(period)

    def _publish(self, measured: Pose) -> None:
        super()._publish(measured)
        if self._exerted is not None:
            head = stamped.header(self._node.now(), self._base)
            self._felt.publish(stamped.wrench_stamped, head, self._exerted)
            self._reference.publish(stamped.wrench_stamped, head, [*self._law.reference, 0.0, 0.0, 0.0])
            self._contact.publish(Bool, self._law.touching)

    def _give_up(self, distance: float) -> None:
        """End an approach of a `distance` [m] without contact: the arm holds its position."""
        self._release(0.0)
        text = (
            f"no surface: the arm moved by {distance:.3f} m without contact (approach_distance) and holds its position;"
            " publish a desired force to approach again"
        )
        realtime.defer(self._node, lambda: self._node.log_warn(text), "log")

    def _release(self, retract: float) -> None:
        """Move the equilibrium from the present position by `retract` [m] away from the surface."""
        law, x = self._law, list(self._robot.O_T_EE[12:15])
        law.pose = Pose((x[0], x[1], x[2]), law.pose.orientation)
        for index, desired in law.desired.items():
            back = math.copysign(retract, -desired)
            x = [a + back * b for a, b in zip(x, law.axis(index), strict=True)]
        law.target = Pose((x[0], x[1], x[2]), law.target.orientation)
        law.press({})
        law.offset, law.twist, self._stroked, self._rate = [0.0] * 3, [0.0] * 6, 0.0, 0.0

    def _move(self, period: float) -> None:
        """Advance the motion of the parameter `stroke` by one cycle, in contact only and slowed by the speed scale."""
        law, stroke = self._law, self._pressing.stroke
        if not law.desired or stroke.length == 0.0:
            return
        step = stroke.acceleration / stroke.speed * period
        goal = self._scale.value if law.touching else 0.0
        self._rate = max(self._rate - step, min(self._rate + step, goal))
        self._stroked += self._rate * period
        x, v = stroke.state(self._stroked)
        n = law.axis(AXES.index(stroke.axis))
        law.offset = [x * a for a in n]
        law.twist = [*(self._rate * v * a for a in n), 0.0, 0.0, 0.0]
