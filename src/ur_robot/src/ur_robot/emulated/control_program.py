"""Emulation of the control program that ur_rtde uploads, of the servo motion, and of the stops of the controller.

The program is URScript, which is not interpreted: its use of RTDE registers is emulated, as in ur_rtde 1.6.5
(scripts/rtde_control.script, src/rtde_control_interface.cpp). The client writes a command number into the first integer
input register and its arguments into the others; the program responds in the first integer output register.
"""

import logging
import math
from collections.abc import Callable, Sequence
from enum import IntEnum

from ur_robot.emulated.rtde import CYCLE_RATE, Value

LOG = logging.getLogger("hric.ur")
JOINTS = 6
PERIOD = 1.0 / CYCLE_RATE
READY, DONE = 1, 2
"""Responses of the program: ready for a command, and done with the present one."""
BRAKING = 10.0
"""Deceleration at a protective stop, and when a program ends [rad/s^2]; the manufacturer gives none: unconfirmed."""
UNLOCK_TIME = 5.0
"""Time after which a protective stop can be unlocked [s] (dashboard server of the e-Series)."""


class Runtime(IntEnum):
    """States of a program, as in the variable `runtime_state`."""

    STOPPED = 1
    PLAYING = 2
    PAUSED = 4


class Servo:
    """Motion of the target position: servo towards a goal, or braking.

    The manufacturer publishes no formula of `servoj`. Here the target approaches the goal with the time constant
    `lookahead` (unconfirmed), so it follows a goal of constant speed with this delay; the gain has no effect.

    Args:
        q: joint positions at the start, 6 floats [rad].

    Attributes:
        q: target position, 6 floats [rad].
        speed: velocity of the target position, 6 floats [rad/s].
        goal: position to approach, 6 floats [rad]; None: brake, then hold.
        lookahead: time constant [s].
        deceleration: deceleration while braking [rad/s^2].
    """

    def __init__(self, q: Sequence[float]) -> None:
        self.q, self.speed = list(q), [0.0] * len(q)
        self.goal: list[float] | None = None
        self.lookahead, self.deceleration = 0.1, BRAKING

    def brake(self, deceleration: float) -> None:
        """Brake with a deceleration [rad/s^2], then hold."""
        self.goal, self.deceleration = None, deceleration

    @property
    def at_rest(self) -> bool:
        """True if the target does not move."""
        return not any(self.speed)

    def accelerate(self) -> None:
        """Compute the velocity of the next cycle."""
        if self.goal is None:
            change = self.deceleration * PERIOD
            self.speed = [math.copysign(max(abs(v) - change, 0.0), v) if abs(v) > change else 0.0 for v in self.speed]
        else:
            share = (1.0 - math.exp(-PERIOD / self.lookahead)) / PERIOD
            self.speed = [(goal - q) * share for goal, q in zip(self.goal, self.q, strict=True)]

    def move(self) -> None:
        """Move the target by one cycle."""
        self.q = [q + v * PERIOD for q, v in zip(self.q, self.speed, strict=True)]


