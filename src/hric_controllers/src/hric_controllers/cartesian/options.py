"""Options of the Cartesian impedance controller: wrench feed-forward, repulsion from joint limits, energy tank."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from std_msgs.msg import Float64

from hric_controllers.cartesian.energy_tank import EnergyTank
from hric_controllers.cartesian.feedforward import FeedForward
from hric_controllers.cartesian.joint_repulsion import JointRepulsion
from hric_controllers.cartesian.law import CartesianArmState, CartesianLaw
from hric_controllers.cartesian.settings import CartesianImpedanceSettings
from hric_controllers.parameters import position_ranges
from hric_core import realtime
from hric_core.errors import CommandError
from hric_core.geometry import Pose
from hric_core.node import Node
from hric_core.parameters import refused


class ImpedanceOptions:
    """Options of the Cartesian impedance law; each is off unless its parameter is set.

    Args:
        settings: parameters of the controller.
        root_node: node with the description of the robot.
        node: node of the controller.
        base: name of the base frame.
        bounded_work: True if an energy tank can bound the work of the law.
    """

    def __init__(
        self, settings: CartesianImpedanceSettings, root_node: Node, node: Node, base: str, bounded_work: bool
    ) -> None:
        self._node, self._running = node, False
        tank, repulsion, feedforward = settings.energy_tank, settings.joint_repulsion, settings.feedforward
        if tank.initial > 0.0 and not bounded_work:
            valid = "0, as the work of a regulated force has no bound"
            raise refused(node.resolve("energy_tank/initial"), tank.initial, valid)
        self._tank = EnergyTank(tank.initial, tank.largest) if tank.initial > 0.0 else None
        self._repulsion = self._feedforward = None
        if repulsion.margin > 0.0:
            ranges = position_ranges(root_node, settings.joints)
            repulsion.check_ranges(node.resolve("joint_repulsion/margin"), settings.joints, ranges)
            self._repulsion = JointRepulsion(repulsion, ranges)
        if feedforward.timeout > 0.0:
            hand = settings.end_effector or f"{settings.arm_id}_EE"
            self._feedforward = FeedForward(feedforward, base, hand, self._warn)

    def open(self) -> None:
        """Open the topics of the options that are on."""
        if self._tank is not None:
            self._energy = realtime.publisher(self._node, "tank_energy", Float64)
        if self._feedforward is not None:
            self._node.subscribe("feedforward_wrench", WrenchStamped, self._on_wrench, queue_size=1)

    def _warn(self, text: str) -> None:
        realtime.defer(self._node, lambda: self._node.log_warn(text), "log")

    def _on_wrench(self, message: Any) -> None:
        if not self._running:
            raise CommandError("the controller is not running, the wrench is ignored; start it first")
        if self._feedforward is not None:
            self._feedforward.take(message)

    def start(self, law: CartesianLaw, measured: Pose, q: Sequence[float]) -> None:
        """Discard received feed-forward wrenches and fill the energy tank at the start of the controller."""
        self._running = True
        if self._feedforward is not None:
            self._feedforward.start()
        if self._tank is not None:
            self._tank.start(law, law.energy(measured) + self._elsewhere(q), q)

    def stop(self) -> None:
        """Stop accepting feed-forward wrenches."""
        self._running = False

    def _elsewhere(self, q: Sequence[float]) -> float:
        return 0.0 if self._repulsion is None else self._repulsion.energy(q)

    def admit(self, law: CartesianLaw, measured: Pose, q: Sequence[float]) -> None:
        """Let the energy tank account for the last cycle and scale the change of equilibrium and gains."""
        if self._tank is not None:
            self._tank.advance(law, measured, q, self._elsewhere(q))

    def added(
        self, law: CartesianLaw, measured: Pose, arm: CartesianArmState, tau: list[float], period: float, force: float
    ) -> list[float]:
        """Return the torques of the law, `tau`, with those of the options, n floats [N m].

        Args:
            law: law after the calculation of its torques.
            measured: pose of the end effector.
            arm: measured state of the arm.
            tau: torques of the law, n floats [N m].
            period: time since the last cycle [s].
            force: largest force of the feed-forward [N].
        """
        wrench = self._feedforward and self._feedforward.advance(period, measured.orientation, force)
        if wrench:
            tau = (np.array(tau) + arm.jacobian.T @ np.array(wrench)).tolist()
        if self._tank is not None:
            tau = self._tank.admitted(law, arm, tau, period)
        if self._repulsion is not None:
            tau = [a + b for a, b in zip(tau, self._repulsion.torque(arm.q, arm.dq), strict=True)]
        return tau

    def hold(self, tau: Sequence[float], gravity: Sequence[float] | None) -> None:
        """Record the commanded torques and their part against gravity, n floats each [N m]; None: no such part."""
        if self._tank is not None:
            self._tank.hold(tau if gravity is None else [a - b for a, b in zip(tau, gravity, strict=True)])

    def publish(self) -> None:
        """Publish the energy of the tank."""
        if self._tank is not None:
            self._energy.publish(Float64, self._tank.energy)
