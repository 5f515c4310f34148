"""The robot as the manager sees it: interfaces, and whoever owns the clock drives the cycle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hric_control.errors import ResourceConflictError
from hric_control.hardware_interface import InterfaceManager
from hric_control.node import Node

OnCycle = Callable[[float, float, bool], bool]
"""(time [s], period [s], reset_controllers) -> True to go on, False to leave the mode (a switch is waiting, or the end)."""


@dataclass(frozen=True)
class ControllerInfo:
    """What the hardware may know of a controller when it is switched.

    Attributes:
        name: instance name.
        type: plugin type string.
        claims: claimed joints by the ros_control name of the interface, e.g. {"hardware_interface::EffortJointInterface": {"panda_joint1"}}.
    """

    name: str
    type: str
    claims: dict[str, frozenset[str]] = field(default_factory=dict)


class RobotHW(InterfaceManager):
    """Base of all robots, simulated or real; found by its type string through the package.xml plugin export and constructed without arguments."""

    compensates_gravity: bool = False
    """Whether the robot adds g(q) to effort commands by itself; a controller that adds it too is refused by name."""

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read parameters, connect, register the interfaces. Called once, outside the loop.

        Raises:
            HricError: the robot cannot be used; the message says why.
        """

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """Refuse a set of controllers that would run together. The default lets each joint be claimed once, over all interfaces.

        Raises:
            ResourceConflictError: names the joint and both claimants.
        """
        owner: dict[str, str] = {}
        for controller in controllers:
            for joint in sorted(set().union(*controller.claims.values())):
                if joint in owner and owner[joint] != controller.name:
                    raise ResourceConflictError(f"{joint} is claimed by both {owner[joint]} and {controller.name}")
                owner[joint] = controller.name

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Check that the switch can be made; outside the loop. Raises HricError if not."""

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Make the switch; inside the loop, between two cycles. A simulated robot changes its mode at once; one whose mode needs a new
        control call remembers it, and its `run` enters it after `on_cycle` answered False."""

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Whether the hardware is ready for the commands of these controllers; inside the loop, asked each cycle after `do_switch` until it is.
        Until then they wait. Raises HricError if the change failed; they are aborted then."""
        return True

    def read(self, time: float, period: float) -> None:
        """Fill the states from the robot."""

    def write(self, time: float, period: float) -> None:
        """Enforce the limits, then send the commands to the robot."""

    def run(self, on_cycle: OnCycle) -> None:
        """Own the clock: each cycle `read`, `on_cycle`, `write`, until `stop` was called. Raises HricError on a failure of the robot."""
        raise NotImplementedError(f"{type(self).__name__} has no run")

    def stop(self) -> None:
        """Ask `run` to return after this cycle; from any thread or a signal handler."""
        raise NotImplementedError(f"{type(self).__name__} has no stop")

    def shutdown(self) -> None:
        """Release the robot. Called once, after `run` returned."""
