"""One motion from its start to its end: generator and controller, as the client asked for them."""

from __future__ import annotations

from math import isfinite

from franka_hw_interface.robot_state import NO_ERRORS, Errors
from franka_sim.box.configuration import ConfiguredBox
from franka_sim.box.deviation import DeviationLimits
from franka_sim.box.internal_impedance import CartesianImpedanceLaw, JointImpedanceLaw
from franka_sim.box.motion import MotionGenerator, make_generator
from franka_sim.box.requests import ControllerMode, GeneratorMode, MotionCommand, MoveRequest
from franka_sim.box.torque_control import TorqueChecks


def invalid(request: MoveRequest) -> str:
    """What is wrong with a request in itself; an empty text if nothing is."""
    if request.controller is ControllerMode.OTHER:
        return "a motion needs a controller"
    if request.generator is GeneratorMode.IDLE:
        return "a motion needs a motion generator, or none with torque control"
    if request.generator is GeneratorMode.NONE and request.controller is not ControllerMode.EXTERNAL:
        return "an internal controller needs a motion generator"
    if not all(isfinite(x) and x >= 0.0 for x in (*request.max_path_deviation, *request.max_goal_deviation)):
        return "deviations must be finite and not negative"
    return ""


class MotionRun:
    """Turns commands into torques while a motion runs.

    Args:
        box: state, model, configuration and impedances.
    """

    def __init__(self, box: ConfiguredBox) -> None:
        self._box, self._state = box, box.state
        self._checks = TorqueChecks(box.config)
        self._generators: dict[GeneratorMode, MotionGenerator] = {}
        self._revision = -1
        self._generator: MotionGenerator | None = None
        self._law: JointImpedanceLaw | CartesianImpedanceLaw | None = None
        self._start_errors: Errors = NO_ERRORS
        self._gain, self._still = 1.0, False
        self._limits: DeviationLimits | None = None

    def start(self, request: MoveRequest) -> bool:
        """Begin at the state's q_d, at rest; False: the pose is singular for this motion."""
        box, state = self._box, self._state
        self._law = None
        if request.controller is ControllerMode.JOINT_IMPEDANCE:
            self._law = box.joint_impedance
        elif request.controller is ControllerMode.CARTESIAN_IMPEDANCE:
            self._law = box.cartesian_impedance
        self._generator, self._start_errors = self._make(request.generator), NO_ERRORS
        self._gain = box.torque_filter_gain()
        limits = DeviationLimits(request)
        self._limits = limits if limits.path or limits.goal else None
        # libfranka 0.9 asks for a joint velocity generator that it keeps at zero when it wants torque control alone.
        self._still = self._law is None and request.generator in (GeneratorMode.NONE, GeneratorMode.JOINT_VELOCITY)
        if self._generator is not None:
            if self._generator.is_singular(state):
                return False
            self._start_errors = self._generator.start(state)
        return True

    def _make(self, kind: GeneratorMode) -> MotionGenerator | None:
        if kind is GeneratorMode.NONE:
            return None
        box = self._box
        if self._revision != box.model.revision:
            self._generators.clear()
            self._revision = box.model.revision
        if kind not in self._generators:
            self._generators[kind] = make_generator(kind, box.model, box.config.limits, box.config.time_step)
        return self._generators[kind]

    @property
    def reason(self) -> str:
        """What the motion generator refused and which limit was passed, in words; empty where there is nothing to add to the errors' names."""
        return "" if self._generator is None else self._generator.reason

    def torque(self, command: MotionCommand | None) -> tuple[list[float], Errors]:
        """(torque without gravity, 7 floats [N m]; what is wrong with the command by libfranka's names) for one cycle."""
        wrong = self._generate(command)
        if not wrong and self._limits is not None and self._box.config.reflexes:
            wrong = self._limits.errors(self._state, command is not None and command.finished)
        if wrong:
            return [], wrong
        if self._law is not None:
            return self._law.torque(self._state), NO_ERRORS
        before = self._state.tau_J_d
        return (before[:], NO_ERRORS) if command is None else self._external(command.tau, before)

    def _external(self, wanted: list[float], before: list[float]) -> tuple[list[float], Errors]:
        wrong = self._checks.errors(wanted, before)
        if wrong:
            if self._box.config.reflexes or not all(map(isfinite, wanted)):
                return [], wrong
            wanted = self._checks.limited(wanted, before)
        if self._gain < 1.0:
            gain = self._gain
            wanted = [b + gain * (a - b) for a, b in zip(wanted, before, strict=True)]
        return wanted[:], NO_ERRORS

    def _generate(self, command: MotionCommand | None) -> Errors:
        """Desired motion of this cycle."""
        state, generator = self._state, self._generator
        if self._still and self._stays(command):
            state.q_d[:] = state.q
            state.desired_changed()
            return self._start_errors
        if generator is None:
            return NO_ERRORS
        wrong = self._start_errors or generator.advance(command)
        state.desired_changed()
        if wrong and not self._box.config.reflexes:
            self._start_errors = NO_ERRORS
            generator.start(state)
            return NO_ERRORS
        return wrong

    def _stays(self, command: MotionCommand | None) -> bool:
        """Whether the generator beside torque control is at zero; once it has moved it counts."""
        self._still = self._generator is None or command is None or not any(command.dq)
        if not self._still and self._generator is not None:
            self._start_errors = self._start_errors or self._generator.start(self._state)
        return self._still
