"""Integrators of one step: OpenSim's own of third order, one of third order with rotors, and semi-implicit Euler.

Semi-implicit Euler is PyBullet's method. Efforts are constant over a step. No integrator goes beyond the end of the
plant's step, so observers see only accepted states, in order of time.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import opensim

from hric_control.plant import FloatArray
from hric_core.errors import FailureError
from opensim_ros_control.dynamics import EquationsOfMotion
from opensim_ros_control.engine import OpenSimEngine
from opensim_ros_control.joint_efforts import EffortRow, JointEfforts
from opensim_ros_control.stages import advanced, ralston

Touch = Callable[[FloatArray, FloatArray], FloatArray]
"""Function (v, gain) that returns the joint efforts of rigid contact, shape (nu,).

v: speeds at the end of the step without contact, shape (nu,); gain: change of v per effort, shape (nu, nu).
"""
_ROUNDS = 20
"""Maximum number of alternations between joint efforts and contact forces in a step."""
_AGREED = 1e-9
"""Relative change of the efforts at which these alternations end [1]."""

LONGEST_CALL = 1e-3
"""Maximum simulated time of one integrator call, which blocks all threads [s] (project default, unconfirmed)."""

_COMMANDED = opensim.Stage(opensim.Stage.Velocity)
"""Stage of OpenSim's realization from which cached values depend on the efforts."""


class IntegrationError(FailureError):
    """Error that OpenSim's integrator raised in a step."""


class IntegrationStep(NamedTuple):
    """Result of a step.

    Attributes:
        y: state at the end of the step, in the engine's order.
        acceleration: du/dt at the start of the step, shape (nu,); None if the integrator does not compute it.
    """

    y: FloatArray
    acceleration: FloatArray | None


class OwnSteps:
    """Integrators of this plant, which include rotor inertia, friction, joint stops, drives, brakes and rigid contact.

    Args:
        dynamics: equations of motion.
        joint_efforts: bounded efforts of friction, stops and drives.
        time_step: duration of a step [s].
    """

    def __init__(self, dynamics: EquationsOfMotion, joint_efforts: JointEfforts, time_step: float) -> None:
        self._dynamics, self._rows, self._dt = dynamics, joint_efforts, time_step
        self._engine = dynamics.engine
        n = self._engine.nu
        self._q, self._u = slice(0, n), slice(n, 2 * n)

    def _begin(self, time: float, y: FloatArray, tau: FloatArray, touch: Touch | None) -> tuple[FloatArray, FloatArray]:
        """Return du/dt at the start of a step, and tau plus the efforts of friction, stops, drives and contact."""
        dynamics, dt = self._dynamics, self._dt
        if self._engine.nz:  # components with own states may depend on time
            self._engine.system_state.setTime(time)
        x = dynamics.evaluate(y, tau)
        if self._rows.active or touch is not None:
            v = y[self._u] + dt * x
            rows = self._rows.rows(y[self._q], v)
            if rows or touch is not None:
                K = dynamics.response()
                extra = self._extra(rows, touch, v, dt * K)
                x, tau = x + K @ extra, tau + extra
        return x, tau

    def _extra(self, rows: Sequence[EffortRow], touch: Touch | None, v: FloatArray, gain: FloatArray) -> FloatArray:
        """Return the sum of the bounded joint efforts (`rows`) and of rigid contact, shape (nu,), found by iteration.

        Args:
            rows: bounded efforts that may act.
            touch: rigid contact; None: no contact.
            v: speeds at the end of the step without these efforts, shape (nu,).
            gain: change of v per effort, shape (nu, nu).
        """
        if touch is None:
            return self._rows.solve(rows, v, gain)
        by_touch = touch(v, gain)
        if not rows:
            return by_touch
        by_rows = np.zeros_like(v)
        for _ in range(_ROUNDS):
            before = by_rows + by_touch
            by_rows = self._rows.solve(rows, v + gain @ by_touch, gain)
            by_touch = touch(v + gain @ by_rows, gain)
            both = by_rows + by_touch
            if np.abs(both - before).max() <= _AGREED * np.abs(both).max():
                break
        return both

    def semi_implicit(self, time: float, y: FloatArray, tau: FloatArray, touch: Touch | None = None) -> IntegrationStep:
        """Advance by semi-implicit Euler: u += dt du/dt, then q += dt dq/dt with the new u.

        Args:
            time: simulation time at the start of the step [s].
            y: state at the start of the step.
            tau: joint efforts, shape (nu,) [N m or N].
            touch: rigid contact; None: no contact.
        """
        engine, dt = self._engine, self._dt
        x, _ = self._begin(time, y, tau, touch)
        end = y.copy()
        if engine.nz:
            end[2 * engine.nu :] += dt * engine.z_rate()
        end[self._u] += dt * x
        end[self._q] += dt * (end[self._u] if engine.straight else engine.velocity_at(y[self._q], end[self._u]))
        return IntegrationStep(end, x)

    def third_order(self, time: float, y: FloatArray, tau: FloatArray, touch: Touch | None = None) -> IntegrationStep:
        """Advance by Ralston's Runge-Kutta method of third order: stages at 0, 1/2, 3/4, weights 2/9, 3/9, 4/9.

        A. Ralston, Runge-Kutta methods with minimum error bounds, Mathematics of Computation 16 (1962).

        Args:
            time: simulation time at the start of the step [s].
            y: state at the start of the step.
            tau: joint efforts, shape (nu,) [N m or N].
            touch: rigid contact; None: no contact.
        """
        dynamics, rate, dt = self._dynamics, self._engine.rate, self._dt
        x1, tau = self._begin(time, y, tau, touch)
        rate1 = rate(y, x1)
        y2 = advanced(y, 0.5 * dt, rate1)
        rate2 = rate(y2, dynamics.evaluate(y2, tau))
        y3 = advanced(y, 0.75 * dt, rate2)
        return IntegrationStep(ralston(y, dt, rate1, rate2, rate(y3, dynamics.evaluate(y3, tau))), x1)


