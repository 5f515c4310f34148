"""Emulated control box: the tasks of the arm's firmware in each millisecond. No ROS, no physics engine."""

from collections.abc import Callable, Sequence

from franka_hw_interface.kdl_model import KdlFrankaModel
from franka_hw_interface.robot_state import NO_ERRORS, Errors, RobotMode, errors
from franka_sim.box.compiled_arm import CompiledArm
from franka_sim.box.config import BoxConfig
from franka_sim.box.configuration import ConfiguredBox
from franka_sim.box.hold import MotionBraking
from franka_sim.box.motion.run import MotionRun, PacketCount, invalid
from franka_sim.box.reflexes import describe
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest, RequestOutcome
from franka_sim.box.state_machine import BoxEvent, next_mode
from hric_core.errors import CommandError
from hric_core.native.vectors import add

_ZEROS = [0.0] * 7
_OUTCOMES = {
    BoxEvent.FINISH: RequestOutcome.SUCCESS,
    BoxEvent.STOP: RequestOutcome.PREEMPTED,
    BoxEvent.REFLEX: RequestOutcome.REFLEX_ABORTED,
    BoxEvent.USER_STOP_PRESSED: RequestOutcome.EMERGENCY_ABORTED,
    BoxEvent.CONNECTION_LOST: RequestOutcome.ABORTED,
}
_COLLISIONS = frozenset(("joint_reflex", "cartesian_reflex"))
_WATCHED = (RobotMode.MOVE, RobotMode.GUIDING)
"""Modes in which the measured state can trigger a reflex."""
_LOST: Errors = frozenset(("communication_constraints_violation",))
_UNSTABLE: Errors = frozenset(("instability_detected",))


