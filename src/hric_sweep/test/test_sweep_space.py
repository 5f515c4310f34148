"""Variables of a sweep: distributions against scipy's, populations against their sources, correlation, refusals."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from hric_core.errors import HricError
from hric_sweep import populations
from hric_sweep.space import Space
from hric_sweep.variables import Variable

U = np.linspace(1e-6, 1.0 - 1e-6, 101)


def variable(**distribution: Any) -> Variable:
    return Variable.of({"paths": "a.b", "unit": "N", "distribution": distribution}, "sweep.vary.x")


@pytest.mark.parametrize(
    "given, same",
    [
        ({"kind": "uniform", "low": -1.0, "high": 3.0}, stats.uniform(-1.0, 4.0)),
        ({"kind": "log_uniform", "low": 0.1, "high": 20.0}, stats.loguniform(0.1, 20.0)),
        ({"kind": "triangular", "low": 1.0, "mode": 2.0, "high": 5.0}, stats.triang(0.25, 1.0, 4.0)),
        ({"kind": "triangular", "low": 1.0, "mode": 5.0, "high": 5.0}, stats.triang(1.0, 1.0, 4.0)),
        ({"kind": "normal", "mean": 1.2, "std": 0.2}, stats.norm(1.2, 0.2)),
        ({"kind": "normal", "mean": 1.0, "std": 0.5, "low": 0.8, "high": 2.0}, stats.truncnorm(-0.4, 2.0, 1.0, 0.5)),
        ({"kind": "normal", "mean": 0.0, "std": 1.0, "low": 3.0}, stats.truncnorm(3.0, np.inf)),
        ({"kind": "log_normal", "median": 2.0, "log_std": 0.3}, stats.lognorm(0.3, scale=2.0)),
    ],
)
def test_percentiles_of_each_kind_are_those_of_scipy(given: dict[str, Any], same: Any) -> None:
    assert np.allclose(variable(**given).distribution.ppf(U), same.ppf(U), rtol=1e-9, atol=1e-9)


def test_a_truncated_log_normal_has_the_percentiles_of_the_part_between_its_ends() -> None:
    whole = stats.lognorm(0.5, scale=2.0)
    low, high = whole.cdf([1.0, 4.0])
    found = variable(kind="log_normal", median=2.0, log_std=0.5, low=1.0, high=4.0).distribution.ppf(U)
    assert np.allclose(found, whole.ppf(low + U * (high - low)), rtol=1e-9)
    assert min(found) >= 1.0 and max(found) <= 4.0


def test_a_choice_gives_each_value_by_its_weight() -> None:
    chosen = variable(kind="choice", values=["none", 2, True], weights=[1.0, 2.0, 1.0]).distribution
    values = chosen.ppf((np.arange(400) + 0.5) / 400)
    assert [values.count(one) for one in ("none", 2, True)] == [100, 200, 100]


def test_people_of_a_percentile_are_the_subjects_that_the_table_names() -> None:
    shares = np.array([0.33, 0.81])
    assert np.allclose(populations.quantity("adult_male", "mass").ppf(shares), [78.2, 102.5])
    shares = np.array([0.05, 0.5])
    assert np.allclose(populations.quantity("adult_female", "height").ppf(shares), [1.518, 1.618])


def test_half_of_a_mixed_population_are_women() -> None:
    mixed = populations.quantity("adult_mixed", "height").ppf(U)
    parts = [populations.quantity(of, "height") for of in ("adult_female", "adult_male")]
    assert np.allclose(0.5 * parts[0].cdf(mixed) + 0.5 * parts[1].cdf(mixed), U, atol=1e-12)


@pytest.mark.parametrize("quantity", populations.QUANTITIES)
@pytest.mark.parametrize("of", populations.names())
def test_quantities_of_a_population_rise_with_the_percentile_and_are_of_a_person(of: str, quantity: str) -> None:
    low, high = {"mass": (30, 200), "height": (1.2, 2.2), "strength": (0.3, 3.0), "reaction_time": (0.1, 0.6)}[quantity]
    given = {"kind": "population", "of": of, "quantity": quantity}
    values = np.array(Variable.of({"paths": "a", "distribution": given}, "x").distribution.ppf(U))
    assert np.all(np.diff(values) > 0.0) and low < values[0] and values[-1] < high


def test_a_quantity_of_a_population_has_its_own_unit_and_refuses_another() -> None:
    given = {
        "paths": "human.subject.mass",
        "distribution": {"kind": "population", "of": "adult_male", "quantity": "mass"},
    }
    assert Variable.of(given, "x").unit == "kg"
    with pytest.raises(HricError, match="unit is 'g'; valid: kg"):
        Variable.of({**given, "unit": "g"}, "x")


def space(*correlation: Any) -> Space:
    normal = variable(kind="normal", mean=10.0, std=2.0)
    return Space({"a": normal, "b": variable(kind="uniform", low=0.0, high=1.0), "c": normal}, correlation)


def test_variables_without_correlation_get_the_percentile_of_their_own_coordinate() -> None:
    u = np.random.default_rng(0).random((50, 3))
    values = space().values(u)
    assert space().independent
    assert np.allclose([row["a"] for row in values], stats.norm(10.0, 2.0).ppf(u[:, 0]))
    assert np.allclose([row["b"] for row in values], u[:, 1])


def test_a_correlation_is_one_of_ranks_and_leaves_each_distribution_as_it_is() -> None:
    u = stats.qmc.Sobol(3, rng=np.random.default_rng(1)).random_base2(14)
    values = space(["a", "b", 0.6], ["b", "c", -0.3]).values(u)
    a, b, c = (np.array([row[name] for row in values]) for name in "abc")
    # Spearman's coefficient of a Gaussian copula: 6/pi asin(r/2) (Kruskal, JASA 53:814, 1958).
    for one, other, r in ((a, b, 0.6), (b, c, -0.3), (a, c, 0.0)):
        assert stats.spearmanr(one, other).statistic == pytest.approx(6.0 / np.pi * np.arcsin(r / 2.0), abs=5e-3)
    assert stats.kstest(a, stats.norm(10.0, 2.0).cdf).statistic < 0.01
    assert stats.kstest(b, stats.uniform.cdf).statistic < 0.01


def test_the_edges_of_the_cube_have_finite_values() -> None:
    values = space(["a", "b", 0.9]).values(np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]]))
    assert all(np.isfinite(value) for row in values for value in row.values())


@pytest.mark.parametrize(
    "correlation, words",
    [
        ([["a", "x", 0.5]], "no variable 'x'"),
        ([["a", "a", 0.5]], "two different variables"),
        ([["a", "b", 1.0]], "between -1 and 1"),
        ([["a", "b", True]], "between -1 and 1"),
        ([["a", "b", 0.5], ["b", "a", 0.2]], "each pair only once"),
        ([["a", "b", 0.9], ["b", "c", 0.9], ["a", "c", -0.9]], "positive definite"),
    ],
)
def test_a_correlation_that_cannot_be_is_refused(correlation: list[Any], words: str) -> None:
    with pytest.raises(HricError, match=words):
        space(*correlation)


@pytest.mark.parametrize(
    "given, words",
    [
        ({"kind": "uniform", "low": 1.0, "high": 1.0}, r"high is 1.0; valid: a finite number above low \(1\)"),
        ({"kind": "triangular", "low": 0.0, "mode": 2.0, "high": 1.0}, "mode is 2.0"),
        ({"kind": "normal", "mean": 0.0, "std": 1.0, "low": 9.0}, "low, high"),
        ({"kind": "log_normal", "median": 1.0, "log_std": 0.1, "high": -1.0}, "low, high"),
        ({"kind": "choice", "values": [1, 2], "weights": [1.0]}, "2 values, one for each"),
        ({"kind": "population", "of": "adults", "quantity": "mass"}, "valid: adult_female, adult_male, adult_mixed"),
        ({"kind": "population", "of": "adult_male", "quantity": "mass", "percentiles": [95, 5]}, "the lower one first"),
        ({"kind": "gaussian"}, "no kind 'gaussian'"),
    ],
)
def test_a_distribution_that_cannot_be_is_refused_with_what_can(given: dict[str, Any], words: str) -> None:
    with pytest.raises(HricError, match=words):
        variable(**given)


def test_a_sweep_without_variables_is_refused() -> None:
    with pytest.raises(HricError, match="vary is empty"):
        Space({})
