"""Contact forces in one step of an OpenSim plant: penalty contact and rigid contact.

Penalty contact is one spring per pair of links, at the centre of the overlap area. Its force is constant over the step:
the mean force of the spring's motion through the step, which transfers the same energy
(`hric_control.plants.spring_step`). Rigid contact is solved for the speeds at the end of the step, as in common
robotics engines: bodies do not penetrate, forces do not pull, friction stays within its cone (projected Gauss-Seidel).
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hric_control.plants import ContactLaw, Springs
from hric_core.geometry import FloatArray
from hric_core.summation import total

RETURN = 0.2
"""Fraction of an overlap corrected per step, as in common engines [1] (project default, unconfirmed)."""
RETURN_SPEED = 0.5
"""Maximum speed of the overlap correction [m/s] (project default, unconfirmed)."""
_SWEEPS = 100
_ROUNDS = 10
"""Maximum number of iterations for the sliding directions of all contact points."""
_SPEED = 1e-9
"""Speed that counts as zero [m/s]."""
_TOLERANCE = 1e-6
"""Relative change of the contact forces at which an iteration ends [1]."""
_SINGULAR = 1e-10
"""Fraction of the largest eigenvalue below which an eigenvalue counts as zero [1]."""


@dataclass
class ContactPoint:
    """Contact point between two links; all vectors in the ground frame.

    Attributes:
        a, b: names of the links.
        bodies: OpenSim's numbers of the bodies of a and b.
        position: position of the point, shape (3,) [m].
        normal: unit vector from b to a.
        depth: penetration depth, negative for a gap [m].
        J: Jacobian of the velocity of a relative to b at the point, shape (3, nu).
        law: law of the normal force, None for rigid contact, and friction coefficient [1].
        key: key that identifies the same point in the previous step.
        force: force on a, constant over the last step, shape (3,) [N].
        reading: normal force as a sensor reads it [N]; None: that of `force`.
        closing: approach speed of penalty contact at the start of the step [m/s].
        energy: largest work of the bodies on penalty contact since it began [J].
    """

    a: str
    b: str
    bodies: tuple[int, int]
    position: FloatArray
    normal: FloatArray
    depth: float
    J: FloatArray
    law: tuple[ContactLaw | None, float]
    key: tuple[object, ...]
    force: FloatArray
    reading: float | None = None
    closing: float | None = None
    energy: float | None = None

    @property
    def normal_force(self) -> float:
        """Normal force as a sensor reads it [N]."""
        return float(self.force @ self.normal) if self.reading is None else self.reading


def push_apart(
    points: Sequence[ContactPoint], u: FloatArray, before: FloatArray, response: FloatArray, springs: Springs
) -> FloatArray:
    """Compute the forces of all penalty contacts in a step; return their joint efforts, shape (nu,) [N m or N].

    Args:
        points: points with stiffness, one per pair of links, with the depth at the middle of the step; their forces
            are set.
        u: present speeds, shape (nu,).
        before: speeds one step before, shape (nu,).
        response: change of du/dt per effort, shape (nu, nu).
        springs: contact springs of the link pairs, with their state.
    """
    efforts = np.zeros_like(u)
    for point in points:
        law, friction = point.law
        assert law is not None
        row = point.normal @ point.J
        speed, measured = -float(row @ u), -float(row @ (u - before)) / springs.time_step
        depth = point.depth - 0.5 * springs.time_step * speed
        done = springs.push((point.a, point.b), depth, speed, measured, float(row @ response @ row), law)
        point.reading, point.closing, point.force = done.reading, speed, np.zeros(3)
        point.energy = springs.energy((point.a, point.b))
        if done.mean > 0.0:
            relative = np.array([point.J @ u, point.J @ before])
            rub = springs.rub(
                (point.a, point.b),
                friction * done.mean,
                point.normal,
                relative,
                functools.partial(_inverse_mass, point.J, response),
            )
            point.force = done.mean * point.normal + rub
            efforts += point.J.T @ point.force
    return efforts


def _inverse_mass(J: FloatArray, response: FloatArray, along: FloatArray) -> float:
    """Return the inverse effective mass of a contact point along a unit vector [1/kg].

    Args:
        J: Jacobian of the relative velocity at the point, shape (3, nu).
        response: change of du/dt per effort, shape (nu, nu).
        along: unit vector, shape (3,).
    """
    row = along @ J
    return float(row @ response @ row)


def _axes(normal: FloatArray) -> FloatArray:
    """Return the rows of an orthonormal frame whose first row is the given unit vector, shape (3, 3)."""
    x, y, z = normal.tolist()
    if abs(x) <= min(abs(y), abs(z)):
        a, b, c = 0.0, z, -y
    elif abs(y) <= abs(z):
        a, b, c = -z, 0.0, x
    else:
        a, b, c = y, -x, 0.0
    size = math.sqrt(a * a + b * b + c * c)
    a, b, c = a / size, b / size, c / size
    return np.array([[x, y, z], [a, b, c], [y * c - z * b, z * a - x * c, x * b - y * a]])


class RigidContact:
    """Solver of rigid contact, which starts its iteration with the forces of the previous step.

    time_step: duration of a step [s].
    """

    def __init__(self, time_step: float) -> None:
        self._dt = time_step
        self._before: dict[tuple[object, ...], tuple[float, float, float]] = {}

    def forget(self) -> None:
        """Clear the forces of the previous step, after bodies were repositioned."""
        self._before.clear()

    def solve(self, points: Sequence[ContactPoint], v: FloatArray, gain: FloatArray) -> FloatArray:
        """Compute the forces at all points; return their joint efforts, shape (nu,) [N m or N].

        Args:
            points: points in rigid contact.
            v: speeds at the end of the step without contact, shape (nu,).
            gain: change of these speeds per effort, shape (nu, nu).
        """
        axes = [_axes(point.normal) for point in points]
        rows = np.vstack([R @ point.J for R, point in zip(axes, points, strict=True)])
        response = rows @ gain @ rows.T
        min_speeds = np.array([self._min_speed(point.depth) for point in points])
        friction = np.array([point.law[1] for point in points])
        before = np.array([self._before.get(point.key, (0.0, 0.0, 0.0)) for point in points]).ravel()
        f = _forces(_Problem(response, rows @ v, min_speeds, friction), before)
        self._before.clear()
        for k, (point, R) in enumerate(zip(points, axes, strict=True)):
            point.force = R.T @ f[3 * k : 3 * k + 3]
            self._before[point.key] = (f[3 * k], f[3 * k + 1], f[3 * k + 2])
        return np.asarray(rows.T @ f)

    def _min_speed(self, depth: float) -> float:
        """Return the speed along the normal [m/s] that a point of this depth [m] must at least have after the step."""
        return depth / self._dt if depth <= 0.0 else min(RETURN * depth / self._dt, RETURN_SPEED)


@dataclass(frozen=True)
class _Problem:
    """Contact problem with three rows per point, one along the normal and two normal to it.

    Attributes:
        A: change of the speeds along the rows per force, shape (3 n, 3 n).
        free: speeds without force, shape (3 n,).
        min_speeds: minimum speeds along the normals, shape (n,).
        friction: friction coefficients, shape (n,) [1].
    """

    A: FloatArray
    free: FloatArray
    min_speeds: FloatArray
    friction: FloatArray

    def part(self, points: npt.NDArray[np.bool_]) -> "_Problem":
        """Return the problem that has only some of the points; points: True for these, shape (n,)."""
        if points.all():
            return self
        rows = np.repeat(points, 3)
        return _Problem(self.A[np.ix_(rows, rows)], self.free[rows], self.min_speeds[points], self.friction[points])


def _forces(problem: _Problem, before: FloatArray) -> FloatArray:
    """Return the contact forces, shape (3 n,) [N].

    Usually no point has a force, or all points with a force stick, or all of them slide. These cases are tried first,
    by direct solution; other cases are solved iteratively.

    Args:
        problem: contact problem of all points.
        before: initial forces of the iteration, shape (3 n,).
    """
    if (problem.free[::3] >= problem.min_speeds).all():
        return np.zeros_like(problem.free)
    for law in (_sticking, _sliding):
        forces = _pressing(problem, law)
        if forces is not None:
            return forces
    return np.array(
        _sweeps(
            problem.A.tolist(),
            problem.free.tolist(),
            problem.min_speeds.tolist(),
            problem.friction.tolist(),
            before.tolist(),
        )
    )


def _pressing(problem: _Problem, law: Callable[[_Problem], FloatArray | None]) -> FloatArray | None:
    """Return forces that a law (sticking or sliding) gives, leaving out points that would pull; None if invalid.

    Invalid forces leave a penetration, or exceed the friction cone.
    """
    active = np.ones(len(problem.min_speeds), dtype=bool)
    for _ in range(len(active)):
        f = law(problem.part(active)) if active.any() else None
        if f is None:
            return None
        pulls = f[::3] < 0.0
        if pulls.any():
            active[np.flatnonzero(active)[pulls]] = False
            continue
        across = np.hypot(f[1::3], f[2::3])
        forces = np.zeros_like(problem.free)
        forces[np.repeat(active, 3)] = f
        apart = (problem.free + problem.A @ forces)[::3] >= problem.min_speeds - _SPEED
        return (
            forces if apart.all() and (across <= problem.friction[active] * f[::3] * (1.0 + _TOLERANCE)).all() else None
        )
    return None


def _sticking(problem: _Problem) -> FloatArray:
    """Return the forces with minimum norm for which no point slides, shape (3 n,) [N]."""
    aim = -problem.free
    aim[::3] += problem.min_speeds
    if problem.friction.all():
        return _min_norm(problem.A, aim)
    used = np.ones(len(aim), dtype=bool)
    used[1::3] = used[2::3] = problem.friction > 0.0
    f = np.zeros_like(aim)
    f[used] = _min_norm(problem.A[np.ix_(used, used)], aim[used])
    return f


def _sliding(problem: _Problem) -> FloatArray | None:
    """Return the forces with minimum norm if all points slide, shape (3 n,) [N]; None if that does not converge."""
    A, speeds = problem.A, problem.free
    old = np.zeros((len(problem.min_speeds), 2))
    for _ in range(_ROUNDS):
        across = np.column_stack([speeds[1::3], speeds[2::3]])
        size = np.hypot(across[:, 0], across[:, 1])
        if (size < _SPEED).any():
            return None
        direction = across / size[:, None]
        per_load = A[:, ::3] - problem.friction * (A[:, 1::3] * direction[:, 0] + A[:, 2::3] * direction[:, 1])
        load = np.linalg.lstsq(per_load[::3], problem.min_speeds - problem.free[::3], rcond=_SINGULAR)[0]
        speeds = problem.free + per_load @ load
        if np.abs(direction - old).max() < _TOLERANCE:
            bound = problem.friction * load
            return np.column_stack([load, -bound * direction[:, 0], -bound * direction[:, 1]]).ravel()
        old = direction
    return None


def _min_norm(A: FloatArray, aim: FloatArray) -> FloatArray:
    """Return f with minimum norm and A f = aim; A is symmetric, and singular if several points support one body."""
    values, vectors = np.linalg.eigh(A)
    regular = values > _SINGULAR * max(values[-1], 0.0)
    V = vectors[:, regular]
    return np.asarray(V @ ((V.T @ aim) / values[regular]))


def _sweeps(
    A: list[list[float]], free: list[float], min_speeds: list[float], friction: list[float], f: list[float]
) -> list[float]:
    """Return contact forces by projected Gauss-Seidel iteration: normal force >= 0, friction within its cone.

    Arguments as in `_Problem`, as lists of floats; f: initial forces, which are changed in place.
    """
    n = len(f)
    for _ in range(_SWEEPS):
        change, largest = 0.0, 0.0
        for k, (speed, mu) in enumerate(zip(min_speeds, friction, strict=True)):
            i = 3 * k
            row, old = A[i], f[i]
            if row[i] <= 1e-12:
                continue  # neither body can yield
            new = old + (speed - free[i] - total(map(float.__mul__, row, f))) / row[i]
            f[i] = new = max(new, 0.0)
            change, largest = max(change, abs(new - old)), max(largest, new)
            if mu > 0.0:
                change = max(change, _rub(A, free, f, i, mu * new))
        if (n == 3 and friction[0] == 0.0) or change <= _TOLERANCE * largest:
            break
    return f


def _rub(A: list[list[float]], free: list[float], f: list[float], i: int, bound: float) -> float:
    """Update the friction force of the point whose normal row is i, at most `bound` [N]; return the change [N]."""
    before = f[i + 1], f[i + 2]
    for j in (i + 1, i + 2):
        if A[j][j] > 1e-12:
            f[j] -= (free[j] + total(map(float.__mul__, A[j], f))) / A[j][j]
    size = math.hypot(f[i + 1], f[i + 2])
    if size > bound:
        f[i + 1], f[i + 2] = f[i + 1] * bound / size, f[i + 2] * bound / size
    return max(abs(f[i + 1] - before[0]), abs(f[i + 2] - before[1]))
