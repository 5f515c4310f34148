"""Static optimisation against independent solutions: Lawson & Hanson's least distance programming for the activations,
bounded least squares for the nearest torque.

The rounding of both goes with the condition of a task, so 1e-9 is asked of all of them.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import lsq_linear, minimize, nnls

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.muscles.static_optimization import StaticOptimization

MINIMUM = 0.01
JOINTS = 7
SHOULDER, FOREARM, WRIST = slice(0, 3), slice(3, 5), (5, 6)
Task = tuple[FloatArray, FloatArray, FloatArray]
"""Problem of static optimisation: moment arms [m], gain [N], torque [N m]."""


def _least_distance(B: FloatArray, torque: FloatArray, least: FloatArray) -> FloatArray | None:
    """min |a| with B^T a = torque, least <= a <= 1; None where rounding decides whether there is one.

    Solving Least Squares Problems, chapter 23.4, over the null space of B^T: the square of the residual is
    1 / (1 + |z|^2) where z, the part in the null space, exists, and 0 where it does not; x grows where it hardly does.
    """
    particular = np.linalg.lstsq(B.T, torque, rcond=None)[0]
    _, values, vt = np.linalg.svd(B.T)
    null = vt[int((values > 1e-12 * values[0]).sum()) :].T
    bounds = np.concatenate([least - particular, particular - 1.0])
    E = np.vstack([np.vstack([null, -null]).T, bounds])
    wanted = np.zeros(len(E))
    wanted[-1] = 1.0
    x, residual = nnls(E, wanted, maxiter=10000)
    if residual**2 < 0.5 / (1 + len(B)) or x.max() > 1e6:
        return None
    r = E @ x - wanted
    a: FloatArray = particular - null @ (r[:-1] / r[-1])
    return a


def _least_distance_on_face(
    B: FloatArray, torque: FloatArray, shortfall: FloatArray, least: FloatArray
) -> FloatArray | None:
    """Return the solution of `_least_distance` if all muscles along a shortfall are at their bounds.

    Return None if rounding decides.
    """
    pull = B @ shortfall
    free = np.abs(pull) <= 1e-9 * np.linalg.norm(B, axis=1) * np.linalg.norm(shortfall)
    a = np.where(pull > 0.0, 1.0, least)
    if free.any():
        if np.linalg.cond(B[free]) > 1e4 and np.linalg.matrix_rank(B[free]) == B.shape[1]:
            return None
        rest = torque - shortfall - B[~free].T @ a[~free]
        solved = _least_distance(B[free], rest, least[free])
        if solved is None or np.abs(B[free].T @ solved - rest).max() > 1e-10:
            return None
        a[free] = solved
    return a if ((a >= least - 1e-9) & (a <= 1.0 + 1e-9)).all() else None


def _any_task(rng: np.random.Generator) -> Task:
    """Return a random problem with any number of muscles and joints; many moment arms and some gains are zero."""
    k = int(rng.integers(3, 40))
    m = int(rng.integers(1, min(k, 7) + 1))
    arms = rng.normal(0.0, 0.02, (k, m)) * (rng.random((k, m)) < 0.6)
    gain = rng.uniform(50.0, 1200.0, k) * (rng.random(k) < 0.95)
    return _with_torque(rng, arms, gain)


def _arm(rng: np.random.Generator) -> Task:
    """Return a problem like that of an arm: muscles of the shoulder, of elbow and forearm, of both, and a pair of
    actuators at each of the two wrist joints."""
    arms = np.zeros((36, JOINTS))
    arms[:18, SHOULDER] = rng.normal(0.0, 0.02, (18, 3))
    arms[18:22] = rng.normal(0.0, 0.02, (4, JOINTS))
    arms[22:32, FOREARM] = rng.normal(0.0, 0.02, (10, 2))
    arms[22:28, 4] = 0.0
    arms[18:22, 5:] = 0.0
    gain = rng.uniform(100.0, 1200.0, 36)
    for row, (joint, sign, torque) in enumerate(((5, 1, 12.2), (5, -1, 7.1), (6, 1, 9.5), (6, -1, 11.0)), 32):
        arms[row] = 0.0
        arms[row, joint] = sign
        gain[row] = torque
    return _with_torque(rng, arms, gain)


def _with_torque(rng: np.random.Generator, arms: FloatArray, gain: FloatArray) -> Task:
    """Return the problem with a torque: reachable between all bounds, or with many muscles at a bound, or any."""
    B, k = gain[:, None] * arms, len(gain)
    kind = rng.integers(3)
    if kind == 2:
        return arms, gain, rng.normal(0.0, 0.3, arms.shape[1]) * np.abs(B).sum(axis=0)
    a = rng.uniform(MINIMUM, 1.0, k) if kind == 0 else np.clip(rng.normal(0.3, 0.6, k), MINIMUM, 1.0)
    return arms, gain, B.T @ a


@pytest.mark.parametrize("make", [_any_task, _arm])
def test_activations_are_those_of_an_independent_solution(make: Callable[[np.random.Generator], Task]) -> None:
    rng = np.random.default_rng(17)
    compared = nearest = 0
    for _ in range(1500):
        arms, gain, torque = make(rng)
        B, least = gain[:, None] * arms, np.full(len(gain), MINIMUM)
        found = StaticOptimization(*arms.shape).solve(arms, gain, torque)
        assert ((found.activation >= MINIMUM) & (found.activation <= 1.0)).all()
        assert torque - B.T @ found.activation == pytest.approx(found.shortfall, abs=1e-9)
        if found.shortfall.any():
            reached = lsq_linear(B.T, torque, (least, 1.0), method="bvls", tol=1e-15, max_iter=1000).x
            assert found.shortfall == pytest.approx(torque - B.T @ reached, abs=1e-9)
            nearest += 1
        expected = _least_distance_on_face(B, torque, found.shortfall, least)
        if expected is not None:
            assert found.activation == pytest.approx(expected, abs=1e-9)
            compared += 1
    assert compared > 900 and nearest > 100


def test_activations_are_those_of_a_general_solver() -> None:
    rng = np.random.default_rng(3)
    for _ in range(5):
        arms, gain, _ = _arm(rng)
        B = gain[:, None] * arms
        torque = B.T @ np.clip(rng.normal(0.2, 0.3, len(gain)), MINIMUM, 0.9)
        expected = minimize(
            lambda a: float(a @ a),
            np.full(len(gain), 0.5),
            jac=lambda a: 2.0 * a,
            method="SLSQP",
            bounds=[(MINIMUM, 1.0)] * len(gain),
            constraints={"type": "eq", "fun": lambda a, B=B, t=torque: B.T @ a - t, "jac": lambda a, B=B: B.T},
            options={"ftol": 1e-15, "maxiter": 500},
        ).x
        found = StaticOptimization(*arms.shape).solve(arms, gain, torque)
        assert found.activation == pytest.approx(expected, abs=1e-6)


def test_one_joint_with_two_muscles_is_shared_by_the_torque_of_each() -> None:
    """a_i proportional to b_i, from the stationarity of a^2: 4 N m of muscles of 6 and 2 N m are 0.6 and 0.2."""
    found = StaticOptimization(2, 1).solve(np.array([[0.03], [0.02]]), np.array([200.0, 100.0]), [4.0])
    assert found.activation == pytest.approx([0.6, 0.2], abs=1e-12)


def test_the_result_is_the_same_bits_from_any_start() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        arms, gain, torque = _arm(rng)
        warm = StaticOptimization(*arms.shape)
        warm.solve(arms, gain, -0.5 * torque)
        warm.solve(arms, gain, 0.9 * torque)
        cold = StaticOptimization(*arms.shape).solve(arms, gain, torque)
        found = warm.solve(arms, gain, torque)
        assert found.activation.tobytes() == cold.activation.tobytes()
        assert found.shortfall.tobytes() == cold.shortfall.tobytes()


def test_the_last_solution_saves_steps() -> None:
    arms, gain, _ = _arm(np.random.default_rng(8))
    torque = (gain[:, None] * arms).T @ np.linspace(0.05, 0.4, len(gain))
    solver = StaticOptimization(*arms.shape)
    cold = solver.solve(arms, gain, torque).iterations
    warm = [solver.solve(arms, gain, (1.0 + 0.002 * n) * torque).iterations for n in range(1, 50)]
    assert float(np.mean(warm)) < 0.6 * cold


def test_co_contraction_raises_activations_and_leaves_the_torque() -> None:
    arms, gain, _ = _arm(np.random.default_rng(2))
    B = gain[:, None] * arms
    torque = B.T @ np.full(len(gain), 0.3)
    raised = np.linspace(0.0, 0.25, len(gain))
    found = StaticOptimization(*arms.shape).solve(arms, gain, torque, raised)
    assert (found.activation >= MINIMUM + raised).all()
    assert B.T @ found.activation == pytest.approx(torque, abs=1e-9)
    expected = _least_distance(B, torque, MINIMUM + raised)
    assert found.activation == pytest.approx(expected, abs=1e-9)


def test_a_muscle_without_gain_rests_and_a_joint_without_muscles_falls_short() -> None:
    arms = np.array([[0.03, 0.0], [-0.02, 0.0], [0.05, 0.0]])
    found = StaticOptimization(3, 2).solve(arms, np.array([200.0, 100.0, 0.0]), [3.0, 1.5])
    assert found.activation == pytest.approx([(3.0 + 0.02) / 6.0, MINIMUM, MINIMUM], abs=1e-12)
    assert found.shortfall == pytest.approx([0.0, 1.5], abs=1e-12)


def test_two_actuators_out_of_reach_leave_the_other_joints_alone() -> None:
    arms = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    found = StaticOptimization(4, 2, 0.0).solve(arms, np.array([12.0, 7.0, 10.0, 11.0]), [15.0, -5.5])
    assert found.activation == pytest.approx([1.0, 0.0, 0.0, 0.5], abs=1e-12)
    assert found.shortfall == pytest.approx([3.0, 0.0], abs=1e-12)


def test_no_muscle_with_torque_gives_all_as_shortfall() -> None:
    found = StaticOptimization(3, 2).solve(np.zeros((3, 2)), np.ones(3), [1.0, -2.0])
    assert found.activation.tolist() == [MINIMUM] * 3
    assert found.shortfall.tolist() == [1.0, -2.0]


def test_after_a_refused_task_the_next_one_is_solved_as_ever() -> None:
    arms, gain, torque = _arm(np.random.default_rng(6))
    solver = StaticOptimization(*arms.shape)
    expected = solver.solve(arms, gain, torque)
    with pytest.raises(HricError, match="torque is not finite"):
        solver.solve(arms, gain, math.nan * torque)
    found = solver.solve(arms, gain, torque)
    assert found.activation.tobytes() == expected.activation.tobytes()


def test_what_does_not_fit_is_refused_by_name() -> None:
    solver = StaticOptimization(3, 2)
    with pytest.raises(HricError, match=r"torque \(3,\); valid"):
        solver.solve(np.zeros((3, 2)), np.ones(3), [1.0, 2.0, 3.0])
    with pytest.raises(HricError, match="gain and torque are not finite"):
        solver.solve(np.zeros((3, 2)), np.array([1.0, math.nan, 1.0]), [1.0, math.inf])
    with pytest.raises(HricError, match="co-contraction"):
        solver.solve(np.zeros((3, 2)), np.ones(3), [1.0, 2.0], np.array([0.0, 0.0, 1.5]))
    with pytest.raises(HricError, match="0 muscles on 2 joints"):
        StaticOptimization(0, 2)
