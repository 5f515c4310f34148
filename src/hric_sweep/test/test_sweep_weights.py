"""The page of a sweep whose runs have weights, against closed forms: what it shows is of the distributions, or nothing.

A contact of two masses with log-normal speed v and stiffness k has a log-normal peak force v sqrt(k m), and Spearman's
correlation of v with it is 6/pi asin(rho/2), where rho is that of their logarithms.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_folder
from scipy import stats

from hric_sweep.page import build as page
from hric_sweep.page import sample, sensitivity, spread
from hric_sweep.page.study import RecordedSweep, load
from hric_sweep.statistics.sensitivity import rank_correlation

MASS = 3.0
"""Reduced mass of both bodies [kg]."""
SPEED, STIFFNESS = {"median": 0.5, "log_std": 0.3}, {"median": 75e3, "log_std": 0.4}
MEDIAN = SPEED["median"] * np.sqrt(STIFFNESS["median"] * MASS)
LOG_STD = float(np.hypot(SPEED["log_std"], 0.5 * STIFFNESS["log_std"]))
LIMIT = float(MEDIAN * np.exp(LOG_STD * stats.norm.isf(1e-3)))
SPEARMAN = 6.0 / np.pi * np.arcsin(0.5 * SPEED["log_std"] / LOG_STD)
VARY = {
    "speed": {"paths": ["human.speed"], "unit": "m/s", "distribution": {"kind": "log_normal", **SPEED}},
    "stiffness": {"paths": ["human.stiffness"], "unit": "N/m", "distribution": {"kind": "log_normal", **STIFFNESS}},
    "delay": {"paths": ["human.delay"], "unit": "s", "distribution": {"kind": "uniform", "low": 0.0, "high": 0.1}},
}


def contact(given: Mapping[str, Any]) -> dict[str, float]:
    """Return the outputs of a run; the error depends only on the delay."""
    peak = given["speed"] * np.sqrt(given["stiffness"] * MASS)
    return {"peak": peak, "duration": np.pi * np.sqrt(MASS / given["stiffness"]), "error": given["delay"]}


def folder(root: Path, kind: str, runs: int, batches: int | None = None) -> Path:
    return sweep_folder.sampled(root / kind, sweep_folder.plan({"kind": kind}, runs, VARY, LIMIT), contact, batches)


def shown(study: RecordedSweep, output: str, share: float) -> tuple[float, float, float]:
    """Return a quantile and its interval as shown on the page."""
    (found,) = (one for one in spread.spreads(study, sample.of(study)) if one.name == output)
    value, low, high = re.findall(r"[\d.]+", found.row[2 + spread.SHARES.index(share)])
    return float(value), float(low), float(high)


@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_quantiles_are_those_of_the_distributions_and_not_of_the_runs(tmp_path: Path, kind: str) -> None:
    study = load(folder(tmp_path, kind, 2000))
    covered = 0
    for share in spread.SHARES:
        true = MEDIAN * np.exp(LOG_STD * stats.norm.ppf(share))
        value, low, high = shown(study, "peak", share)
        assert value == pytest.approx(true, rel=0.1)
        covered += low <= true <= high
    assert covered >= 2  # each of the three misses in one of twenty sweeps
    assert np.median(study.columns["peak"]) > 1.25 * MEDIAN


@pytest.mark.parametrize("kind", ["cross_entropy", "subset"])
def test_rank_correlations_are_those_of_the_distributions(tmp_path: Path, kind: str) -> None:
    study = load(folder(tmp_path, kind, 2000))
    found = sensitivity.ranks(study, sample.of(study))
    assert found["speed"]["peak"][0] == pytest.approx(SPEARMAN, abs=0.06)
    assert found["delay"]["error"][0] == pytest.approx(1.0)
    # Independent by the distributions; among the runs, which gather at the limit, they are not.
    together = stats.spearmanr(study.columns["speed"], study.columns["stiffness"]).statistic
    assert abs(found["speed"]["stiffness"][0]) < 0.15 and found["speed"]["stiffness"][1] > 0.01
    assert abs(together) > 0.15


def test_the_page_says_what_its_weights_are_worth(tmp_path: Path) -> None:
    text = page.write(folder(tmp_path, "cross_entropy", 600)).read_text()
    worth = re.search(r"together they are worth ([\d.]+) runs drawn from the distributions", text)
    weights = load(tmp_path / "cross_entropy").weights
    assert worth is not None and float(worth[1]) == pytest.approx(weights.sum() ** 2 / np.sum(weights**2), rel=0.01)
    assert text.count(worth[0]) == 3  # histograms, pairs, correlations


def test_weights_that_are_worth_few_runs_are_refused_with_a_sentence(tmp_path: Path) -> None:
    weights = np.r_[np.full(3, 10.0), np.full(57, 1e-3)]
    text = page.write(sweep_folder.write(tmp_path / "a", 60, sampler="cross_entropy", weight=weights)).read_text()
    words = "With their weights, the 60 runs are worth 3 runs drawn from the distributions: too few"
    assert f"No distributions. {words}" in text and f"No rank correlations. {words}" in text
    assert "<figcaption>" not in text and '"spread":false' in text and "class=rank" not in text


def test_a_search_for_the_worst_has_neither_distributions_nor_correlations(tmp_path: Path) -> None:
    text = page.write(sweep_folder.write(tmp_path / "a", 60, sampler="tpe")).read_text()
    words = "The points were searched for the worst case, not drawn"
    assert f"No distributions. {words}" in text and f"No rank correlations. {words}" in text
    assert "<figcaption>" not in text and '"spread":false' in text and "class=rank" not in text


def test_of_subset_simulation_the_first_level_counts_alone_and_the_page_says_so(tmp_path: Path) -> None:
    study = load(folder(tmp_path, "subset", 600))
    counted = sample.of(study)
    first = int(counted.counts.sum())
    assert set(study.columns["batch"][counted.counts > 0.0]) == {0} and 0 < first < study.runs
    text = page.write(study.folder).read_text()
    assert f"Based only on the {first} runs of the first level, which are drawn from the distributions." in text


def test_a_sweep_with_weights_that_has_only_begun_is_a_plain_sample(tmp_path: Path) -> None:
    study = load(folder(tmp_path, "cross_entropy", 600, batches=1))
    counted = sample.of(study)
    assert not counted.weighted and counted.independent and study.runs == 60
    assert "by order statistics" in spread.caption(study, counted)


def test_ranks_with_equal_weights_correlate_as_scipy_says_ties_included() -> None:
    random = np.random.default_rng(1)
    a, b = random.integers(0, 6, 80).astype(float), random.normal(size=80)
    same = stats.spearmanr(a, b)
    expected = (pytest.approx(same.statistic), pytest.approx(same.pvalue))
    assert rank_correlation(a, b) == expected == rank_correlation(a, b, np.full(80, 0.3))


def test_a_run_of_weight_three_counts_as_three_runs() -> None:
    random = np.random.default_rng(2)
    a, b, times = random.normal(size=50), random.normal(size=50), random.integers(0, 4, 50)
    same = stats.spearmanr(np.repeat(a, times), np.repeat(b, times)).statistic
    assert rank_correlation(a, b, times.astype(float))[0] == pytest.approx(same)


def test_an_infinite_output_is_the_worst_and_is_in_the_quantiles(tmp_path: Path) -> None:
    """A ratio to a limit of 0 (as for the head) is infinite."""
    columns = sweep_folder.values(100, failing=0.0)
    peak = np.sort(columns["peak"])
    peak[90:] = np.inf
    text = page.write(sweep_folder.write(tmp_path / "a", 100, peak=peak, failure=[""] * 100)).read_text()
    row = re.search(r"<tr><td>peak \[N\]</td>(.*?)</tr>", text)
    assert row is not None
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row[1])
    assert cells[0] == "100" and cells[3].startswith("infinite (") and cells[4] == "infinite"
    assert cells[2].startswith(f"{np.median(peak):.4g} (")
    worst = text[text.index('<section id="worst-runs"') : text.index('<section id="cost"')]
    assert worst.count(">infinite<") == 10
