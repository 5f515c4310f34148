"""Rare events: for contacts of two masses with a closed-form probability, intervals have their nominal coverage."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import brentq

from hric_core.errors import HricError
from hric_sweep.samplers.make import SAMPLER, make
from hric_sweep.samplers.mixture import DEFENSIVE
from hric_sweep.samplers.sampler import Estimate, Point, Sampler, SamplerResult
from hric_sweep.samplers.subset import correlation_factor
from hric_sweep.space import Space
from hric_sweep.statistics.intervals import clopper_pearson, effective_size, log_interval
from hric_sweep.variables import Variable

ROBOT, HUMAN = 5.0, 8.0
"""Masses of robot and human [kg]."""
REDUCED = ROBOT * HUMAN / (ROBOT + HUMAN)
SPEED, STIFFNESS = {"median": 0.5, "log_std": 0.3}, {"median": 75e3, "log_std": 0.4}
"""Distributions of speed [m/s] and stiffness [N/m]; two masses with a spring: peak v sqrt(k m1 m2/(m1 + m2))."""
FASTEST, SOFTEST, HARDEST = 1.0, 20e3, 150e3
Force = Callable[[np.ndarray, np.ndarray], np.ndarray]


def space(speed: dict[str, Any], stiffness: dict[str, Any]) -> Space:
    made = {"speed": speed, "stiffness": stiffness, "delay": {"kind": "uniform", "low": 0.0, "high": 0.1}}
    return Space({n: Variable.of({"paths": n, "distribution": d}, f"sweep.vary.{n}") for n, d in made.items()})


def log_normal_contact(probability: float) -> tuple[Space, float]:
    """Return a space with log-normal speed and stiffness, and the limit [N] with a given exceedance probability."""
    log_std = np.hypot(SPEED["log_std"], 0.5 * STIFFNESS["log_std"])
    median = SPEED["median"] * np.sqrt(STIFFNESS["median"] * REDUCED)
    of = space({"kind": "log_normal", **SPEED}, {"kind": "log_normal", **STIFFNESS})
    return of, float(median * np.exp(log_std * stats.norm.isf(probability)))


def bounded_contact(probability: float) -> tuple[Space, float]:
    """Return a space with uniform speed, log-uniform stiffness, and the limit [N] with an exceedance probability.

    P = (ln(k1/k0) + 2 c (1/sqrt(k1) - 1/sqrt(k0))) / ln(k1/k_min), c = limit/(v_max sqrt(m)), k0 = max(k_min, c^2).
    """

    def exceeding(limit: float) -> float:
        c = limit / (FASTEST * np.sqrt(REDUCED))
        begin = max(SOFTEST, c**2)
        part = np.log(HARDEST / begin) + 2.0 * c * (HARDEST**-0.5 - begin**-0.5)
        return float(part / np.log(HARDEST / SOFTEST))

    largest = FASTEST * np.sqrt(HARDEST * REDUCED)
    limit = brentq(lambda one: np.log(exceeding(one) / probability), 0.1 * largest, largest * (1.0 - 1e-7))
    speed = {"kind": "uniform", "low": 0.0, "high": FASTEST}
    return space(speed, {"kind": "log_uniform", "low": SOFTEST, "high": HARDEST}), float(limit)


CONTACTS = {"log-normal": log_normal_contact, "bounded": bounded_contact}


def simulate(of: Space, limit: float, points: list[Point], first: int = 0) -> list[SamplerResult]:
    """Return the result of each point: peak force of the two masses."""
    values = of.values(np.array([point.u for point in points]))
    forces = [row["speed"] * np.sqrt(row["stiffness"] * REDUCED) for row in values]
    return [
        SamplerResult(
            index=first + i, exceeded=bool(force > limit), objective=float(force), margin=float(force - limit)
        )
        for i, force in enumerate(forces)
    ]


def sampler(of: Space, kind: str, runs: int, seed: int, **settings: Any) -> Sampler:
    return make(SAMPLER.checked({"kind": kind, **settings}, "sweep.sampler"), of, runs, seed)


def swept(of: Space, limit: float, kind: str, runs: int, seed: int) -> tuple[Estimate, int]:
    """Return the estimate of a complete sweep, and its number of runs."""
    one, done = sampler(of, kind, runs, seed), 0
    while points := list(one.ask()):
        one.tell(simulate(of, limit, points, done))
        done += len(points)
    made = one.estimate()
    assert made is not None
    return made, done


def coverage(contact: str, kind: str, probability: float, runs: int, seeds: range) -> tuple[int, float, float]:
    """Return the number of intervals that contain the probability, medians of estimate / probability and high / low."""
    of, limit = CONTACTS[contact](probability)
    made = [swept(of, limit, kind, runs, seed)[0] for seed in seeds]
    covered = sum(one.low <= probability <= one.high for one in made)
    ratio = float(np.median([one.probability for one in made])) / probability
    return covered, ratio, float(np.median([one.high / max(one.low, 1e-300) for one in made]))


CASES = [(1e-3, 600), (1e-3, 2000), (1e-5, 2000)]


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, 1000])
@pytest.mark.parametrize("probability, runs", CASES)
@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_at_least_90_of_100_intervals_have_the_probability(
    kind: str, contact: str, probability: float, runs: int, first: int
) -> None:
    covered, ratio, width = coverage(contact, kind, probability, runs, range(first, first + 100))
    about = f"{kind}, {contact}, {probability:g} at {runs} runs, seeds from {first}"
    print(f"{about}: {covered} of 100, median {ratio:.3f} of it, x{width:.2f}")
    assert covered >= 90


@pytest.mark.slow
@pytest.mark.parametrize("probability, runs", CASES)
def test_plain_monte_carlo_covers_too_with_intervals_many_times_as_wide(probability: float, runs: int) -> None:
    of, limit = log_normal_contact(probability)
    made = [swept(of, limit, "random", runs, seed)[0] for seed in range(100)]
    covered = sum(one.low <= probability <= one.high for one in made)
    high = float(np.median([one.high for one in made])) / probability
    none = sum(one.exceeded == 0 for one in made)
    print(f"random, {probability:g} at {runs} runs: {covered} of 100, upper limit {high:.1f} times it, none: {none}")
    assert covered >= 90 and high > np.exp(0.5)


@pytest.mark.parametrize("kind, at_least", [("cross_entropy", 9), ("subset", 8)])
@pytest.mark.parametrize("contact", CONTACTS)
def test_intervals_of_ten_sweeps_of_600_runs_have_a_probability_of_1e_3(contact: str, kind: str, at_least: int) -> None:
    covered, ratio, _ = coverage(contact, kind, 1e-3, 600, range(10))
    assert covered >= at_least and 0.3 < ratio < 3.0


@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_the_same_results_give_the_same_points_to_the_last_bit_and_no_more_runs_than_there_are(kind: str) -> None:
    of, limit = log_normal_contact(1e-3)
    one, other, done = sampler(of, kind, 600, 5), sampler(of, kind, 600, 5), 0
    while points := list(one.ask()):
        assert points == list(other.ask())
        for each in (one, other):
            each.tell(simulate(of, limit, points, done))
        done += len(points)
    assert list(other.ask()) == [] and done <= one.total <= 600
    assert one.estimate() == other.estimate()


def test_no_weight_exceeds_the_inverse_of_the_defensive_share_and_their_mean_is_one() -> None:
    of, limit = log_normal_contact(1e-3)
    one, done, final = sampler(of, "cross_entropy", 4000, 1), 0, []
    while points := list(one.ask()):
        one.tell(simulate(of, limit, points, done))
        done += len(points)
        if done > 2000:
            final += [point.weight for point in points]
    assert max(final) <= 1.0 / DEFENSIVE + 1e-9
    assert np.mean(final) == pytest.approx(1.0, abs=4.0 * float(np.std(final)) / np.sqrt(len(final)))


@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_a_limit_that_nothing_comes_near_has_an_upper_limit_and_no_lower_one(kind: str) -> None:
    of, _ = bounded_contact(1e-3)
    made, _ = swept(of, 1e6, kind, 600, 0)
    assert (made.probability, made.low, made.exceeded) == (0.0, 0.0, 0)
    assert 0.0 < made.high < 0.05 and made.check is not None and made.check.agrees


@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_a_probability_of_a_half_needs_no_rare_events_and_is_right_too(kind: str) -> None:
    of, limit = log_normal_contact(0.5)
    made, _ = swept(of, limit, kind, 600, 2)
    assert made.low <= 0.5 <= made.high and made.check is not None and made.check.agrees


def test_runs_that_failed_widen_the_interval_upwards() -> None:
    of, limit = log_normal_contact(1e-2)
    highs = []
    for failing in (False, True):
        one, done = sampler(of, "cross_entropy", 600, 3), 0
        while points := list(one.ask()):
            results = simulate(of, limit, points, done)
            done += len(points)
            if failing and done > 480:
                results[:5] = [SamplerResult(index=told.index, exceeded=None) for told in results[:5]]
            one.tell(results)
        made = one.estimate()
        assert made is not None
        highs.append(made.high)
    assert highs[1] > 2.0 * highs[0]


def test_two_regions_of_failure_are_both_found() -> None:
    normal = {"kind": "normal", "mean": 0.0, "std": 1.0}
    of = Space({n: Variable.of({"paths": n, "distribution": normal}, "x") for n in ("speed", "other")})
    limit, covered = float(stats.norm.isf(0.5e-3)), 0
    for seed in range(4):
        one, done = sampler(of, "cross_entropy", 2000, seed), 0
        while points := list(one.ask()):
            speeds = [abs(row["speed"]) for row in of.values(np.array([point.u for point in points]))]
            one.tell([SamplerResult(done + i, bool(v > limit), None, float(v - limit)) for i, v in enumerate(speeds)])
            done += len(points)
        made = one.estimate()
        assert made is not None
        covered += made.low <= 1e-3 <= made.high
    assert covered >= 3


def around(dimensions: int, kind: str, runs: int, seed: int) -> Estimate:
    """Return a case: distance of n normal variables from the origin, exceeded with probability 1e-3 (chi)."""
    normal = {"kind": "normal", "mean": 0.0, "std": 1.0}
    of = Space({f"x{k}": Variable.of({"paths": "x", "distribution": normal}, "x") for k in range(dimensions)})
    limit, one, done = float(stats.chi.isf(1e-3, dimensions)), sampler(of, kind, runs, seed), 0
    while points := list(one.ask()):
        distances = [np.hypot.reduce(list(row.values())) for row in of.values(np.array([point.u for point in points]))]
        one.tell([SamplerResult(done + i, bool(v > limit), None, float(v - limit)) for i, v in enumerate(distances)])
        done += len(points)
    made = one.estimate()
    assert made is not None
    return made


@pytest.mark.slow
@pytest.mark.parametrize("runs", [600, 2000])
@pytest.mark.parametrize("dimensions", [2, 3, 4])
def test_a_limit_that_is_exceeded_all_around_is_one_for_subset_simulation(dimensions: int, runs: int) -> None:
    covered = {}
    for kind in ("cross_entropy", "subset"):
        made = [around(dimensions, kind, runs, seed) for seed in range(20)]
        covered[kind] = sum(one.low <= 1e-3 <= one.high for one in made)
        below = sum(one.high < 1e-3 for one in made)
        ess, ratio = np.median([one.ess for one in made]), 1e3 * np.median([one.probability for one in made])
        about = f"{kind}, {dimensions} dimensions, {runs} runs: {covered[kind]} of 20, {below} below"
        print(f"{about}, median {ratio:.2f} of it, ess {ess:.0f}")
    assert covered["subset"] >= 17  # 1.6 % of a binomial with 0.95 are fewer


def test_runs_that_are_infinitely_beyond_the_limit_are_fitted_as_others_that_exceed() -> None:
    """Infinite margins, as of a ratio to a limit of 0 (contact with the head)."""
    of, limit = log_normal_contact(0.3)
    one, done = sampler(of, "cross_entropy", 600, 0), 0
    while points := list(one.ask()):
        results = simulate(of, limit, points, done)
        one.tell([replace(told, margin=np.inf) if told.exceeded else told for told in results])
        done += len(points)
    made = one.estimate()
    assert made is not None and made.low <= 0.3 <= made.high


def test_results_without_a_margin_are_refused() -> None:
    of, _ = log_normal_contact(1e-3)
    one = sampler(of, "subset", 600, 0)
    with pytest.raises(HricError, match="margin"):
        one.tell([SamplerResult(index=i, exceeded=False) for i in range(len(one.ask()))])


@pytest.mark.parametrize("kind, words", [("cross_entropy", "80 or more"), ("subset", "460 or more")])
def test_too_few_runs_are_refused_with_how_many_it_takes(kind: str, words: str) -> None:
    with pytest.raises(HricError, match=words):
        sampler(log_normal_contact(1e-3)[0], kind, 79, 0)


def test_equal_weights_have_about_the_interval_of_their_count() -> None:
    weights = np.full(200, 0.01)
    found, same = log_interval(weights, 1000), clopper_pearson(200, 1000)
    assert effective_size(weights) == pytest.approx(200.0)
    assert np.array(found) / 0.01 == pytest.approx(np.array(same), rel=0.06)


@pytest.mark.parametrize(("count", "t"), [(2, 12.706), (3, 4.303), (5, 2.776), (10, 2.262), (30, 2.045)])
def test_few_weights_have_students_quantile_with_one_degree_of_freedom_less(count: int, t: float) -> None:
    """Compare with the published table of Student's t (two-sided 95 %; 1, 2, 4, 9 and 29 degrees of freedom)."""
    interval = log_interval(np.full(count, 0.5), 10_000)
    estimate = 0.5 * count / 10_000
    assert np.log(estimate / interval.low) * np.sqrt(count) == pytest.approx(t, abs=5e-4)
    if estimate * np.exp(t / np.sqrt(count)) < 1.0:
        assert np.log(interval.high / estimate) * np.sqrt(count) == pytest.approx(t, abs=5e-4)