class ControlBox(ConfiguredBox):
    """Control box of the arm. Single thread: requests come between two cycles.

    In each millisecond `read` takes the arm's state at the measuring instant, then `write` returns the torques until
    the next one. The modes and their transitions are in `state_machine.TRANSITIONS`. Without a motion, the internal
    joint impedance holds the arm; gravity, and friction as far as it is known, are compensated in every mode.

    Args:
        model, compiled, config, report: see `ConfiguredBox`.

    Attributes:
        state: robot state, one object that every cycle updates.
        finished: outcome of the last motion; None while one runs, and after `take_finished`.
    """

    def __init__(
        self,
        model: KdlFrankaModel,
        compiled: CompiledArm,
        config: BoxConfig | None = None,
        report: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(model, compiled, config or BoxConfig(), report)
        self.finished: RequestOutcome | None = None
        self._packets = PacketCount(self.config.success_window)
        self._braking = MotionBraking(self.config)
        self._run = MotionRun(self.state, model, self.config)
        self._friction_torque: list[float] | None = None
        self._fresh = True

    @property
    def mode(self) -> RobotMode:
        """Present mode of the arm."""
        return self.state.robot_mode

    @property
    def recovering(self) -> bool:
        """True while the arm recovers from errors, until it rests."""
        return self.mode is RobotMode.AUTOMATIC_ERROR_RECOVERY

    def take_finished(self) -> RequestOutcome | None:
        """Return the outcome of a motion that ended since the last call, or None."""
        finished, self.finished = self.finished, None
        return finished

    # -- requests ------------------------------------------------------------------------------------------------------

    def move(self, request: MoveRequest) -> RequestOutcome:
        """Start a motion and return STARTED, or the reason of the refusal.

        If the motion generator does not allow the start, this returns STARTED and the first command ends the motion, so
        that the name of the error reaches the client.
        """
        if next_mode(self.mode, BoxEvent.MOVE) is None:
            return RequestOutcome.NOT_POSSIBLE
        if reason := invalid(request):
            self.report(f"move refused: {reason}")
            return RequestOutcome.INVALID_ARGUMENT
        state = self.state
        state.q_d[:], state.dq_d[:], state.ddq_d[:], state.tau_J_d[:] = state.q, _ZEROS, _ZEROS, _ZEROS
        state.desired_changed()
        if not self._run.start(request, self.impedance(request.controller), self.torque_filter_gain()):
            self.report("move refused: it would begin in a singular pose")
            return RequestOutcome.SINGULAR_START
        self._packets.reset()
        self._reflexes.start(state)
        state.robot_mode, state.controller_mode, state.generator_mode = (
            RobotMode.MOVE,
            request.controller,
            request.generator,
        )
        state.last_motion_errors, state.control_command_success_rate = NO_ERRORS, 0.0
        self.finished = None
        return RequestOutcome.STARTED

    def stop_move(self) -> RequestOutcome:
        """End the motion as preempted; without effect in idle mode."""
        return self._change(BoxEvent.STOP)

    def connection_lost(self) -> None:
        """Abort the client's motion, if any, since the connection is lost."""
        self._change(BoxEvent.CONNECTION_LOST)

    def recover(self) -> RequestOutcome:
        """Run automatic error recovery: clear errors and collisions; the errors of the last motion stay readable.

        An arm that still brakes recovers when it rests.
        """
        outcome = self._change(BoxEvent.RECOVER)
        self._finish_recovery()
        return outcome

    def _finish_recovery(self) -> None:
        if self.recovering and not any(self.state.dq_d):
            self._clear_errors()
            self._change(BoxEvent.RECOVERED)
            self.report("recovered from errors")

    def set_user_stop(self, pressed: bool) -> RequestOutcome:
        """Press or release the user stop; a second press changes nothing."""
        if pressed == (self.mode is RobotMode.USER_STOPPED):
            return RequestOutcome.SUCCESS
        outcome = self._change(BoxEvent.USER_STOP_PRESSED if pressed else BoxEvent.USER_STOP_RELEASED)
        if outcome is RequestOutcome.SUCCESS:
            self.report("user stop pressed" if pressed else "user stop released")
            if not pressed:
                self._clear_errors()
        return outcome

    def set_guiding(self, on: bool) -> RequestOutcome:
        """Press or release the guiding buttons; while pressed, only gravity and friction are compensated."""
        if on == (self.mode is RobotMode.GUIDING):
            return RequestOutcome.SUCCESS
        outcome = self._change(BoxEvent.GUIDING_ON if on else BoxEvent.GUIDING_OFF)
        if self.mode is RobotMode.GUIDING:
            self._reflexes.start(self.state)
        return outcome

    def reset(self, q: Sequence[float]) -> None:
        """Reset to joint positions q (7 floats [rad]) at rest: a running motion is aborted, errors are cleared."""
        if len(q) != 7:
            raise CommandError(f"a pose is 7 numbers [rad]; got {len(q)}")
        self._end_motion(RequestOutcome.ABORTED, NO_ERRORS)
        self._clear_errors()
        self._put(q)
        self.state.robot_mode = RobotMode.IDLE

    def break_down(self, q: Sequence[float]) -> None:
        """Reset to joint positions q (7 floats [rad]) at rest after the simulation diverged.

        A mode that allows reflexes ends in one, with the error instability_detected.
        """
        self._put(q)
        if next_mode(self.mode, BoxEvent.REFLEX) is not None:
            self._protect(_UNSTABLE)

    def _put(self, q: Sequence[float]) -> None:
        state = self.state
        for name in ("dq", "dq_d", "ddq_d", "tau_J_d"):
            getattr(state, name)[:] = _ZEROS
        state.q[:], state.q_d[:] = q, q
        state.tick += 1
        self._external.reset()
        self._gravity_torque = self._friction_torque = None
        self._fresh = True

    def _clear_errors(self) -> None:
        state = self.state
        state.current_errors = NO_ERRORS
        state.joint_collision[:], state.cartesian_collision[:] = _ZEROS, _ZEROS[:6]
        state.control_command_success_rate = 0.0

    # -- transitions ---------------------------------------------------------------------------------------------------

    def _change(self, event: BoxEvent, why: Errors = NO_ERRORS) -> RequestOutcome:
        """Apply the transition of an event and return SUCCESS, or NOT_POSSIBLE if there is none."""
        before, after = self.mode, next_mode(self.mode, event)
        if after is None:
            return RequestOutcome.NOT_POSSIBLE
        self._end_motion(_OUTCOMES.get(event, RequestOutcome.ABORTED), why)
        self.state.robot_mode = after
        if before is RobotMode.GUIDING:
            self._braking.start(self.state)
        return RequestOutcome.SUCCESS

    def _end_motion(self, outcome: RequestOutcome, why: Errors) -> None:
        state = self.state
        if state.robot_mode is not RobotMode.MOVE:
            return
        if state.controller_mode is not ControllerMode.JOINT_IMPEDANCE or why & _COLLISIONS:
            self._braking.start(state)
        state.controller_mode, state.generator_mode = ControllerMode.OTHER, GeneratorMode.IDLE
        for name in ("O_dP_EE_c", "O_ddP_EE_c"):
            getattr(state, name)[:] = _ZEROS[:6]
        state.delbow_c[:], state.ddelbow_c[:] = _ZEROS[:2], _ZEROS[:2]
        state.desired_changed()
        if (
            outcome is not RequestOutcome.REFLEX_ABORTED
        ):  # the client of an aborted motion reads how many commands arrived
            state.control_command_success_rate = 0.0
        state.last_motion_errors, self.finished = why, outcome

    def _protect(self, names: Errors) -> None:
        """Enter the reflex mode with these errors."""
        self.state.current_errors = names
        if self.mode is RobotMode.GUIDING:
            self.state.last_motion_errors = names
        self._change(BoxEvent.REFLEX, errors(names))

    def _reflex(self, names: Errors, reason: str = "") -> None:
        """Enter the reflex mode and report the cause; reason: text that follows the errors' names."""
        self._protect(names)
        self.report(
            f"{self.model.arm_id}: motion aborted by reflex: {describe(names, self.state, self.config, reason)}"
        )

    # -- the millisecond -----------------------------------------------------------------------------------------------

    def read(self, q: Sequence[float], dq: Sequence[float], tau_J: Sequence[float], time: float) -> None:
        """Take the arm's state at the measuring instant.

        Args:
            q: joint positions, 7 floats [rad].
            dq: joint velocities, 7 floats [rad/s].
            tau_J: joint torques during the last cycle, gravity included, 7 floats [N m].
            time: robot time [s].
        """
        state = self.state
        if self._fresh:
            self._begin(q)
        else:
            self._gravity_torque = self._external.update(state.q, state.dq, q, dq, tau_J, self._friction_torque)
        state.tau_before[:], state.dq_before[:] = state.tau_J, state.dq
        state.q[:], state.dq[:], state.tau_J[:] = q, dq, tau_J
        state.time = time
        state.tick += 1
        if state.robot_mode in _WATCHED and self.config.reflexes:
            wrong = self._reflexes.errors(state)
            if wrong:
                self._reflex(wrong)

    def _begin(self, q: Sequence[float]) -> None:
        self._fresh = False
        if self._change(BoxEvent.START) is RequestOutcome.SUCCESS:
            self.state.q_d[:] = q

    def write(self, command: MotionCommand | None) -> list[float]:
        """Return the joint torques to apply until the next cycle, 7 floats [N m].

        The running motion's torques, or without a motion those that hold the arm, plus compensation of gravity and of
        the known friction.

        Args:
            command: command of the running motion; None: no packet came. Ignored without a motion.
        """
        state, mode = self.state, self.state.robot_mode
        if mode is RobotMode.MOVE:
            tau = self._move(command)
        elif mode is RobotMode.GUIDING:
            tau = _ZEROS
            state.q_d[:], state.tau_J_d[:] = state.q, tau
        else:
            tau = self._hold()
        torque = add(tau, self._gravity_torque or self._compiled.gravity(state.q))
        if self._friction is not None:
            friction = self._friction_torque = self._friction(state.dq)
            torque = add(torque, friction)
        return torque

    def _hold(self) -> list[float]:
        state = self.state
        self._braking.advance(state)
        self._finish_recovery()
        tau = self.joint_impedance.torque(state)
        state.tau_J_d[:] = tau
        return tau

    def _move(self, command: MotionCommand | None) -> list[float]:
        packets, state = self._packets, self.state
        if command is not None:
            if not packets.complete:
                packets.accept()
        elif not packets.started:
            return self.joint_impedance.torque(state)
        elif not self._run.asynchronous and self._lost_too_many():
            self._reflex(_LOST)
            return self._hold()
        state.control_command_success_rate = packets.success_rate
        tau, wrong = self._run.torque(command)
        if wrong:
            self._reflex(wrong, self._run.reason)
            return self._hold()
        if self._run.finished(command):
            self._change(BoxEvent.FINISH)
            return self._hold()
        state.tau_J_d[:] = tau
        return tau

    def _lost_too_many(self) -> bool:
        packets, maximum = self._packets, self.config.max_lost_packets
        packets.lose()
        return self.config.reflexes and maximum is not None and packets.lost_in_a_row >= maximum
