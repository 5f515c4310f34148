"""Cartesian impedance control with a null-space posture, like franka_ros's CartesianImpedanceExampleController."""

import math
from dataclasses import asdict
from typing import Any, ClassVar

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from franka_hw_interface.model import FrankaFrame
from hric_control.controller import Controller, SettingsClasses
from hric_control.hardware_interface import EffortJointInterface
from hric_control.robot_hw import RobotHW
from hric_control.speed_scale import SpeedScale, SpeedScaleInterface
from hric_controllers.cartesian.arm import cartesian_arm
from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw, Compliance, limited
from hric_controllers.cartesian.options import ImpedanceOptions
from hric_controllers.cartesian.settings import CartesianImpedanceSettings, ComplianceSettings
from hric_controllers.cartesian.workspace import JumpSettings, new_equilibrium
from hric_controllers.dynamics import added_gravity, rotor_inertia
from hric_core import realtime
from hric_core.geometry import Pose, stamped
from hric_core.node import Node, ParameterValues


class CartesianImpedanceController(Controller):
    """Cartesian impedance controller: the law of module `law` with a limited torque rate.

    INTERFACE.md lists its parameters and topics. A subclass that gets its equilibrium from another source than the
    topic `equilibrium_pose` overrides `_read_input`, `_open_input`, `_start_input`, `_lead` and `_obeys`.

    Attributes:
        bounded_work: True if an energy tank can bound the work of the law.
    """

    bounded_work: ClassVar[bool] = True
    settings: SettingsClasses = (CartesianImpedanceSettings, ComplianceSettings)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, get the hardware interfaces, and then advertise the topics.

        An error in a parameter or interface thus leaves no topic behind.
        """
        node = self._node = controller_node
        settings, self._gain_settings = CartesianImpedanceSettings.read(node), ComplianceSettings.read(node)
        self.joints = list(settings.joints)
        self._group = robot_hw.get(EffortJointInterface).group(self.joints)
        self._robot, self._model, self._base = cartesian_arm(
            robot_hw, root_node, self._group, settings.arm_id, settings.end_effector, node.resolve("end_effector")
        )
        self._gravity = added_gravity(robot_hw, root_node, node, self.joints) if settings.gravity else None
        self._rotors = np.diag(rotor_inertia(robot_hw, settings.rotor_inertia, self.joints)[0])
        compliance = Compliance(**asdict(self._gain_settings))
        self._law = self._new_law(compliance, settings.filter_time)
        self._law.error_limits = settings.error_limit.limits()
        self._max_rate = settings.rotatum_limit
        obeys = self._obeys(settings.filter_time)
        self._scale = robot_hw.get(SpeedScaleInterface).handle() if obeys else SpeedScale()
        self._options = ImpedanceOptions(settings, root_node, node, self._base, self.bounded_work)
        self._beside = (root_node if robot_hw.shared else node).beside
        self._read_input()
        self._posture = settings.posture(root_node, node)
        self._gains, self._softest = realtime.LatestValue(compliance), math.inf
        self._state_time = realtime.Throttle(settings.state_publish_rate)
        self._running = False
        self._open()

    def _new_law(self, compliance: Compliance, filter_time: float) -> CartesianLaw:
        """Return the control law with these gains; `filter_time`: time constant of equilibrium and gains [s]."""
        return CartesianLaw(compliance, filter_time)

    def _obeys(self, filter_time: float) -> bool:
        """Return True if the speed scale can slow the equilibrium down.

        Without a filter (`filter_time` [s] is 0) the equilibrium jumps to its target, which cannot be slowed down.
        """
        return filter_time > 0.0

    def _read_input(self) -> None:
        """Read the parameters of the equilibrium's input, here the topic `equilibrium_pose`."""
        self._jump = JumpSettings.read(self._node)
        self._target: realtime.LatestValue[Pose | None] = realtime.LatestValue(None)

    def _open_input(self) -> None:
        """Subscribe to the topics of the equilibrium's input."""
        self._node.subscribe("equilibrium_pose", PoseStamped, self._on_equilibrium, queue_size=1)

    def _start_input(self) -> None:
        """Discard what the equilibrium's input received before the controller's start."""
        self._target.take_new()

    def _lead(self, time: float, period: float) -> None:
        """Give the law the newest target of its equilibrium, at robot time `time` [s] in a cycle of `period` [s]."""
        target = self._target.take_new()
        if target is not None:
            self._law.target = target

    def _open(self) -> None:
        node = self._node
        self._publishers = (
            realtime.publisher(node, "desired_pose", PoseStamped),
            realtime.publisher(node, "measured_pose", PoseStamped),
            realtime.publisher(node, "commanded_wrench", WrenchStamped),
        )
        self._gain_settings.offer(node, self._on_gains)
        self._options.open()
        self._open_input()

    def _on_gains(self, values: ParameterValues) -> ParameterValues:
        """Pass changed live parameters to the loop and return the applied values."""
        requested = Compliance(**values)
        if requested != self._gains.get():
            self._gains.set(requested)
        return requested._asdict()

    def _on_equilibrium(self, message: Any) -> None:
        """Check an equilibrium pose and pass it to the loop.

        Raises:
            CommandError: the pose is refused; the node logs the error's text with the topic's name.
        """
        self._target.set(new_equilibrium(message, self._base, self._law.pose, self._jump, self._running))

    def starting(self, time: float) -> None:
        """Set the equilibrium to the pose of the end effector."""
        q = self._group.positions()
        self._take_gains()
        self._start_input()
        measured = Pose.of_column_major(self._robot.O_T_EE)
        self._law.start(measured, q if self._posture is None else self._posture)
        self._options.start(self._law, measured, q)
        self._last = self._gravity(q) if self._gravity else [0.0] * len(q)
        self._state_time.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """Compute and command the torques of one cycle."""
        law, model, robot, options = self._law, self._model, self._robot, self._options
        self._lead(time, period)
        self._take_gains()
        law.advance(period, self._scale.value)
        measured = Pose.of_column_major(robot.O_T_EE)
        options.admit(law, measured, robot.q)
        mass = model.mass() + self._rotors
        jacobian = model.zero_jacobian(FrankaFrame.END_EFFECTOR)
        arm = CartesianArmState(robot.q, robot.dq, jacobian, mass, model.coriolis())
        tau = options.added(law, measured, arm, law.torque(measured, arm), period, self._scale.force)
        gravity = None if self._gravity is None else self._gravity(self._group.positions())
        if gravity is not None:
            tau = [a + b for a, b in zip(tau, gravity, strict=True)]
        self._command(tau, period)
        options.hold(self._last, gravity)
        if self._state_time.due(time):
            self._publish(measured)

    def _take_gains(self) -> None:
        """Give the law new live gains, and the limits of force and stiffness that a supervisor has set."""
        law, scale = self._law, self._scale
        if self._gains.take_new() is not None or scale.stiffness != self._softest:
            self._softest = scale.stiffness
            law.target_compliance = self._gains.get().softened(self._softest)
        law.force_limit = scale.force

    def _command(self, tau: list[float], period: float) -> None:
        """Limit the rate of the torques (n floats [N m]) and command them; `period`: time since the last ones [s]."""
        self._last = limited(tau, self._last, self._max_rate * period)
        self._group.set_command(self._last)

    def _publish(self, measured: Pose) -> None:
        stamp, desired, wrench = self._node.now(), self._law.pose, self._law.wrench
        base = self._base
        self._publishers[0].publish(lambda: stamped.pose_stamped(stamped.header(stamp, base), desired))
        self._publishers[1].publish(lambda: stamped.pose_stamped(stamped.header(stamp, base), measured))
        self._publishers[2].publish(lambda: stamped.wrench_stamped(stamped.header(stamp, base), wrench))
        self._options.publish()

    def stopping(self, time: float) -> None:
        """Stop accepting equilibrium poses and wrenches."""
        self._running = False
        self._options.stop()
