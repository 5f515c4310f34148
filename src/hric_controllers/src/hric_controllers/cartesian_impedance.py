"""Cartesian impedance control with a posture in the null space, as franka_ros's CartesianImpedanceExampleController has it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, WrenchStamped

from franka_hw_interface.interfaces import FrankaModelInterface, FrankaStateInterface
from franka_hw_interface.model import Frame
from hric_control import realtime
from hric_control.controller import Controller
from hric_control.errors import CommandError, ParameterError
from hric_control.hardware_interface import EffortJointInterface
from hric_control.node import Node, Registration
from hric_control.realtime import LatestValue
from hric_control.robot_hw import RobotHW
from hric_controllers.cartesian_law import Arm, CartesianLaw, Compliance, FloatArray, Pose
from hric_controllers.compliance import checked, live_parameters, read_compliance
from hric_controllers.dynamics import wanted_gravity
from hric_controllers.equilibrium import JumpLimit, check_equilibrium, fill_pose
from hric_controllers.franka_message import to_quaternion
from hric_controllers.parameters import Every, joint_names, number, per_joint, position_ranges
from hric_controllers.setpoint import check_setpoint
from hric_controllers.stability import rotor_inertia


class CartesianImpedanceController(Controller):
    """The law of `cartesian_law`, with a limit on the rate of torque; parameters and topics: INTERFACE.md.

    A subclass may lead the equilibrium by other means: it overrides the four methods about the input.
    """

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read everything first, then advertise, so that a refusal leaves nothing behind."""
        node = self._node = controller_node
        self._arm_id = node.param("arm_id")
        if not isinstance(self._arm_id, str) or not self._arm_id:
            raise ParameterError(f"{node.resolve('arm_id')} is {self._arm_id!r}; valid: the arm's name, e.g. panda")
        self.joints = joint_names(node, "joint_names")
        expected = [f"{self._arm_id}_joint{i}" for i in range(1, 8)]  # the Jacobian's columns
        if self.joints != expected:
            raise ParameterError(f"{node.resolve('joint_names')} is {self.joints}; valid: the arm's joints in order, {', '.join(expected)}")
        self._group = robot_hw.get(EffortJointInterface).group(self.joints)
        self._robot = robot_hw.get(FrankaStateInterface).handle(f"{self._arm_id}_robot").robot_state
        self._model = robot_hw.get(FrankaModelInterface).handle(f"{self._arm_id}_model")
        self._gravity = wanted_gravity(robot_hw, root_node, node, self.joints)
        self._rotors = np.diag(rotor_inertia(robot_hw, node, self.joints)[0])
        self._law = CartesianLaw(read_compliance(node), number(node, "filter_time", 0.2, minimum=0.0))
        self._rotatum = number(node, "rotatum_limit", 1000.0, minimum=0.0)
        self._read_input()
        self._posture = self._read_posture(root_node)
        self._gains: LatestValue[Compliance | None] = LatestValue(None)
        self._state_time = Every(number(node, "state_publish_rate", 100.0, minimum=0.0))
        self._running = False
        self._open()

    def _read_input(self) -> None:
        """What says where the equilibrium is: parameters."""
        node = self._node
        self._jump = JumpLimit(number(node, "largest_step", 0.3, above=0.0), number(node, "largest_turn", 1.6, above=0.0))
        self._target: LatestValue[Pose | None] = LatestValue(None)

    def _open_input(self) -> Sequence[Registration]:
        """The same: topics."""
        return [self._node.subscribe("equilibrium_pose", PoseStamped, self._on_equilibrium, queue_size=1)]

    def _start_input(self) -> None:
        """The same: the controller starts."""
        self._target.take_new()

    def _lead(self, time: float, period: float) -> None:
        """The same: lead the law's equilibrium on by one period [s]."""
        target = self._target.take_new()
        if target is not None:
            self._law.target = target

    def _read_posture(self, root_node: Node) -> list[float] | None:
        """Where the null space goes, 7 floats [rad]; None: to where the arm is at the start."""
        node = self._node
        if not node.has_param("nullspace_posture"):
            return None
        values = per_joint(node, "nullspace_posture", self.joints)
        try:
            return check_setpoint(values, self.joints, position_ranges(root_node, self.joints))
        except CommandError as error:
            raise ParameterError(f"{node.resolve('nullspace_posture')}: {error}") from None

    def _open(self) -> None:
        node = self._node
        # What an earlier run left on the parameter server must not win over the YAML.
        self._wanted = self._law.wanted
        for name, value in asdict(self._wanted).items():
            node.set_param(name, value)
        self._publishers = (
            realtime.publisher(node, "desired_pose", PoseStamped),
            realtime.publisher(node, "measured_pose", PoseStamped),
            realtime.publisher(node, "commanded_wrench", WrenchStamped),
        )
        self._registrations = [
            node.live_parameters(live_parameters(self._wanted), self._on_gains),
            *self._open_input(),
            *self._publishers,
        ]

    def _on_gains(self, values: dict[str, Any]) -> dict[str, Any]:
        """Live parameters changed: all values are taken, or a HricError refuses them all."""
        wanted = checked(self._node, values)
        if wanted != self._wanted:
            self._wanted = wanted
            self._gains.set(wanted)
        return asdict(wanted)

    def _on_equilibrium(self, message: Any) -> None:
        """A refusal is logged with the topic's name."""
        if not self._running:
            raise CommandError("the controller is not running, the pose is ignored; start it first")
        try:
            self._target.set(check_equilibrium(message, f"{self._arm_id}_link0", self._law.pose, self._jump))
        except CommandError as error:
            raise CommandError(f"equilibrium pose refused, the one before stays: {error}") from None

    def _measured(self) -> Pose:
        T = self._robot.O_T_EE
        return Pose((T[12], T[13], T[14]), to_quaternion(T))

    def starting(self, time: float) -> None:
        """The equilibrium is where the end effector is."""
        q = self._group.positions()
        gains = self._gains.take_new()
        if gains is not None:
            self._law.wanted = gains
        self._start_input()
        self._law.start(self._measured(), q if self._posture is None else self._posture)
        self._last: FloatArray = np.array(self._gravity(q)) if self._gravity else np.zeros(7)
        self._state_time.restart()
        self._running = True

    def update(self, time: float, period: float) -> None:
        """One millisecond of the law."""
        law, model, robot = self._law, self._model, self._robot
        gains = self._gains.take_new()
        self._lead(time, period)
        if gains is not None:
            law.wanted = gains
        law.advance(period)
        measured = self._measured()
        mass = model.mass() + self._rotors
        tau = law.torque(measured, Arm(robot.q, robot.dq, model.zero_jacobian(Frame.END_EFFECTOR), mass, model.coriolis()))
        if self._gravity is not None:
            tau += self._gravity(self._group.positions())
        self._command(tau, period)
        if self._state_time.due(time):
            self._publish(measured)

    def _command(self, tau: FloatArray, period: float) -> None:
        """Limit the rate of torque, and command."""
        step = self._rotatum * period
        if step > 0.0:
            tau = np.minimum(np.maximum(tau, self._last - step), self._last + step)
        self._last = tau
        self._group.set_command(tau.tolist())

    def _publish(self, measured: Pose) -> None:
        stamp, desired, wrench = self._node.now(), self._law.pose, self._law.wrench.tolist()
        self._publishers[0].publish(lambda: self._pose_message(stamp, desired))
        self._publishers[1].publish(lambda: self._pose_message(stamp, measured))
        self._publishers[2].publish(lambda: self._wrench_message(stamp, wrench))

    def _pose_message(self, stamp: Any, pose: Pose) -> PoseStamped:
        message = PoseStamped()
        message.header.stamp, message.header.frame_id = stamp, f"{self._arm_id}_link0"
        fill_pose(message.pose, pose)
        return message

    def _wrench_message(self, stamp: Any, values: list[float]) -> WrenchStamped:
        message = WrenchStamped()
        message.header.stamp, message.header.frame_id = stamp, f"{self._arm_id}_link0"
        force, torque = message.wrench.force, message.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = values
        return message

    def stopping(self, time: float) -> None:
        """From here on poses are refused."""
        self._running = False

    def shutdown(self) -> None:
        """Take back topics and live parameters."""
        for registration in self._registrations:
            registration.unregister()