class UrController:
    """Emulated controller: registers, control program, servo and safety; one call of `cycle` every 2 ms.

    Args:
        q: joint positions at the start, 6 floats [rad].
        limits: lower and upper position and largest speed of each joint [rad, rad, rad/s].

    Attributes:
        time: time since the start [s].
        servo: motion of the target position.
        runtime: state of the program.
        stop_reason: reason of the protective stop; empty: there is none.
    """

    def __init__(self, q: Sequence[float], limits: Sequence[tuple[float, float, float]]) -> None:
        self.servo, self._limits = Servo(q), limits
        self._cycles = 0
        self.runtime, self.stop_reason, self._stopped_at = Runtime.STOPPED, "", 0.0
        self.inputs: dict[str, float] = {}
        self._offset = self._response = 0
        self._executing: Callable[[], bool] | None = None
        self._watch = self._written = 0.0
        self._commands: dict[int, Callable[[], Callable[[], bool]]] = {
            16: self._stop_servo,
            31: self._stop_by_program,
            33: self._stop_servo,
            34: self._stop_servo,
            35: self._set_watchdog,
        }

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._cycles * PERIOD

    def write(self, values: dict[str, float]) -> None:
        """Write the input registers that a client sent, by name."""
        self.inputs.update(values)
        if f"input_int_register_{self._offset}" in values:
            self._written = self.time

    def start_program(self, offset: int) -> None:
        """Start ur_rtde's control program, whose registers begin at `offset`; refused at a protective stop."""
        if self.stop_reason:
            LOG.warning("control program refused: unlock the protective stop first (%s)", self.stop_reason)
            return
        self.runtime, self._offset, self._response = Runtime.PLAYING, offset, READY
        self._executing, self._watch = None, 0.0
        self.servo.brake(BRAKING)

    def end_program(self, reason: str) -> None:
        """End the program; the arm brakes and holds."""
        if self.runtime is not Runtime.STOPPED:
            LOG.info("the control program ends: %s", reason)
        self.runtime, self._executing = Runtime.STOPPED, None
        self.servo.brake(BRAKING)

    def protective_stop(self, reason: str) -> None:
        """Stop the arm and pause the program until `unlock`."""
        LOG.error("protective stop: %s", reason)
        self.stop_reason, self._stopped_at = reason, self.time
        self.runtime = Runtime.PAUSED if self.runtime is Runtime.PLAYING else self.runtime
        self.servo.brake(BRAKING)

    def unlock(self) -> bool:
        """Unlock a protective stop; return False before `UNLOCK_TIME` has passed. The program stays paused."""
        if self.stop_reason and self.time - self._stopped_at < UNLOCK_TIME:
            return False
        self.stop_reason = ""
        return True

    def _register(self, index: int) -> float:
        return self.inputs.get(f"input_double_register_{index + self._offset}", 0.0)

    def cycle(self) -> list[float]:
        """Advance by 2 ms and return the target position, 6 floats [rad]."""
        self._cycles += 1
        if self.runtime is Runtime.PLAYING:
            self._run_program()
        self.servo.accelerate()
        if not self.stop_reason:
            self._check_target()
        self.servo.move()
        return self.servo.q

    def _run_program(self) -> None:
        if self._watch and self.time - self._written > self._watch:
            self.end_program(f"watchdog, no command for {self._watch:g} s")
            return
        if self._executing is not None:
            if not self._executing():
                return
            self._executing = None
            self._response = DONE
        command = int(self.inputs.get(f"input_int_register_{self._offset}", 0))
        if command == 0:
            self._response = READY
        elif command == 11:
            self._servo()
            self._response = READY
        elif command == 255:
            self.end_program("stopped by the client")
        elif self._response != DONE:
            self._begin(command)

    def _begin(self, command: int) -> None:
        begin = self._commands.get(command)
        if begin is None:
            valid = ", ".join(map(str, (0, 11, *self._commands, 255)))
            self.end_program(f"command {command} of ur_rtde is not emulated; valid: {valid}")
        else:
            self._executing = begin()

    def _servo(self) -> None:
        goal = [self._register(i) for i in range(JOINTS)]
        lookahead = self._register(9)
        if not all(map(math.isfinite, goal)) or not 0.03 <= lookahead <= 0.2:
            self.end_program(f"servoj to {goal} rad, lookahead_time {lookahead} s; valid: finite, 0.03 to 0.2 s")
            return
        self.servo.goal, self.servo.lookahead = goal, lookahead

    def _stop_servo(self) -> Callable[[], bool]:
        self.servo.brake(abs(self._register(0)) or BRAKING)
        return lambda: self.servo.at_rest

    def _stop_by_program(self) -> Callable[[], bool]:
        self.protective_stop("requested by the client")
        return lambda: True

    def _set_watchdog(self) -> Callable[[], bool]:
        rate = self._register(0)
        self._watch = 1.0 / rate if rate > 0.0 else 0.0
        return lambda: True

    def _check_target(self) -> None:
        """Cause a protective stop if a joint exceeds its speed limit, or moves outwards beyond its position range."""
        servo, reason = self.servo, ""
        for i, (lower, upper, fastest) in enumerate(self._limits):
            q, v = servo.q[i], servo.speed[i]
            if abs(v) > fastest:
                reason = reason or f"joint {i + 1} at {v:.2f} rad/s, limit {fastest:.2f} rad/s"
                servo.speed[i] = math.copysign(fastest, v)
            elif (q < lower and v < 0.0) or (q > upper and v > 0.0):
                reason = reason or f"joint {i + 1} at {q:.3f} rad, limits {lower:.3f} to {upper:.3f} rad"
        if reason:
            self.protective_stop(reason)

    def state(self, q: Sequence[float], dq: Sequence[float], tau: Sequence[float]) -> dict[str, Value]:
        """Return the simulated RTDE variables by name.

        Args:
            q: measured joint positions, 6 floats [rad].
            dq: measured joint velocities, 6 floats [rad/s].
            tau: measured joint torques, 6 floats [N m].
        """
        stopped = bool(self.stop_reason)
        return {
            "timestamp": self.time,
            "target_q": self.servo.q,
            "target_qd": self.servo.speed,
            "actual_q": q,
            "actual_qd": dq,
            "actual_current_as_torque": tau,
            "speed_scaling": 1.0,
            "target_speed_fraction": 1.0,
            "runtime_state": self.runtime,
            "robot_mode": 7,  # running
            "safety_mode": 3 if stopped else 1,
            "safety_status_bits": 1 << 2 | 1 << 10 if stopped else 1,
            "robot_status_bits": 1 | (self.runtime is Runtime.PLAYING) << 1,
            f"output_int_register_{self._offset}": self._response,
        }
