"""The arithmetic of a step in C beside numpy's and scipy's own, and views of OpenSim's memory."""

import math

import numpy as np
import opensim
import pytest
from scipy.linalg.lapack import dposv

from hric_control.plants import Losses
from opensim_ros_control import stages

N = 7


@pytest.fixture
def M(rng):
    X = rng.normal(size=(N, N))
    return X @ X.T + np.eye(N)


def test_the_equations_are_numpys_and_scipys_to_the_last_bit(rng, M):
    b, a, tau = rng.uniform(0.0, 0.2, N), *rng.normal(size=(2, N))
    A, drive = stages.balance(M, b, a, tau)
    assert np.array_equal(A, M + np.diag(b))
    assert np.array_equal(drive, M @ a + tau)
    columns = rng.normal(size=(N, 3))
    assert np.array_equal(stages.solve(A, drive), dposv(A, drive)[1])
    assert np.array_equal(stages.solve(A, columns), dposv(A, columns)[1])


def test_equations_without_cholesky_factors_have_no_solution(M):
    assert stages.solve(-M, np.ones(N)) is None


def test_states_advance_as_by_numpy(rng):
    y, *rates = rng.normal(size=(4, 2 * N + 3))
    assert np.array_equal(stages.rate(y, rates[0][:N]), [*y[N : 2 * N], *rates[0][:N], 0.0, 0.0, 0.0])
    assert np.array_equal(stages.advanced(y, 5e-4, rates[0]), y + 5e-4 * rates[0])
    weighted = 2.0 * rates[0] + 3.0 * rates[1] + 4.0 * rates[2]
    assert np.array_equal(stages.ralston(y, 1e-3, *rates), y + 1e-3 / 9.0 * weighted)


def test_friction_is_that_of_its_rows(rng):
    tau, u = rng.normal(size=(2, N))
    rows = np.array([Losses(sigmoid=(0.6, 5.0 + i, 0.03)).sigmoid_row() for i in range(N)])
    expected = [t - a * (math.tanh(b * (v + c)) - d) for t, v, (a, b, c, d) in zip(tau, u, rows, strict=True)]
    assert stages.rubbed(tau, u, rows).tolist() == expected


def test_efforts_are_cut_and_what_is_no_number_stays():
    efforts, tau = stages.cut([-2.0, 0.5, 3, math.nan], (-1.0,) * 4, (1.0,) * 4)
    assert efforts[:3] == tau.tolist()[:3] == [-1.0, 0.5, 1.0]
    assert math.isnan(efforts[3])


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda: stages.balance(np.eye(3), np.ones(2), np.ones(2), np.ones(2)), ValueError),
        (lambda: stages.solve(np.eye(4)[:, ::2], np.ones(2)), TypeError),
        (lambda: stages.solve(np.eye(2, dtype=int), np.ones(2)), TypeError),
        (lambda: stages.solve([[1.0]], [1.0]), TypeError),
        (lambda: stages.rate(np.ones(3), np.ones(2)), ValueError),
        (lambda: stages.rubbed(np.ones(2), np.ones(3), np.ones((2, 4))), ValueError),
        (lambda: stages.advanced(np.ones(2), "0.1", np.ones(2)), TypeError),
        (lambda: stages.ralston(np.ones(2), 0.1, np.ones(2), np.ones(2), np.ones(1)), ValueError),
        (lambda: stages.cut([1.0], [0.0, 0.0], [1.0]), ValueError),
        (lambda: stages.cut([1.0], [0.0]), TypeError),
    ],
)
def test_what_does_not_fit_is_refused(call, error):
    with pytest.raises(error):
        call()


def test_a_view_is_opensims_own_memory():
    vector = opensim.Vector(3, 2.5)
    values = stages.view(vector)
    values[1] = 7.0
    assert (values.tolist(), vector.get(1)) == ([2.5, 7.0, 2.5], 7.0)


def test_numbers_apart_from_each_other_have_no_view():
    matrix = opensim.Matrix(3, 3)
    with pytest.raises(ValueError, match="3 numbers are not in a row"):
        stages.view(matrix.updRow(0))
