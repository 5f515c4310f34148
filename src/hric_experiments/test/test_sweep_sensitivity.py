"""Sensitivities against the closed form of Ishigami's function and against scipy; refusals."""

import numpy as np
import pytest
from scipy import stats

from hric_control.errors import HricError
from hric_experiments.sweep.samplers.make import SAMPLER, make
from hric_experiments.sweep.space import Space
from hric_experiments.sweep.statistics.sensitivity import indices, rank_correlation
from hric_experiments.sweep.variables import Variable

A, B = 7.0, 0.1
"""Of Ishigami's function (Ishigami & Homma, 1990)."""
VARIANCE = A**2 / 8.0 + B * np.pi**4 / 5.0 + B**2 * np.pi**8 / 18.0 + 0.5
FIRST = {"a": 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2 / VARIANCE, "b": A**2 / 8.0 / VARIANCE, "c": 0.0}
BOTH = 8.0 * B**2 * np.pi**8 / 225.0 / VARIANCE
"""What a and c explain together only."""
TOTAL = {"a": FIRST["a"] + BOTH, "b": FIRST["b"], "c": BOTH}


def space(correlation: tuple[tuple[str, str, float], ...] = ()) -> Space:
    uniform = {"kind": "uniform", "low": -np.pi, "high": np.pi}
    return Space({n: Variable.of({"paths": n, "distribution": uniform}, "x") for n in "abc"}, correlation)


def ishigami(runs: int) -> np.ndarray:
    of = space()
    points = make(SAMPLER.checked({"kind": "saltelli"}, "x"), of, runs, 1).ask()
    a, b, c = (np.array([row[n] for row in of.values(np.array([p.u for p in points]))]) for n in "abc")
    return np.sin(a) + A * np.sin(b) ** 2 + B * c**4 * np.sin(a)


def test_indices_of_ishigamis_function_are_those_of_its_closed_form() -> None:
    found = indices(space(), ishigami(5 * 4096))
    for name in "abc":
        assert found[name].first == pytest.approx(FIRST[name], abs=0.02)
        assert found[name].total == pytest.approx(TOTAL[name], abs=0.02)


def test_their_intervals_have_the_closed_form_in_them() -> None:
    found = indices(space(), ishigami(5 * 512))
    inside = [one.first_interval[0] <= FIRST[name] <= one.first_interval[1] for name, one in found.items()]
    inside += [one.total_interval[0] <= TOTAL[name] <= one.total_interval[1] for name, one in found.items()]
    assert sum(inside) >= 5


def test_indices_are_those_of_scipy_from_the_same_runs() -> None:
    output = ishigami(5 * 256)
    a, b, *mixed = output.reshape(5, -1)
    given = {"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}
    same = stats.sobol_indices(func=given, n=256)
    found = indices(space(), output)
    assert [one.first for one in found.values()] == pytest.approx(same.first_order.ravel(), abs=1e-9)
    assert [one.total for one in found.values()] == pytest.approx(same.total_order.ravel(), abs=1e-9)


def test_rows_with_a_failed_run_are_left_out() -> None:
    output = ishigami(5 * 256)
    output[[3, 256 + 7, 4 * 256 + 3]] = np.nan
    found = indices(space(), output)
    assert all(one.rows == 254 for one in found.values())


@pytest.mark.parametrize(
    "output, words",
    [(np.zeros(11), "no design"), (np.ones(5 * 32), "the same in all runs"), (np.full(5 * 32, np.nan), "0 rows")],
)
def test_runs_without_indices_are_refused(output: np.ndarray, words: str) -> None:
    with pytest.raises(HricError, match=words):
        indices(space(), output)


def test_indices_of_correlated_variables_are_refused() -> None:
    with pytest.raises(HricError, match="not defined for correlated"):
        indices(space((("a", "b", 0.2),)), ishigami(5 * 32))


def test_ranks_correlate_whatever_the_shape_as_long_as_it_rises() -> None:
    values = np.random.default_rng(0).random(50)
    assert rank_correlation(values, np.exp(5.0 * values)) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-9))
    output = np.append(-values[:-1], np.nan)
    assert rank_correlation(values, output)[0] == pytest.approx(-1.0)


def test_ranks_of_a_constant_are_refused() -> None:
    with pytest.raises(HricError, match="both vary"):
        rank_correlation(np.ones(5), np.arange(5.0))
