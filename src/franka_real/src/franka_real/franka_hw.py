"""Real Franka arm as a RobotHW, through libfranka."""

from collections.abc import Sequence
from typing import Any

from franka_hw_interface.arm_parameters import read_limits
from franka_hw_interface.command_set import PERIOD, ArmCommand, CommandSet
from franka_hw_interface.commanded_arm import CommandedArm
from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.modes import HOLD, ArmMode
from franka_real import connection
from franka_real.arm_adapter import ArmAdapter
from franka_real.backend import RobotError
from franka_real.settings import FrankaRealSettings
from franka_real.state import LibfrankaState
from hric_control.loop_requests import LoopRequests
from hric_control.robot_hw import OnCycle
from hric_core.node import Node
from hric_core.realtime_setup import Measure, priority_kept, realtime, take_priority
from hric_core.robot_time.arm_time import ArmTime

LATE = 1.5 * PERIOD
"""Time between two received states above which at least one in between is lost [s]."""
STORED = 100
"""Maximum number of states to read until errors appear; more than libfranka's socket can buffer."""


class FrankaHW(CommandedArm):
    """Real Panda or FR3 as a RobotHW, through libfranka.

    The arm's clock times the cycles. `run` only reads states while no controller commands the arm; otherwise it runs
    one of libfranka's control loops, selected by the interfaces that the controllers claim. A switch to another mode
    ends that loop and starts the next; the connection stays open.

    Parameters, services and actions: INTERFACE.md.

    Attributes, in addition to those of `CommandedArm`:
        description: URDF of the robot.
        model: KDL model of the description, with payload and frames of the arm.
        rotor_inertia: rotor inertias for controllers that check their gains, 7 floats [kg m^2].
        losses: length of each sequence of consecutive lost states in the running motion.
        lost_states: number of lost states in all motions that have ended.
    """

    robot_state: LibfrankaState

    def init(self, root_node: Node, robot_hw_node: Node) -> None:
        """Read the parameters and connect to the arm."""
        node = self._node = robot_hw_node
        self._settings = config = FrankaRealSettings.read(node)
        self.arm_id = config.arm_id
        self.description = root_node.search_param("robot_description")
        self.model = KdlFrankaModel(self.description, self.arm_id)
        self.rotor_inertia = config.rotors(self.description, self.model.joint_names)
        limits = read_limits(self.description, root_node, node, self.arm_id, self.model.joint_names)
        self.mode, self.error, self.lost_states = HOLD, "", 0
        self.losses: list[int] = []
        self._requested, self._stop = HOLD, False
        self._requests = LoopRequests()
        self.arm_time = self._robot_time = ArmTime([root_node, node])
        self._connection = connection.open_connection(config)
        try:
            self._start(limits, root_node)
        except BaseException:
            self._connection.close()
            raise

    def _start(self, limits: Sequence[Any], root_node: Node) -> None:
        self._arm, self._watchdog = self._connection.arm, self._connection.watchdog
        self._collision = self._settings.collision_config
        with self._connection.patience():
            self.robot_state = state = LibfrankaState(self.model.joint_names, self._arm.read_once())
            self.states = state.joints
            for text in connection.learn(self.model, state):
                self._node.log_warn(text)
            models = connection.models(self._settings, self._arm, self.model, self.description)
            self._adapter = ArmAdapter(self._connection, self._requests, state, models, self.recover)
            self._send_collision_behavior()
        arm_limits, filtered = self._settings.limits, self._settings.filters_poses
        self._commands = CommandSet(self.arm_id, self.states, state, limits, arm_limits=arm_limits, filtered=filtered)
        self._register(models[0])
        self._serve(self._adapter, root_node)

    @property
    def _running(self) -> bool:
        return self._requests.thread is not None

    def _check_mode(self, mode: ArmMode) -> None:
        self._arm.check(mode)

    # -- the cycle -----------------------------------------------------------------------------------------------------

    def read(self, time: float, period: float) -> None:
        """Read the present state; before `run` only."""
        self.robot_state.take(self._arm.read_once(), self._robot_time.time)

    def run(self, on_cycle: OnCycle) -> None:
        """Run the control loop by the arm's clock until `stop` is called. Raises ArmLostError if the arm is lost."""
        with self._requests.served_here():
            try:
                config = self._settings
                measured = realtime(config.realtime_priority, config.lock_memory, config.switch_interval)
                with priority_kept(), measured as measures:
                    self._report_measures(measures)
                    if self._watchdog is not None:
                        self._watchdog.arm()
                    self._arm.read_once()  # it may be old: buffered since the last reading
                    while not self._stop:
                        if self.error or not self._requested.commanded:
                            self._follow(on_cycle)
                        else:
                            self._command(self._requested, on_cycle)
            finally:
                if self._watchdog is not None:
                    self._watchdog.disarm()
                self._stop = False

    def _report_measures(self, measures: Sequence[Measure]) -> None:
        self._node.log_info(f"real time: {'; '.join(measure.text for measure in measures if measure.done)}")
        for measure in measures:
            if not measure.done:
                self._node.log_warn(f"real time: {measure.text}")

    def _take(self, raw: Any) -> float:
        """Store a new state of the arm and return the time since the last one [s], 0 if it is not newer."""
        if self._watchdog is not None:
            self._watchdog.beat()
        period = self._robot_time.advance(self._arm.milliseconds(raw))
        self.robot_state.take(raw, self._robot_time.time)
        return period

    def _follow(self, on_cycle: OnCycle) -> None:
        """Read states while no controller commands the arm, which then holds its position by itself."""
        self._commands.enter(HOLD)
        while not self._stop and (self.error or not self._requested.commanded):
            period = self._take(self._arm.read_once())
            if period > 0.0:
                self._requests.serve()
                on_cycle(self._robot_time.time, period, False)

    def _command(self, mode: ArmMode, on_cycle: OnCycle) -> None:
        """Run libfranka's control loop for a command mode until another mode is requested."""

        def first(raw: Any) -> None:
            take_priority(self._settings.realtime_priority)
            self._take(raw)
            self._commands.enter(mode)
            self.mode = mode
            on_cycle(self._robot_time.time, PERIOD, True)

        def cycle(raw: Any) -> ArmCommand:
            if self.mode is not mode:
                first(raw)
            else:
                period = self._take(raw)
                if period > LATE:
                    self.losses.append(round(period / PERIOD) - 1)
                self._requests.serve()
                on_cycle(self._robot_time.time, period or PERIOD, False)
            command = self._commands.limited_command(mode)
            command.finished = self._stop or self._requested is not mode
            return command

        try:
            self._arm.control(mode, cycle)
        except RobotError as error:
            self._fail(self._with_names(str(error)))
        finally:
            self.mode = HOLD
            self._report_losses(mode)

    def _with_names(self, text: str) -> str:
        """Return an error text of libfranka, completed with the names of the arm's errors.

        libfranka omits them if the arm ended the motion before its first state; they are read from the next states.
        """
        if "aborted by reflex" not in text or "[" in text:
            return text
        for _ in range(STORED):
            self._take(self._arm.read_once())
            if self.robot_state.current_errors:
                break
        return f"{text} [{', '.join(sorted(self.robot_state.current_errors))}]"

    def _report_losses(self, mode: ArmMode) -> None:
        if self.losses:
            text = (
                f"motion by {mode}: {sum(self.losses)} states of the arm lost or late, at most {max(self.losses)} in a "
                "row; check this computer and its network: hric check_workstation"
            )
            self._warn(text)
            self.lost_states += sum(self.losses)
            self.losses.clear()

    def stop(self) -> None:
        """Make `run` return after the present cycle; may be called from any thread or a signal handler."""
        self._stop = True

    def shutdown(self) -> None:
        """Unregister the services and end the connection."""
        self._services.unregister()
        self._connection.close()

    # -- the error state -----------------------------------------------------------------------------------------------

    def recover(self) -> None:
        """Run automatic error recovery, in the loop; the aborted motion starts again, and its controllers restart."""
        self._refuse_recovery_in_motion()
        if not self.robot_state.idle:
            with self._connection.patience():
                self._arm.recover()
        self.error = ""
        self._send_collision_behavior()

    def _send_collision_behavior(self) -> None:
        """Send the configured collision thresholds once; if the arm refuses them, again at the next recovery."""
        if self._collision is None:
            return
        try:
            self._adapter.set_collision_behavior(self._collision)
            self._collision = None
        except RobotError as error:
            self._node.log_warn(f"collision thresholds refused; they are sent again at the next recovery: {error}")
