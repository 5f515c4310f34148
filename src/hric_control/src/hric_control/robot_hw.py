"""Robot as the manager sees it: interfaces, and a loop driven by the owner of the clock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hric_control.hardware_interface import InterfaceManager
from hric_control.limits import LimitCounts
from hric_control.plant import Plant
from hric_control.sim.sim_loop import SimLoop
from hric_control.speed_scale import SpeedScale, SpeedScaleInterface
from hric_core.errors import ResourceConflictError
from hric_core.node import Node

OnCycle = Callable[[float, float, bool], bool]
"""Callback (time [s], period [s], reset_controllers) -> True to go on, False to leave the mode (switch or end)."""

LogRow = tuple[Sequence[str], Sequence[float], Sequence[float]]
"""Row of one cycle: command interfaces, commands before the limits, commands sent; one value per joint each.

The interface is "effort", "velocity", "position" or "none"."""


@dataclass(frozen=True)
class ControllerInfo:
    """Information about a controller that the hardware receives at a switch.

    Attributes:
        name: instance name.
        type: plugin type string.
        claims: claimed joints by the ros_control name of the interface, such as
            {"hardware_interface::EffortJointInterface": {"panda_joint1"}}.
    """

    name: str
    type: str
    claims: dict[str, frozenset[str]] = field(default_factory=dict)


class RobotHW(InterfaceManager):
    """Base of all robots, simulated or real.

    Found by its type string through the package.xml plugin export and constructed without arguments. A robot implements
    `init`, `read`, `write`, `run` and `stop`; all else has a default. What is optional comes first.
    """

    # -- what a robot may have -----------------------------------------------------------------------------------------

    compensates_gravity: bool = False
    """True if the robot adds g(q) to effort commands; a controller that adds it too is refused by name."""

    def __init__(self) -> None:
        super().__init__()
        speed = SpeedScaleInterface()
        self.register_interface(speed)
        self.speed_scale: SpeedScale = speed.scale
        """Scale by which a supervisor slows the controllers that obey it; every robot has it."""
        # Instance attributes, as the loop reads them in each cycle: class attributes are slower.
        self.loop: SimLoop | None = None
        """Clock of a simulated robot, to pause, step and pace it; None: the robot brings its own clock."""
        self.plant: Plant | None = None
        """Physics of a simulated robot in this process; None: there is none."""
        self.rotor_inertia: Sequence[float] | None = None
        """Rotor inertia at each joint, n floats [kg m^2], by which controllers check their gains. None: unknown."""
        self.error = ""
        """Reason why the robot aborted the last motion, until it has recovered; else empty."""

    @property
    def time(self) -> float | None:
        """Robot time of the last state [s], from 0, never backwards; None: unknown, and no run can have a duration."""
        return None if self.loop is None else self.loop.time

    @property
    def epoch(self) -> float:
        """ROS time at which robot time was 0 [s]; 0 if ROS time is robot time."""
        return 0.0

    @property
    def period(self) -> float:
        """Period of the control loop [s]; 1 ms, as for Franka's arms, if there is no simulated clock."""
        return 0.001 if self.loop is None else self.loop.time_step

    def limiter_counts(self) -> LimitCounts | None:
        """Return the live limit counts since the start, over all interfaces; None: nothing counts."""
        return None

    def log_row(self) -> LogRow:
        """Return the commands of the last cycle for the control log, from `init` on; without joints: no log."""
        return (), (), ()

    # -- the life of a robot -------------------------------------------------------------------------------------------

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read parameters, connect, register the interfaces. Called once, outside the loop.

        Raises:
            HricError: the robot cannot be used; the message says why.
        """

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """Refuse controllers that may not run together. By default each joint can be claimed once, over all interfaces.

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
        """Check that the switch is possible; outside the loop. Raises HricError if not."""

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Make the switch; inside the loop, between two cycles.

        A simulated robot changes its mode at once; a robot whose mode needs a new control call remembers it, and its
        `run` enters it after `on_cycle` returned False."""

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Return True if the hardware is ready for the commands of these controllers.

        Called in the loop, each cycle after `do_switch` until it is; until then the controllers wait. Raises HricError
        if the change failed; the controllers are then aborted."""
        return True

    def read(self, time: float, period: float) -> None:
        """Fill the states from the robot."""

    def write(self, time: float, period: float) -> None:
        """Enforce the limits, then send the commands to the robot."""

    def run(self, on_cycle: OnCycle) -> None:
        """Run cycles of `read`, `on_cycle`, `write` until `stop`; raises HricError if the robot fails."""
        raise NotImplementedError(f"{type(self).__name__} has no run")

    def stop(self) -> None:
        """Let `run` return after this cycle. May be called from any thread or a signal handler."""
        raise NotImplementedError(f"{type(self).__name__} has no stop")

    def shutdown(self) -> None:
        """Release the robot. Called once, after `run` returned."""
