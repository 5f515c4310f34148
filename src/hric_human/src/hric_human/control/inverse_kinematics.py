"""Inverse kinematics by damped least squares within the joint ranges, for a hand and for markers."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from hric_core.errors import ParameterError
from hric_core.geometry import FloatArray, Pose
from hric_core.geometry.poses import difference
from hric_core.native import load
from hric_human.control.kinematics import HandChain

TOLERANCE = 1e-7
"""Norm of the remaining error below which a solution is accepted (m and rad mixed)."""
MAX_STEPS = 60
"""Maximum number of steps from one guess. The constants of this file are project defaults, unconfirmed."""
DAMPING = 1e-9
"""Constant part of the damping; the squared error is added to it (Sugihara, IEEE Trans. Robotics 27:984, 2011).

The squared error keeps steps small far from the solution and turns them into Newton steps near it.
"""
MAX_STEP_ANGLE = 0.3
"""Maximum motion of a joint in one step [rad]."""
RELAXATION = 0.05
"""Share of the distance to the resting posture that a step moves towards it, in the null space of the task."""
RESTARTS = 30
"""Number of random guesses, from a fixed seed, that are tried if the first one fails."""
SETTLED, STALLED = 1e-6, 1e-9
"""Joint changes [rad] below which a posture has settled in the null space, and below which the search stops."""

_hand: Callable[..., None] = load("hric_human_kinematics").hand
Task = Callable[[list[float]], tuple[FloatArray, FloatArray]]
"""Function, n joint angles [rad] -> (remaining error, shape (m,), and Jacobian of the task, shape (m, n))."""


class OutOfReachError(ParameterError):
    """Error for a pose of the hand that the body cannot reach."""


class Solver:
    """Damped least-squares solver within joint ranges that stays near a resting posture.

    Args:
        lower, upper: joint ranges, shape (n,) [rad].
        rest: resting posture, shape (n,) [rad].
    """

    def __init__(self, lower: FloatArray, upper: FloatArray, rest: FloatArray) -> None:
        self.lower, self.upper, self.rest = lower, upper, rest

    def solve(
        self, task: Task, guess: FloatArray, relaxation: float = RELAXATION, stalled: float = STALLED
    ) -> tuple[FloatArray, float]:
        """Step until the error is zero or steps no longer help.

        Args:
            task: function whose error is to be reduced to zero.
            guess: start within the ranges, shape (n,) [rad].
            relaxation: share of the way to the resting posture in the first step [1].
            stalled: step size below which the search stops [rad].

        Returns:
            joint angles, shape (n,) [rad], and the norm of the remaining error.
        """
        q, still = guess, np.zeros(len(guess))
        error, J = task(q.tolist())
        squared = float(error @ error)
        for step in range(MAX_STEPS):
            posture = relaxation * (self.rest - q) if step == 0 else still
            if math.sqrt(squared) <= TOLERANCE and not (step == 0 and posture.any()):
                break
            before, q = q, self._step(q, error, squared, J, posture)
            error, J = task(q.tolist())
            squared = float(error @ error)
            if max(map(abs, (q - before).tolist())) < stalled:
                break
        return q, math.sqrt(squared)

    def _step(self, q: FloatArray, error: FloatArray, squared: float, J: FloatArray, posture: FloatArray) -> FloatArray:
        """Return q after one step: dq = z + (J'J + d I)^-1 J'(e - J z), with z towards the posture.

        A joint that would leave its range goes to its end, and the others compensate.
        """
        z, J_free = posture, J
        for _ in range(len(q)):
            A = J_free.T @ J_free
            A.ravel()[:: len(q) + 1] += squared + DAMPING
            goal = q + z + np.linalg.solve(A, J_free.T @ (error - J @ z))
            inside: FloatArray = np.minimum(np.maximum(goal, self.lower), self.upper)  # `clip` takes twice as long
            if inside.tolist() == goal.tolist():  # as lists, which takes a quarter of the time
                break
            outside = inside != goal
            z, J_free = np.where(outside, inside - q, z), np.where(outside, 0.0, J_free)
        step: FloatArray = np.minimum(np.maximum(inside - q, -MAX_STEP_ANGLE), MAX_STEP_ANGLE)
        return q + step


class HandSolver:
    """Inverse kinematics of an arm for poses of its hand; the body's other joints stay in the resting posture.

    Args:
        chain: kinematics of the hand.
        lower, upper: joint ranges of the whole body [rad].
        rest: resting posture of the whole body, within the ranges [rad].
        oriented: True if the orientation is tracked in addition to the position.
    """

    def __init__(
        self,
        chain: HandChain,
        lower: Sequence[float],
        upper: Sequence[float],
        rest: Sequence[float],
        oriented: bool = False,
    ) -> None:
        self.chain, self._rest, self._oriented = chain, list(rest), oriented
        low, high, at_rest = (np.array([values[index] for index in chain.arm]) for values in (lower, upper, rest))
        self._solver = Solver(low, high, at_rest)
        self._shoulder, self._arm = chain.shoulder(rest), chain.numbers(rest)

    def first(self, target: Pose) -> list[float]:
        """Return joint angles of the whole body [rad] for a pose of the hand, near the resting posture.

        Args:
            target: pose of the hand in axes of the root link.

        Raises:
            OutOfReachError: there is no solution.
        """
        task, solver = self._task(target), self._solver
        q, left = solver.solve(task, solver.rest)
        random = np.random.default_rng(0)
        for _ in range(RESTARTS):
            if left <= TOLERANCE:
                break
            q, left = solver.solve(task, random.uniform(solver.lower, solver.upper), 0.0)
        if left > TOLERANCE:
            raise self._out_of_reach(target, left)
        for _ in range(round(10 / RELAXATION)):
            before, (q, left) = q, solver.solve(task, q)
            if float(np.abs(q - before).max()) < SETTLED:
                break
        return self._posture(q)

    def next(self, target: Pose, last: Sequence[float]) -> list[float]:
        """Return the joint angles for a target near the previous one; last: the previous angles; whole body [rad]."""
        q, left = self._solver.solve(self._task(target), np.array([last[index] for index in self.chain.arm]))
        if left > TOLERANCE:
            raise self._out_of_reach(target, left)
        return self._posture(q)

    def _posture(self, q: FloatArray) -> list[float]:
        posture = self._rest.copy()
        for index, angle in zip(self.chain.arm, q.tolist(), strict=True):
            posture[index] = angle
        return posture

    def _task(self, target: Pose) -> Task:
        count, arm, goal = len(self.chain.arm), self._arm, np.array(target.position)
        pose, linear, axes = np.empty(7), np.empty((count, 3)), np.empty((count, 3))

        def task(q: list[float]) -> tuple[FloatArray, FloatArray]:
            _hand(arm, pose, linear, axes, q)
            if not self._oriented:
                return goal - pose[:3], linear.T
            x, y, z, a, b, c, w = pose.tolist()
            error = difference(target, Pose((x, y, z), (a, b, c, w)))
            return np.array(error), np.vstack([linear.T, axes.T])

        return task

    def _out_of_reach(self, target: Pose, left: float) -> OutOfReachError:
        distance, reach, side = math.dist(target.position, self._shoulder), self.chain.reach, self.chain.side
        if distance > reach:
            return OutOfReachError(
                f"the goal of the hand is {distance:.3f} m from the {side} shoulder; "
                f"valid: up to {reach:.3f} m, the reach of the arm"
            )
        return OutOfReachError(
            f"the goal of the hand, {distance:.3f} m from the {side} shoulder, is outside the ranges of the joints "
            f"(remaining error {left:.3f} m and rad); valid: poses within them, up to the arm's reach, {reach:.3f} m"
        )