def test_unequal_weights_have_the_freedom_of_their_effective_number() -> None:
    interval = log_interval(np.array([3.0, 1.0, 1.0, 1.0]), 100_000)  # (3 + 1 + 1 + 1)^2 / (9 + 1 + 1 + 1) = 3
    assert np.log(6e-5 / interval.low) * np.sqrt(3.0) == pytest.approx(4.303, abs=5e-4)


@pytest.mark.parametrize("length", [2, 5, 10])
def test_points_of_a_chain_that_all_agree_count_as_one(length: int) -> None:
    above = np.tile([True, False, False, True, False], (length, 1))
    assert correlation_factor(above) == pytest.approx(length)


def test_half_agreeing_pairs_have_the_factor_of_the_formula_by_hand() -> None:
    above = np.array([[1, 1, 0, 0], [1, 0, 0, 1], [0, 0, 1, 1]], dtype=bool)
    # share 1/2; lag 1: pairs (1,1) (1,0) (0,0) (0,1), (1,0) (0,0) (0,1) (1,1): 2/8 - 1/4 = 0;
    # lag 2: (1,0) (1,0) (0,1) (0,1): 0 - 1/4 = -1/4: 1 + 2 (1 - 2/3) (-1/4) / (1/4) = 1/3, which is no less than 1
    assert correlation_factor(above) == 1.0


