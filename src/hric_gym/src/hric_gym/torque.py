"""Controller that commands the joint torques received on its topic `command`, for the action mode `torque`."""

import math
from dataclasses import dataclass
from typing import Any

from std_msgs.msg import Float64MultiArray

from hric_control.controller import Controller
from hric_control.hardware_interface import EffortJointInterface
from hric_control.robot_hw import RobotHW
from hric_core import realtime
from hric_core.errors import CommandError
from hric_core.node import Node
from hric_core.parameters import Settings, names, number


@dataclass(frozen=True)
class TorqueSettings(Settings):
    """Parameters of JointTorqueController."""

    joints: tuple[str, ...] = names()
    rotatum_limit: float = number(
        500.0, above=0.0, unit="N m/s", text="largest change of a commanded torque per time; half of the arm's limit"
    )


class JointTorqueController(Controller):
    """Controller that commands the torques of its topic `command` (Float64MultiArray) [N m], with limited rate.

    A command is held until the next one. Before the first the torques are zero: the arm itself compensates gravity.
    """

    settings = (TorqueSettings,)

    def init(self, robot_hw: RobotHW, root_node: Node, controller_node: Node) -> None:
        """Read the parameters, claim the joints and subscribe to the topic."""
        settings = TorqueSettings.read(controller_node)
        self._joints, self._rate = settings.joints, settings.rotatum_limit
        self._group = robot_hw.get(EffortJointInterface).group(list(self._joints))
        self._target: realtime.LatestValue[list[float]] = realtime.LatestValue([])
        controller_node.subscribe("command", Float64MultiArray, self._on_command, queue_size=1)

    def _on_command(self, message: Any) -> None:
        values = [float(value) for value in message.data]
        if len(values) != len(self._joints) or not all(map(math.isfinite, values)):
            raise CommandError(
                f"torques {values}; valid: {len(self._joints)} finite numbers [N m], for {', '.join(self._joints)}"
            )
        self._target.set(values)

    def starting(self, time: float) -> None:
        """Reset command and torques to zero."""
        self._target.set([0.0] * len(self._joints))
        self._last = [0.0] * len(self._joints)

    def update(self, time: float, period: float) -> None:
        """Change the torques towards the newest command, by at most rotatum_limit times the period [s]."""
        step = self._rate * period
        pairs = zip(self._target.get(), self._last, strict=True)
        self._last = [min(max(value, last - step), last + step) for value, last in pairs]
        self._group.set_command(self._last)
