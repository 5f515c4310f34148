"""Joint-space PD control with gravity compensation: thesis, eq. 3, with the rate of torque limited."""

from __future__ import annotations

from typing import Any

from std_msgs.msg import Float64MultiArray

from control_msgs.msg import JointTrajectoryControllerState
from hric_control import realtime
from hric_control.controller import Controller
from hric_control.errors import CommandError, ParameterError
from hric_control.hardware_interface import EffortJointInterface
from hric_control.node import Node
from hric_control.realtime import LatestValue
from hric_control.robot_hw import RobotHW
from hric_controllers.dynamics import wanted_gravity
from hric_controllers.parameters import Every, flag, joint_names, number, per_joint, position_ranges
from hric_controllers.pd_gains import LiveGains, read_gains
from hric_controllers.pd_law import PdLaw
from hric_controllers.setpoint import check_setpoint
from hric_controllers.stability import make_check
from hric_controllers.state_message import build_state
from hric_controllers.trapezoid import TrapezoidProfile


class JointPDController(Controller):
    """tau = Kp (q_d - q) - Kd dq [+ g(q)]; parameters and topics: INTERFACE.md."""

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read everything first, then advertise, so that a refusal leaves nothing behind."""
        node = self._node = controller_node
        self.joints = joint_names(node)
        self._group = robot_hw.get(EffortJointInterface).group(self.joints)
        gains = read_gains(node, self.joints)
        self._live = LiveGains(node, self.joints, gains)
        self._law = PdLaw(gains.kp, gains.kd, number(node, "rotatum_limit", 1000.0, minimum=0.0), number(node, "gain_ramp", 1.0, minimum=0.0))
        self._gravity = wanted_gravity(robot_hw, root_node, node, self.joints)
        self._check_kd = make_check(robot_hw, root_node, node, self.joints, flag(node, "strict_gains", False))
        self._warn(self._check_kd(gains.kd))
        self._profile = self._read_profile()
        self._use_profile = flag(node, "profile/enabled", True)
        self._ranges = position_ranges(root_node, self.joints)
        self._initial = self._read_initial()
        self._setpoint: LatestValue[list[float] | None] = LatestValue(None)
        self._new_gains: LatestValue[Any] = LatestValue(None)
        self._state_time = Every(number(node, "state_publish_rate", 100.0, minimum=0.0))
        self._running = False
        self._open()

    def _open(self) -> None:
        node = self._node
        self._live.publish_start()
        self._state = realtime.publisher(node, "state", JointTrajectoryControllerState)
        self._registrations = [
            node.live_parameters(self._live.parameters(), self._on_gains),
            node.subscribe("command", Float64MultiArray, self._on_command, queue_size=1),
            self._state,
        ]

    def _warn(self, text: str) -> None:
        if text:
            self._node.log_warn(text)

    def _read_profile(self) -> TrapezoidProfile:
        velocity = per_joint(self._node, "profile/velocity", self.joints, 1.0, above=0.0)
        acceleration = per_joint(self._node, "profile/acceleration", self.joints, 5.0, above=0.0)
        return TrapezoidProfile(velocity, acceleration)

    def _read_initial(self) -> list[float] | None:
        if not self._node.has_param("setpoint"):
            return None
        values = per_joint(self._node, "setpoint", self.joints)
        try:
            return check_setpoint(values, self.joints, self._ranges)
        except CommandError as error:
            raise ParameterError(f"{self._node.resolve('setpoint')}: {error}") from None

    def _on_command(self, message: Any) -> None:
        """A refusal is logged with the topic's name."""
        if not self._running:
            raise CommandError("the controller is not running, the set point is ignored; start it first")
        try:
            self._setpoint.set(check_setpoint(message.data, self.joints, self._ranges))
        except CommandError as error:
            raise CommandError(f"set point refused, the one before stays: {error}") from None

    def _on_gains(self, values: dict[str, Any]) -> dict[str, Any]:
        """Live parameters changed: all values are taken, or a HricError refuses them all."""
        wanted = self._live.wanted(values)
        if wanted != self._live.gains:
            self._warn(self._check_kd(wanted.kd))
            self._live.gains = wanted
            self._new_gains.set(wanted)
        return dict(self._live.values())

    def starting(self, time: float) -> None:
        """Hold where the arm is, or go to the parameter `setpoint`."""
        q = self._group.positions()
        # The arm that compensates gravity feels 0 before; one that does not must be carried from the first cycle on.
        self._law.start(self._gravity(q) if self._gravity else [0.0] * len(q))
        self._setpoint.take_new()
        self._profile.hold(time, q)
        if self._initial is not None:
            self._go(time, self._initial)
        self._state_time.restart()
        self._running = True

    def _go(self, time: float, setpoint: list[float]) -> None:
        if self._use_profile:
            self._profile.plan(time, setpoint)
        else:
            self._profile.hold(time, setpoint)

    def update(self, time: float, period: float) -> None:
        """One millisecond of eq. 3, on plain floats."""
        setpoint = self._setpoint.take_new()
        if setpoint is not None:
            self._go(time, setpoint)
        gains = self._new_gains.take_new()
        if gains is not None:
            self._law.change_gains(time, gains.kp, gains.kd)
        group = self._group
        q, dq = group.positions(), group.velocities()
        q_d, dq_d = self._profile.sample(time)
        tau = self._law.torque(time, period, q, dq, q_d, self._gravity)
        group.set_command(tau)
        if self._state_time.due(time):
            self._publish(q, dq, q_d, dq_d, tau)

    def _publish(self, q: list[float], dq: list[float], q_d: list[float], dq_d: list[float], tau: list[float]) -> None:
        stamp, efforts = self._node.now(), self._group.efforts()
        self._state.publish(build_state, JointTrajectoryControllerState, stamp, self.joints, (q_d, dq_d, [], tau), (q, dq, [], efforts))

    def stopping(self, time: float) -> None:
        """From here on set points are refused."""
        self._running = False

    def shutdown(self) -> None:
        """Take back topics and live parameters."""
        for registration in self._registrations:
            registration.unregister()
