"""Base class of robots, real or simulated, with joint interfaces and a control loop that the robot itself drives."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hric_control.hardware_interface import InterfaceManager
from hric_control.limits import LimitCounts
from hric_control.plant import Plant
from hric_control.sim.sim_loop import SimLoop
from hric_control.speed_scale import SpeedScale, SpeedScaleInterface
from hric_core.errors import ResourceConflictError
from hric_core.node import Node
from hric_core.robot_time.arm_time import ArmTime

if TYPE_CHECKING:
    from hric_control.robot_app import RobotApp
    from hric_control.sim.shared_plant import SharedPlant

OnCycle = Callable[[float, float, bool], bool]
"""Callback (time [s], period [s], reset_controllers) for each cycle.

It returns False if the robot must leave its command mode, as controllers are switched or the run ends; else True."""

LogRow = tuple[Sequence[str], Sequence[float], Sequence[float]]
"""Commands of one cycle for the control log: (interfaces, commands before the limits, commands sent), one per joint.

An interface is "effort", "velocity", "position" or "none"."""


@dataclass(frozen=True)
class ControllerInfo:
    """Information about a controller that the robot gets when controllers are switched.

    Attributes:
        name: name of the controller.
        type: plugin type string.
        claims: claimed joints by the ros_control name of the interface, such as
            {"hardware_interface::EffortJointInterface": {"panda_joint1"}}.
    """

    name: str
    type: str
    claims: dict[str, frozenset[str]] = field(default_factory=dict)


class RobotHW(InterfaceManager):
    """Base class of all robots, simulated or real.

    A robot class is exported as a plugin in package.xml, found by its type string, and constructed without arguments.
    It implements `init`, `read`, `write`, `run` and `stop`; everything else has a default.
    """

    # -- optional attributes and methods -------------------------------------------------------------------------------

    compensates_gravity: bool = False
    """True if the robot adds gravity torques g(q) to effort commands; controllers that add them, too, are refused."""

    def __init__(self) -> None:
        super().__init__()
        speed = SpeedScaleInterface()
        self.register_interface(speed)
        self.speed_scale: SpeedScale = speed.scale
        """Speed scale of the robot, by which a supervisor slows down the controllers that obey it."""
        # Instance attributes, as the loop reads them in each cycle: class attributes are slower.
        self.loop: SimLoop | None = None
        """Loop of a simulated robot, which can be paused, stepped and paced; None: the robot has its own clock."""
        self.arm_time: ArmTime | None = None
        """Robot time by the clock of a real arm; None: the loop, if there is one, counts robot time."""
        self.plant: Plant | None = None
        """Physics engine plant of a simulated robot; None: the robot has none in this process."""
        self.rotor_inertia: Sequence[float] | None = None
        """Rotor inertia at each joint, n floats [kg m^2], with which controllers check their gains; None: unknown."""
        self.shared: SharedPlant | None = None
        """Plant that the robot shares with others, as one of two arms; None: it has a plant and a clock of its own."""
        self.apps: dict[str, RobotApp] = {}
        """Robots that this one combines, each with its own controller manager, by name of the robot."""
        self.error = ""
        """Reason why the robot has aborted a motion, until it has recovered; else empty."""

    @property
    def time(self) -> float | None:
        """Robot time of the last measured state [s]; it starts at 0 and never goes back.

        None: unknown; then `run` cannot have a duration."""
        clock = self.arm_time or self.loop
        return None if clock is None else clock.time

    @property
    def epoch(self) -> float:
        """ROS time at which robot time was 0 [s]; 0 if ROS time is robot time."""
        return 0.0 if self.arm_time is None else self.arm_time.epoch

    @property
    def period(self) -> float:
        """Period of the control loop [s]; 1 ms, that of Franka's arms, if the robot has no simulation loop."""
        return 0.001 if self.loop is None else self.loop.time_step

    def limiter_counts(self) -> LimitCounts | None:
        """Return the counts of limited commands since the start, which the loop updates; None: there are none."""
        return None

    def log_row(self) -> LogRow:
        """Return the commands of the last cycle for the control log; without joints if the robot has no log."""
        return (), (), ()

    # -- life cycle ----------------------------------------------------------------------------------------------------

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read parameters, connect to the robot, register the interfaces. Called once, before the loop.

        Raises:
            HricError: the robot cannot be used; the message gives the reason.
        """

    def check_for_conflict(self, controllers: Sequence[ControllerInfo]) -> None:
        """Refuse controllers that must not run together; by default, two controllers that claim the same joint.

        Raises:
            ResourceConflictError: the message names the joint and both controllers.
        """
        owner: dict[str, str] = {}
        for controller in controllers:
            for joint in sorted(set().union(*controller.claims.values())):
                if joint in owner and owner[joint] != controller.name:
                    raise ResourceConflictError(f"{joint} is claimed by both {owner[joint]} and {controller.name}")
                owner[joint] = controller.name

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Check that a switch of controllers is possible; called outside the loop. Raises HricError if it is not."""

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Change the command mode for a switch of controllers; called in the loop, between two cycles.

        A simulated robot changes its mode at once. A robot that needs a new control session for another mode stores the
        mode, and its `run` changes to it after `on_cycle` has returned False."""

    def switch_done(self, start: Sequence[ControllerInfo]) -> bool:
        """Return True if the robot is ready for the commands of these controllers.

        Called in the loop, in each cycle after `do_switch` until it returns True; the controllers wait until then.
        Raises HricError if the change of mode failed; the controllers are then aborted."""
        return True

    def read(self, time: float, period: float) -> None:
        """Read the joint states from the robot; time: robot time [s], period: time since the last cycle [s]."""

    def write(self, time: float, period: float) -> None:
        """Limit the commands, then send them to the robot; time: robot time [s], period: that of the cycle [s]."""

    def run(self, on_cycle: OnCycle) -> None:
        """Run cycles of `read`, `on_cycle`, `write` until `stop` is called. Raises HricError if the robot fails."""
        raise NotImplementedError(f"{type(self).__name__} has no run")

    def stop(self) -> None:
        """Let `run` return after the present cycle. May be called from any thread or a signal handler."""
        raise NotImplementedError(f"{type(self).__name__} has no stop")

    def shutdown(self) -> None:
        """Release the connection to the robot. Called once, after `run` has returned."""
