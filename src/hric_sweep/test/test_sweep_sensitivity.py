"""Sensitivities against the closed form of Ishigami's function and against scipy; refusals."""

import numpy as np
import pytest
from scipy import stats

from hric_core.errors import HricError
from hric_sweep.samplers.make import SAMPLER, make
from hric_sweep.space import Space
from hric_sweep.statistics.sensitivity import indices, rank_correlation
from hric_sweep.variables import Variable

A, B = 7.0, 0.1
"""Parameters of Ishigami's function (Ishigami & Homma, 1990)."""
VARIANCE = A**2 / 8.0 + B * np.pi**4 / 5.0 + B**2 * np.pi**8 / 18.0 + 0.5
FIRST = {"a": 0.5 * (1.0 + B * np.pi**4 / 5.0) ** 2 / VARIANCE, "b": A**2 / 8.0 / VARIANCE, "c": 0.0}
BOTH = 8.0 * B**2 * np.pi**8 / 225.0 / VARIANCE
"""Share of the variance that only the interaction of a and c explains [1]."""
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


def test_intervals_of_the_bootstrap_are_around_their_own_index_and_as_wide_as_their_level() -> None:
    """A mean of 512 values is nearly normal: interval of 1.96 deviations at 95 %, 0.674 at 50 %, 0 at 0 %."""
    output = ishigami(5 * 512)
    wide, half, none = (indices(space(), output, level=level)["a"] for level in (0.95, 0.5, 0.0))
    assert (wide.level, half.level, wide.rows) == (0.95, 0.5, 512)
    for low, high, index in ((*wide.first_interval, wide.first), (*wide.total_interval, wide.total)):
        assert low < index < high
        assert 0.3 < (index - low) / (high - low) < 0.7
    assert wide.first_interval[1] < wide.total_interval[0]
    for name in ("first_interval", "total_interval"):
        width, narrow = (float(np.diff(getattr(one, name))[0]) for one in (wide, half))
        assert width / narrow == pytest.approx(1.96 / 0.674, rel=0.15)
        low, high = getattr(none, name)
        assert low == high


def test_a_bootstrap_is_that_of_its_seed_which_is_0_without_one() -> None:
    output = ishigami(5 * 64)
    assert indices(space(), output) == indices(space(), output, seed=0)
    assert indices(space(), output, seed=0) != indices(space(), output, seed=1)


@pytest.mark.parametrize("row", [0, 15])
def test_draws_in_which_nothing_varies_have_no_say_and_each_of_the_fewest_rows_may_be_drawn(row: int) -> None:
    output = np.ones(5 * 16)
    output[row::16] = [2.0, 3.0, 4.0, 5.0, 6.0]
    found = indices(space(), output)
    assert all(np.isfinite([*one.first_interval, *one.total_interval]).all() for one in found.values())


@pytest.mark.parametrize(
    "output, words",
    [
        (np.zeros(11), "11 runs are no Saltelli design; valid: a multiple of 5 in order of index"),
        (np.ones(5 * 32), "the output is equal in all runs"),
        (np.repeat([1.0, 1.0, 2.0, 3.0, 4.0], 32), "the output is equal in all runs"),
        (np.full(5 * 32, np.nan), "0 rows"),
        (np.arange(5.0 * 15), "only 15 rows of the design have no failed run; valid: 16 or more"),
        (np.append(np.arange(5.0 * 32 - 2), [np.inf, -np.inf]), "the output is infinite in 2 runs"),
    ],
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


@pytest.mark.parametrize("runs", [3, 4, 30])
def test_a_correlation_of_ranks_and_its_chance_are_those_of_scipy_with_equal_values_too(runs: int) -> None:
    random = np.random.default_rng(runs)
    values, output = np.append(random.integers(0, 9, runs - 2), [3, 4]), np.append(random.random(runs - 2), [0.5, 0.2])
    expected = stats.spearmanr(values, output)
    assert rank_correlation(values.astype(float), output) == pytest.approx(
        (expected.statistic, expected.pvalue), abs=1e-12
    )


def test_weights_of_equal_size_count_as_none_and_a_run_that_weighs_twice_as_two() -> None:
    random = np.random.default_rng(4)
    values, output = random.random(20), random.random(20)
    plain = rank_correlation(values, output)
    assert rank_correlation(values, output, np.full(20, 0.3)) == pytest.approx(plain)
    weights = np.array([2.0, 1.0] * 10)
    twice = rank_correlation(np.repeat(values, [2, 1] * 10), np.repeat(output, [2, 1] * 10))
    coefficient, chance = rank_correlation(values, output, weights)
    assert coefficient == pytest.approx(twice[0])
    freedom = 30.0**2 / 50.0 - 2.0  # (sum w)^2 / sum w^2, less two
    t = abs(coefficient) * np.sqrt(freedom / (1.0 - coefficient**2))
    assert chance == pytest.approx(2.0 * stats.t.sf(t, freedom))


def test_a_variable_that_varies_among_runs_without_weight_alone_does_not_vary() -> None:
    with pytest.raises(HricError, match="at least 3 runs, in which both quantities vary"):
        rank_correlation(np.array([1.0, 1.0, 1.0, 2.0, 3.0]), np.arange(5.0), np.array([1.0, 1.0, 1.0, 0.0, 0.0]))


def test_two_runs_have_no_correlation_of_ranks() -> None:
    with pytest.raises(HricError, match="at least 3 runs"):
        rank_correlation(np.array([1.0, 2.0]), np.array([1.0, 2.0]))


def test_an_output_that_is_constant_has_no_correlation_of_ranks() -> None:
    with pytest.raises(HricError, match="both quantities vary"):
        rank_correlation(np.arange(5.0), np.ones(5))


def test_ranks_of_a_constant_are_refused() -> None:
    with pytest.raises(HricError, match="both quantities vary"):
        rank_correlation(np.ones(5), np.arange(5.0))
