"""Inverse kinematics of a body by damped least squares within the ranges of its joints: of a hand, and of markers."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from hric_control.errors import ParameterError
from hric_control.geometry import FloatArray, Pose
from hric_control.geometry.poses import difference
from hric_human.control.kinematics import HandChain

TOLERANCE = 1e-7
"""Norm of the remaining error at which a solution is one (m and rad mixed)."""
MAX_STEPS = 60
"""From one guess. The constants of this file are project defaults, unconfirmed."""
DAMPING = 1e-9
"""Added to the squared error, which damps besides (Sugihara, IEEE Trans. Robotics 27:984, 2011): steps are small far
from the solution and Newton's near it."""
MAX_STEP_ANGLE = 0.3
"""Maximum of a joint in one step [rad]."""
RELAXATION = 0.05
"""Share of the distance to the resting posture that the posture goes towards it in a solution, as far as the task does
not feel it."""
RESTARTS = 30
"""Guesses, from a fixed seed, that are tried where the first one leads nowhere."""
SETTLED, STALLED = 1e-6, 1e-9
"""A posture that changes by less is at rest, and steps that are smaller lead nowhere [rad]."""

Task = Callable[[list[float]], tuple[FloatArray, FloatArray]]
"""Joint angles [rad] -> (what is left to the target, shape (m,), its Jacobian, shape (m, n))."""


class OutOfReachError(ParameterError):
    """A target that a body cannot reach."""


class Solver:
    """Damped least squares with ranges and a resting posture.

    Args:
        lower, upper: ranges, shape (n,) [rad].
        rest: resting posture, shape (n,) [rad].
    """

    def __init__(self, lower: FloatArray, upper: FloatArray, rest: FloatArray) -> None:
        self.lower, self.upper, self.rest = lower, upper, rest

    def solve(
        self, task: Task, guess: FloatArray, relaxation: float = RELAXATION, stalled: float = STALLED
    ) -> tuple[FloatArray, float]:
        """Steps until nothing is left, or no more steps help.

        Args:
            task: what is to become zero.
            guess: within the ranges, shape (n,) [rad].
            relaxation: share of the way to the resting posture in the first step.
            stalled: steps that are smaller lead nowhere [rad].

        Returns:
            joint angles, shape (n,) [rad], and the norm of what is left.
        """
        q = guess
        error, J = task(q.tolist())
        left = math.sqrt(float(error @ error))
        for step in range(MAX_STEPS):
            posture = relaxation * (self.rest - q) if step == 0 else np.zeros(len(q))
            if left <= TOLERANCE and not posture.any():
                break
            before, q = q, self._step(q, error, J, posture)
            error, J = task(q.tolist())
            left = math.sqrt(float(error @ error))
            if float(np.abs(q - before).max()) < stalled:
                break
        return q, left

    def _step(self, q: FloatArray, error: FloatArray, J: FloatArray, posture: FloatArray) -> FloatArray:
        """One step: dq = z + (J'J + d I)^-1 J'(e - J z), z towards the posture; a joint that would leave its range goes
        to the end of it, and the others do what it cannot."""
        z, J_free = posture, J
        squared = float(error @ error)
        for _ in range(len(q)):
            A = J_free.T @ J_free
            A.flat[:: len(q) + 1] += squared + DAMPING
            goal = q + z + np.linalg.solve(A, J_free.T @ (error - J @ z))
            inside: FloatArray = goal.clip(self.lower, self.upper)
            outside = inside != goal
            if not outside.any():
                break
            z, J_free = np.where(outside, inside - q, z), np.where(outside, 0.0, J_free)
        step: FloatArray = (inside - q).clip(-MAX_STEP_ANGLE, MAX_STEP_ANGLE)
        return q + step


class HandSolver:
    """Joint angles of an arm for poses of its hand; the body's other joints stay in the resting posture.

    Args:
        chain: of the hand.
        lower, upper: ranges of the whole body [rad].
        rest: resting posture of the whole body, within the ranges [rad].
        oriented: whether the orientation is followed, beside the position.
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
        self._shoulder = chain.shoulder(rest)

    def first(self, target: Pose) -> list[float]:
        """Joint angles of the whole body [rad], settled near the resting posture.

        Args:
            target: of the hand in axes of the root link.

        Raises:
            OutOfReachError: there are none.
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
        return self._whole(q)

    def next(self, target: Pose, last: Sequence[float]) -> list[float]:
        """The same for a target near the one before; last: joint angles of that, of the whole body [rad]."""
        guess = np.array([last[index] for index in self.chain.arm])
        q, left = self._solver.solve(self._task(target), guess)
        if left > TOLERANCE:
            raise self._out_of_reach(target, left)
        return self._whole(q)

    def _whole(self, q: FloatArray) -> list[float]:
        whole = self._rest.copy()
        for index, angle in zip(self.chain.arm, q.tolist(), strict=True):
            whole[index] = angle
        return whole

    def _task(self, target: Pose) -> Task:
        chain, arm, whole = self.chain, self.chain.arm, self._rest.copy()
        count = len(arm)

        def task(q: list[float]) -> tuple[FloatArray, FloatArray]:
            for index, angle in zip(arm, q, strict=True):
                whole[index] = angle
            posed = chain.posed(whole)
            p = posed.point(chain.p_link_hand)
            error = difference(target, Pose(p, posed.orientation))
            linear = posed.velocities(p)[-count:]
            if not self._oriented:
                return np.array(error[:3]), np.array(linear).T
            return np.array(error), np.vstack([np.array(linear).T, np.array(posed.axes[-count:]).T])

        return task

    def _out_of_reach(self, target: Pose, left: float) -> OutOfReachError:
        distance, reach, side = math.dist(target.position, self._shoulder), self.chain.reach, self.chain.side
        if distance > reach:
            return OutOfReachError(
                f"the hand is to be {distance:.3f} m from the {side} shoulder; valid: up to {reach:.3f} m, its reach"
            )
        return OutOfReachError(
            f"the hand is to be {distance:.3f} m from the {side} shoulder, where the ranges of the joints do not "
            f"let it be (it misses by {left:.3f} m and rad); valid: poses within them, up to its reach, {reach:.3f} m"
        )