class ManagerSteps:
    """OpenSim's own integrator of third order with error control; it has no rotors, brakes, stops, drives or contact.

    Args:
        engine: engine with the model.
        time_step: duration of a step [s].
        accuracy: accuracy of the error control, as OpenSim defines it.
    """

    def __init__(self, engine: OpenSimEngine, time_step: float, accuracy: float) -> None:
        self._engine, self._accuracy = engine, accuracy
        self._calls = max(1, math.ceil(time_step / LONGEST_CALL - 1e-9))
        self._part = time_step / self._calls
        self._manager: opensim.Manager | None = None
        self._last: FloatArray | None = None

    def _start(self, time: float, y: FloatArray) -> opensim.Manager:
        engine = self._engine
        engine.put_y(y)
        state = opensim.State(engine.system_state)
        # The integrator counts time from zero, so that equal initial states give equal results bit for bit at any
        # simulation time. If components have states of their own (nz), the forces may depend on time, so it counts on.
        self._origin, self._steps = (time if engine.nz else 0.0), 0
        state.setTime(self._origin)
        for _, actuator in engine.actuators:
            actuator.setAppliesForce(state, True)
        # Each start needs a new Manager, since a used one continues from the end of its last step.
        self._manager = manager = opensim.Manager(engine.model)
        manager.setIntegratorMethod(opensim.Manager.IntegratorMethod_RungeKutta3)
        manager.setIntegratorAccuracy(self._accuracy)
        manager.setIntegratorMaximumStepSize(self._part)
        manager.setWriteToStorage(False)
        manager.setPerformAnalyses(False)
        manager.initialize(state)
        self._running = manager.getState()
        self._end = engine.y_view(self._running)
        return manager

    def step(self, time: float, y: FloatArray, tau: FloatArray) -> IntegrationStep:
        """Advance by a step.

        Args:
            time: simulation time at the start of the step [s].
            y: state at the start: the end of the last step, or set from outside.
            tau: joint efforts, shape (nu,) [N m or N].
        """
        manager = self._manager
        if manager is None or y is not self._last:
            manager = self._start(time, y)
        running = self._running
        self._engine.set_controls(tau)
        running.invalidateAllCacheAtOrAbove(_COMMANDED)
        try:
            for _ in range(self._calls):
                self._steps += 1
                running = manager.integrate(self._origin + self._steps * self._part)
        except RuntimeError as error:
            raise IntegrationError(
                f"OpenSim's integrator failed in a step: {str(error).strip().splitlines()[0]}"
            ) from error
        self._running = running
        self._last = end = self._engine.y_of(running) if self._end is None else self._end.copy()
        return IntegrationStep(end, None)
