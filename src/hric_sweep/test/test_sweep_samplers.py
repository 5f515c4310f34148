"""Samplers with fixed points: positions, refused settings, and equal points for equal seeds."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from hric_core.errors import HricError
from hric_sweep.samplers.make import SAMPLER, make
from hric_sweep.samplers.sampler import Sampler, SamplerResult
from hric_sweep.space import Space
from hric_sweep.statistics.intervals import clopper_pearson, effective_size, log_interval
from hric_sweep.variables import Variable


def space(*counts: int, correlation: Any = ()) -> Space:
    """Return a space of variables a, b, ... with the given numbers of values; 0: uniform from 0 to 1."""
    made = {}
    for name, count in zip("abcdefgh", counts, strict=False):
        uniform = {"kind": "uniform", "low": 0.0, "high": 1.0}
        distribution = {"kind": "choice", "values": list(range(count))} if count else uniform
        made[name] = Variable.of({"paths": name, "distribution": distribution}, f"sweep.vary.{name}")
    return Space(made, correlation)


def sampler(of: Space, kind: str, runs: int | None = None, seed: int = 0) -> Sampler:
    return make(SAMPLER.checked({"kind": kind}, "sweep.sampler"), of, runs, seed)


def points(of: Space, kind: str, runs: int | None = None, seed: int = 0) -> np.ndarray:
    return np.array([point.u for point in sampler(of, kind, runs, seed).ask()])


def test_a_grid_has_each_value_with_each_other_once() -> None:
    of = space(2, 3)
    pairs = [(row["a"], row["b"]) for row in of.values(points(of, "grid"))]
    assert pairs == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]


def test_a_list_has_the_first_values_together_then_the_second() -> None:
    of = space(3, 3)
    assert [(row["a"], row["b"]) for row in of.values(points(of, "list"))] == [(0, 0), (1, 1), (2, 2)]


def test_random_points_are_uniform_and_independent() -> None:
    u = points(space(0, 0), "random", 4000)
    assert all(stats.kstest(column, stats.uniform.cdf).pvalue > 0.01 for column in u.T)
    assert abs(stats.spearmanr(*u.T).statistic) < 0.05


def test_sobol_points_have_one_in_each_slice_and_a_small_discrepancy() -> None:
    u = points(space(0, 0, 0), "sobol", 256)
    assert all(sorted(np.floor(column * 256).astype(int)) == list(range(256)) for column in u.T)
    assert stats.qmc.discrepancy(u) < 0.1 * stats.qmc.discrepancy(points(space(0, 0, 0), "random", 256))


def test_a_latin_hypercube_has_one_point_in_each_slice() -> None:
    u = points(space(0, 0), "lhs", 77)
    assert all(sorted(np.floor(column * 77).astype(int)) == list(range(77)) for column in u.T)


def test_saltellis_matrices_share_the_columns_that_they_are_to_share() -> None:
    u = points(space(0, 0, 0), "saltelli", 5 * 16).reshape(5, 16, 3)
    a, b = u[0], u[1]
    for i in range(3):
        others = [j for j in range(3) if j != i]
        assert np.array_equal(u[2 + i][:, i], b[:, i]) and np.array_equal(u[2 + i][:, others], a[:, others])


@pytest.mark.parametrize("kind, runs", [("random", 10), ("sobol", 16), ("lhs", 10), ("saltelli", 16)])
def test_the_same_seed_gives_the_same_points_and_another_seed_others(kind: str, runs: int) -> None:
    of = space(0, 0)
    assert np.array_equal(points(of, kind, runs, 3), points(of, kind, runs, 3))
    assert not np.array_equal(points(of, kind, runs, 3), points(of, kind, runs, 4))


def test_given_points_come_in_one_batch_of_as_many_runs_as_there_are_at_most() -> None:
    one = sampler(space(0), "random", 7)
    assert len(one.ask()) == one.total == 7 and list(one.ask()) == []


@pytest.mark.parametrize(
    "counts, kind, runs, words",
    [
        ((0,), "sobol", 100, "runs is 100; valid: a power of two with the sampler sobol; the next one is 128"),
        ((0,), "random", None, "runs is None; valid: a whole number"),
        ((0, 0), "saltelli", 100, "4 times a power of two; the next one is 128"),
        ((0, 2), "grid", None, "vary is 'a'; valid: distributions of kind choice"),
        ((2, 3), "grid", 5, "runs is 5; valid: 6, the whole grid"),
        ((2, 3), "list", None, "vary is 'a 2, b 3'; valid: the same number of values"),
        ((0,), "sobl", 8, "no kind 'sobl'"),
    ],
)
def test_what_does_not_go_together_is_refused_with_what_does(
    counts: tuple[int, ...], kind: str, runs: int | None, words: str
) -> None:
    with pytest.raises(HricError, match=words):
        sampler(space(*counts), kind, runs)


def test_saltellis_design_is_refused_with_correlated_variables() -> None:
    with pytest.raises(HricError, match="variables without correlation"):
        sampler(space(0, 0, correlation=[["a", "b", 0.3]]), "saltelli", 16)


def test_random_runs_have_the_exact_interval_of_their_count() -> None:
    one = sampler(space(0), "random", 40)
    one.tell([SamplerResult(index=i, exceeded=point.u[0] > 0.9) for i, point in enumerate(one.ask())])
    made = one.estimate()
    assert made is not None and made.exceeded > 0 and made.check is None
    same = stats.binomtest(made.exceeded, 40).proportion_ci(0.95, "exact")
    assert (made.low, made.high) == pytest.approx((same.low, same.high))
    assert made.probability == made.exceeded / 40


def test_a_failed_run_may_have_exceeded_or_not() -> None:
    one = sampler(space(0), "random", 20)
    one.ask()
    one.tell([SamplerResult(index=i, exceeded=None if i < 2 else i < 5) for i in range(20)])
    made = one.estimate()
    assert made is not None and (made.exceeded, made.failed, made.runs) == (3, 2, 20)
    assert made.low == pytest.approx(clopper_pearson(3, 20).low)
    assert made.high == pytest.approx(clopper_pearson(5, 20).high)


@pytest.mark.parametrize("kind", ["grid", "list"])
def test_points_that_are_not_drawn_from_the_distributions_have_no_probability(kind: str) -> None:
    one = sampler(space(2), kind)
    one.tell([SamplerResult(index=i, exceeded=True) for i in range(len(one.ask()))])
    assert one.estimate() is None


def test_results_in_another_order_or_of_half_a_batch_are_refused() -> None:
    one = sampler(space(0), "random", 3)
    one.ask()
    with pytest.raises(HricError, match="in order of index"):
        one.tell([SamplerResult(index=i, exceeded=True) for i in (0, 2, 1)])
    with pytest.raises(HricError, match="those of 0 to 2"):
        one.tell([SamplerResult(index=0, exceeded=True)])


@pytest.mark.parametrize("exceeded, runs", [(0, 1), (0, 600), (3, 20), (20, 20), (599, 600), (40, 200_000)])
def test_ends_of_intervals_of_counts_are_quantiles_of_beta_distributions(exceeded: int, runs: int) -> None:
    def low(tail: float) -> float:
        return float(stats.beta.ppf(tail, exceeded, runs - exceeded + 1)) if exceeded else 0.0

    def high(tail: float) -> float:
        return float(stats.beta.isf(tail, exceeded + 1, runs - exceeded)) if exceeded < runs else 1.0

    for level in (0.9, 0.95):
        both = clopper_pearson(exceeded, runs, level)
        assert both == pytest.approx((low(0.5 - 0.5 * level), high(0.5 - 0.5 * level)), rel=1e-9, abs=1e-12)
        assert clopper_pearson(exceeded, runs, level, "less").high == pytest.approx(high(1.0 - level), rel=1e-9)


def test_with_none_exceeded_the_upper_limit_is_about_three_by_the_runs() -> None:
    assert clopper_pearson(0, 1000, side="less").high == pytest.approx(3.0 / 1000, rel=5e-3)


@pytest.mark.parametrize(
    ("exceeded", "runs", "level"), [(4, 3, 0.95), (-1, 3, 0.95), (0, 0, 0.95), (1, 3, 0.0), (1, 3, 1.0), (1, 3, 1.5)]
)
def test_counts_and_levels_that_cannot_be_have_no_interval(exceeded: int, runs: int, level: float) -> None:
    told = (
        f"{exceeded} of {runs} runs at level {level} give no confidence interval; "
        "valid: 0 <= exceeded <= runs, 0 < level < 1"
    )
    with pytest.raises(HricError) as caught:
        clopper_pearson(exceeded, runs, level)
    assert str(caught.value) == told


def test_no_interval_of_a_probability_ends_above_1() -> None:
    found = log_interval(np.ones(4), 4)
    assert found.low < 1.0 and found.high == 1.0


def test_the_effective_size_is_the_count_of_equal_weights_and_less_of_unequal_ones() -> None:
    assert effective_size(np.full(8, 0.3)) == pytest.approx(8.0)
    assert effective_size(np.array([1.0, 3.0])) == pytest.approx(16.0 / 10.0)
    assert effective_size(np.zeros(0)) == 0.0