@pytest.mark.parametrize("stay", [0.6, 0.8, 0.95])
def test_the_variance_of_a_mean_over_chains_grows_by_the_factor(stay: float) -> None:
    """Two-state chains with correlation r^k, r = 2 stay - 1; reference: the scatter of their means."""
    random, chains, length = np.random.default_rng(5), 40_000, 10
    above = np.empty((length, chains), dtype=bool)
    above[0] = random.random(chains) < 0.5
    for k in range(1, length):
        above[k] = np.where(random.random(chains) < stay, above[k - 1], ~above[k - 1])
    measured = length * np.var(above.mean(axis=0)) / 0.25
    assert correlation_factor(above) == pytest.approx(measured, rel=0.03)


# -- coverage: how often an interval contains the truth; one that is too narrow or too wide is noticed -----------------


def test_intervals_of_a_few_very_unequal_weights_miss_in_less_than_one_of_a_hundred_samples() -> None:
    """Poisson counts, mean 3, of weights with the mean 1: 0.26 % miss. With Student's freedom e in place of e - 1 it
    would be 2.0 %. By the binomial either is on the other side of the bound once in a million times or less."""
    random, samples, log_std, mean, runs = np.random.default_rng(11), 6000, 1.5, 3.0, 10**6
    counts = random.poisson(mean, samples)
    missed = 0
    for count in counts[counts > 0]:
        low, high = log_interval(np.exp(log_std * random.standard_normal(count) - 0.5 * log_std**2), runs)
        missed += not low <= mean / runs <= high
    assert missed <= 0.009 * np.count_nonzero(counts)


def test_normal_intervals_of_a_share_over_chains_cover_as_often_as_they_say() -> None:
    """Two-state chains that stay with 0.95: of the 5 % that should miss 1 % would be left if all lags had the same
    weight. By the binomial a share of misses of 5 % is outside the bounds once in a million times or less."""
    random, samples, chains, length, stay = np.random.default_rng(12), 2000, 200, 10, 0.95
    above = np.empty((length, samples, chains), dtype=bool)
    above[0] = random.random((samples, chains)) < 0.5
    for k in range(1, length):
        above[k] = np.where(random.random((samples, chains)) < stay, above[k - 1], ~above[k - 1])
    factors = np.array([correlation_factor(above[:, sample]) for sample in range(samples)])
    shares = above.mean(axis=(0, 2))
    std = np.sqrt(factors * shares * (1.0 - shares) / (length * chains))
    missed = np.mean(np.abs(shares - 0.5) > stats.norm.isf(0.025) * std)
    assert 0.026 < missed < 0.076
