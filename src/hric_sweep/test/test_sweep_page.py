"""Page of a sweep: contents, size, and interaction in a browser."""

import html
import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pytest
import sweep_folder
from browser import Browser, installed
from pyarrow import parquet
from scipy import stats

from hric_bags.run_folder import RunFolderError
from hric_report import html as report_html
from hric_sweep.command import summary
from hric_sweep.page import build as page
from hric_sweep.page import drawn, quantiles, sample, sensitivity
from hric_sweep.page.study import load


def in_a_browser(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test as one that needs a browser, which takes long."""
    without = pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
    return pytest.mark.slow(without(test))


RUNS = 500
DRAWN = """[sweep.count, ...["parallel", "matrix"].map((id) => {
  const c = document.querySelector(`#${id} canvas`), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
  let n = 0; for (let k = 3; k < d.length; k += 4) n += d[k] > 0; return n > 0.05 * c.width * c.height; })]"""
"""Script: number of runs, and whether both drawings are not empty."""


def text_of(folder: Path, **given: Any) -> str:
    return page.write(folder, **given).read_text()


def ranks(folder: Path) -> sensitivity.Ranks:
    study = load(folder)
    return sensitivity.ranks(study, sample.of(study))


def estimate(text: str) -> str:
    found = re.search(r"<div class=answer>(.*?)</div>", text)
    assert found is not None
    return re.sub("<[^>]*>", " ", found[1]).replace("&gt;", ">").replace("&lt;", "<")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sweep_folder.write(tmp_path_factory.mktemp("sweeps") / "peak force", RUNS)


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    return text_of(folder)


# -- what it says ------------------------------------------------------------------------------------------------------


def test_the_probability_has_the_interval_of_clopper_and_pearson(folder: Path, text: str) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    failed = int((table.failure != "").sum())
    exceeded = int((table.peak > sweep_folder.LIMIT).sum())
    low = stats.binomtest(exceeded, RUNS).proportion_ci(0.95, method="exact").low
    high = stats.binomtest(exceeded + failed, RUNS).proportion_ci(0.95, method="exact").high
    line = estimate(text)
    printed = summary(folder)
    assert f"P(peak > 280 N given the distributions below) = {exceeded / (RUNS - failed):.3g}," in line
    assert f"P(peak > 280 N given the distributions of the sweep) = {exceeded / (RUNS - failed):.3g}," in printed
    for told in (line, printed):
        assert f"95 % interval {low:.3g} to {high:.3g}" in told and "Clopper-Pearson" in told
        assert f"{exceeded} of {RUNS - failed} runs exceeded" in told and f"Failed runs: {failed}." in told


def test_a_limit_that_is_passed_without_bound_is_the_worst_of_all(tmp_path: Path) -> None:
    peak = sweep_folder.values(50)["peak"].copy()
    peak[[3, 30]] = np.nan, np.inf  # 30: contact with a region that permits none
    order, by = load(sweep_folder.write(tmp_path / "a", 50, peak=peak)).order_of_worst
    assert by == "largest peak" and order[0] == 30 and 3 not in order


def test_the_terminal_has_range_and_median_of_the_outputs_and_the_failures_by_reason(folder: Path) -> None:
    table, printed = parquet.read_table(folder / "runs.parquet").to_pandas(), summary(folder)
    good = np.sort(table.peak[table.failure == ""])
    failed = len(table) - len(good)
    assert printed.startswith(f"{RUNS} runs, {failed} failed\n") and "failed 1 times: cartesian_reflex at" in printed
    assert f"peak: {good[0]:.6g} to {good[-1]:.6g}, median {np.median(good):.6g} N\n" in printed


@pytest.mark.parametrize(("sampler", "why"), [("grid", "chosen, not drawn"), ("tpe", "searched for the worst case")])
def test_points_that_were_not_drawn_give_no_probability(tmp_path: Path, sampler: str, why: str) -> None:
    line = estimate(text_of(sweep_folder.write(tmp_path / "a", 50, sampler=sampler)))
    assert why in line and "P(" not in line and "interval 0" not in line


def test_evenly_spread_points_say_that_their_interval_is_an_estimate(tmp_path: Path) -> None:
    line = estimate(text_of(sweep_folder.write(tmp_path / "a", 64, sampler="sobol")))
    assert "95 % interval" in line and "spread evenly" in line


def test_where_no_run_exceeds_the_interval_alone_is_told(tmp_path: Path) -> None:
    columns = sweep_folder.values(200, failing=0.0)
    low = np.minimum(columns["peak"], sweep_folder.LIMIT)
    line = estimate(text_of(sweep_folder.write(tmp_path / "a", 200, peak=low, failure=[""] * 200)))
    high = stats.binomtest(0, 200).proportion_ci(0.95, method="exact").high
    assert f": no run exceeded, 95 % interval 0 to {high:.3g}" in line and "= 0" not in line


def test_each_value_of_a_variable_of_words_has_its_own_probability(folder: Path, text: str) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    part = text[text.index("By controller") : text.index('id="what-was-varied"')]
    for value, rows in table.groupby("controller"):
        exceeded, failed = int((rows.peak > sweep_folder.LIMIT).sum()), int((rows.failure != "").sum())
        low = stats.binomtest(exceeded, len(rows)).proportion_ci(0.95, method="exact").low
        high = stats.binomtest(exceeded + failed, len(rows)).proportion_ci(0.95, method="exact").high
        cells = [str(len(rows) - failed), str(exceeded), f"{exceeded / (len(rows) - failed):.3g}"]
        found = re.search(rf"<td>{value}</td>(.*?)</tr>", part)
        assert found is not None
        assert re.findall("<td[^>]*>(.*?)</td>", found[1]) == [*cells, f"{low:.3g} to {high:.3g}"]


def test_a_rare_event_has_the_estimate_of_its_sampler_with_the_effective_sample_size(tmp_path: Path) -> None:
    found = {"probability": 1.25e-5, "low": 8e-6, "high": 2e-5, "level": 0.9, "method": "log scale", "ess": 210.4}
    check = {"runs": 20, "exceeded": 0, "low": 0.0, "high": 0.139, "agrees": True}
    found |= {"runs": 50, "exceeded": 12, "failed": 1, "check": check}
    weights = np.linspace(0.1, 2.0, 50)
    folder = sweep_folder.write(tmp_path / "a", 50, sampler="cross_entropy", estimate=found, weight=weights)
    for line in (estimate(text_of(folder)), summary(folder)):
        assert "= 1.25e-05, 90 % interval 8e-06 to 2e-05" in line and "Log scale; 12 of 49 runs exceeded" in line
        assert "effective number of exceeding runs 210" in line and "Clopper" not in line
        assert "Check with unweighted runs: 0 of 20 runs, 0 to 0.139; it agrees." in line
        assert "not reliable" not in line
    few = sweep_folder.write(tmp_path / "b", 50, sampler="cross_entropy", estimate={**found, "ess": 12}, weight=weights)
    assert "effective number of exceeding runs 12. Below about 20 the interval is not reliable" in estimate(
        text_of(few)
    )


def test_what_was_varied_is_listed_with_its_distributions(text: str) -> None:
    part = text[text.index('id="what-was-varied"') : text.index('id="runs"')]
    for words in ("log-uniform, 1e+04 to 1.5e+05", "normal, mean 4, std 1, truncated from 1 to 8", "human.walk.speed"):
        assert words in part
    assert "random: points drawn at random" in part and "independent of each other" in part


def test_failures_are_counted_by_reason_and_their_text_stays_text(text: str) -> None:
    part = text[text.index('<section id="failures"') : text.index('<section id="worst-runs"')]
    rows = re.findall(r"<tr><td class=num>(\d+)</td>.*?<td>([^/]*?)</td><td><code>", part)
    assert len(rows) == len(sweep_folder.REASONS) or "&lt;b&gt;unstable&lt;/b&gt;: joint 3 at # rad/s" in part
    assert "cartesian_reflex at # s" in part and "<b>unstable" not in text


def test_the_worst_ten_are_in_order_and_each_has_its_command(folder: Path, text: str) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    worst = table.sort_values("peak", ascending=False)[:10]
    part = text[text.index('<section id="worst-runs"') : text.index('<section id="cost"')]
    commands = [shlex.split(html.unescape(one)) for one in re.findall('data-command="(.*?)"', part)]
    assert re.findall("<td><code>(.*?)</code>", part) == list(worst.id)
    assert [one[-1] for one in commands] == list(worst.id)
    assert all(one[:-1] == ["hric", "sweep", "rerun", "peak force"] for one in commands)


def test_the_page_names_no_folder_of_the_machine(folder: Path, text: str) -> None:
    assert str(folder.parent) not in text


def test_cost_is_listed_by_machine(folder: Path, text: str) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    part = text[text.index('<section id="cost"') :]
    assert f"{table.processor.sum():.4g}" in part and ">alpha<" in part and ">beta<" in part


def test_a_running_sweep_says_so_and_a_whole_one_does_not(tmp_path: Path) -> None:
    folder = sweep_folder.write(tmp_path / "a", 40, planned=1024)
    running, stopped = text_of(folder, running=True), text_of(folder)
    assert "This sweep is running: 40 of 1024 runs so far." in running and ">running<" in running
    assert "This sweep is running" not in stopped and "stopped early" in stopped


def test_a_sweep_without_any_run_yet_has_a_page(tmp_path: Path) -> None:
    assert "0 of 64 runs" in text_of(sweep_folder.write(tmp_path / "a", 0, planned=64), running=True)


def test_a_folder_that_is_no_sweep_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match=r"runs\.parquet.*valid: the run folder of a sweep"):
        page.write(tmp_path)
    parquet.write_table(pyarrow.table({"a": [1.0]}), tmp_path / "runs.parquet")
    with pytest.raises(RunFolderError, match="valid: the run folder of a sweep"):
        page.write(tmp_path)


def test_rank_correlations_are_those_of_scipy_and_stand_in_the_pairs_too(folder: Path, text: str) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas().dropna()
    part = text[text.index('<section id="what-the-outputs-depend-on"') : text.index('<section id="failures"')]
    row = re.search(r"<tr><td>stiffness \[N/m\]</td>(.*?)</tr>", part)
    assert row is not None
    for cell, output in zip(re.findall(r">(-?[\d.]+)</td>", row[1]), sweep_folder.OUTPUTS, strict=True):
        assert cell == f"{stats.spearmanr(table.stiffness, table[output]).statistic:.2f}"
    expected = stats.spearmanr(table.speed, table.peak).statistic
    found = ranks(folder)
    assert found["speed"]["peak"][0] == pytest.approx(expected) and found["peak"]["speed"] == found["speed"]["peak"]


def test_the_design_of_saltelli_gives_the_indices_of_an_additive_output(tmp_path: Path) -> None:
    """Sobol indices of y = 3 a + b with uniform variables are 9/10 and 1/10, both first-order and total."""
    rows, names = 4096, list(sweep_folder.VARY)
    a, b = np.random.default_rng(2).random((2, rows, len(names)))
    mixed = [np.where(np.arange(len(names)) == k, b, a) for k in range(len(names))]
    u = np.concatenate([a, b, *mixed])
    columns = {name: u[:, k] for k, name in enumerate(names)}
    folder = sweep_folder.write(tmp_path / "a", len(u), sampler="saltelli", **columns, peak=3.0 * u[:, 0] + u[:, 1])
    text = text_of(folder)
    told = re.search(r"first-order and total indices of peak: ([^\"]*)", text)
    assert told is not None
    found = dict(re.findall(r"(\w+) (-?[\d.]+ and -?[\d.]+)", told[1]))
    for name, expected in zip(names, (0.9, 0.1, 0.0, 0.0), strict=True):
        assert [float(one) for one in found[name].split(" and ")] == pytest.approx([expected] * 2, abs=0.05)
    assert "this share is not a probability" in estimate(text)


def test_words_without_an_order_have_no_rank_correlation(tmp_path: Path) -> None:
    words = np.array(["a", "b", "c"] * 20)
    assert "controller" not in ranks(sweep_folder.write(tmp_path / "a", 60, controller=words))


def test_an_output_that_is_the_same_in_all_runs_is_told_and_not_drawn(tmp_path: Path) -> None:
    text = text_of(sweep_folder.write(tmp_path / "a", 60, error=np.full(60, 0.25), failure=[""] * 60))
    assert "0.25 in all runs." in text and "distribution of error" not in text and "distribution of peak" in text
    told = re.search('<script type="application/json" id=data>(.*?)</script>', text)
    assert told is not None
    assert {one["name"] for one in json.loads(told[1])["columns"] if not one["on"]} == {"error"}


def test_an_output_of_whole_numbers_has_a_bar_for_each(tmp_path: Path) -> None:
    losses = np.repeat([0.0, 1.0, 2.0, 4.0], 15)
    text = text_of(sweep_folder.write(tmp_path / "a", 60, error=losses, failure=[""] * 60))
    picture = text[text.index('aria-label="distribution of error') :]
    bars = re.findall(r"<title>(\S+) to (\S+): 25 % of the runs</title>", picture[: picture.index("</svg>")])
    assert bars == [("-0.5", "0.5"), ("0.5", "1.5"), ("1.5", "2.5"), ("3.5", "4.5")]


# -- how large it is ---------------------------------------------------------------------------------------------------


def test_a_hundred_thousand_runs_make_less_than_20_MB_and_are_all_drawn(tmp_path: Path) -> None:
    text = text_of(sweep_folder.write(tmp_path / "a", 100_000))
    assert len(text.encode()) < 20e6 and "All 100000 runs are drawn." in text


def test_what_is_too_much_is_sampled_by_seed_and_the_caption_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drawn, "VALUES", 1400)
    study = load(sweep_folder.write(tmp_path / "a", 1000))
    rows = drawn.chosen(study)
    assert len(rows) in range(100, 111) and set(study.order_of_worst[0][:10]) <= set(rows)
    assert np.array_equal(rows, drawn.chosen(study))
    text = text_of(tmp_path / "a")
    assert f"Drawn: a random sample of {len(rows)} of 1000 runs (seed 0)" in text
    assert len(re.search(r"id=ids>([^<]*)", text)[1].split()) == len(rows)  # type: ignore[index]


# -- quantiles ---------------------------------------------------------------------------------------------------------


def test_the_interval_of_a_median_is_that_of_the_published_table() -> None:
    """For n = 100 the interval of the median is from the 40th to the 61st value (Conover, Practical Nonparametric
    Statistics, table A3)."""
    found = quantiles.of_sample(np.arange(1.0, 101.0), 0.5, 0.95)
    assert (found.value, found.low, found.high) == (50.5, 40.0, 61.0)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_intervals_by_order_statistics_hold_as_often_as_they_say(share: float) -> None:
    random, held = np.random.default_rng(3), 0
    true = stats.expon.ppf(share)
    for _ in range(400):
        found = quantiles.of_sample(random.exponential(size=200), share, 0.95)
        held += not (found.low > true) and not (found.high < true)
    assert held >= 368  # 0.1 % of a binomial with 0.95


def test_a_small_sample_has_no_end_of_the_interval_where_none_exists() -> None:
    found = quantiles.of_sample(np.arange(20.0), 0.95, 0.95)
    assert np.isnan(found.high) and found.low < found.value


def test_weights_that_undo_another_distribution_give_the_quantiles_of_the_first() -> None:
    values = np.random.default_rng(1).normal(2.0, 1.0, 4000)
    weights = stats.norm.pdf(values) / stats.norm.pdf(values, 2.0)
    found = quantiles.of_weighted(values, weights, 0.95, 0.95)
    assert found.low < stats.norm.ppf(0.95) < found.high and found.high - found.low < 0.3


# -- in a browser ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        found.emulate(scheme="light")
        yield found


@pytest.fixture
def opened(browser: Browser, folder: Path, text: str) -> Browser:
    browser.open(folder / report_html.NAME)
    browser.wait("typeof report === 'object' && report.ready === true")
    return browser


def mouse(browser: Browser, kind: str, x: float, y: float) -> None:
    """Send a mouse event; `kind`: mouseMoved, mousePressed or mouseReleased."""
    pressed = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed)


def in_sight(browser: Browser, which: str) -> list[float]:
    """Scroll an element into view; return its left and top position."""
    found: list[float] = browser.evaluate(
        f"(() => {{ const e = document.querySelector('{which}'); e.scrollIntoView({{block: 'center'}}); "
        "const b = e.getBoundingClientRect(); return [b.left, b.top]; })()"
    )
    return found


def drag(browser: Browser, column: str, low: float, high: float) -> None:
    """Drag along an axis between two values."""
    in_sight(browser, "#parallel svg")
    x, begin, end = browser.evaluate(
        "(() => { const p = document.querySelector('#parallel svg').getBoundingClientRect(), "
        f"g = document.querySelector('.axis[data-column={column}] .grip').getBoundingClientRect(), "
        f"c = sweep.columns.find((one) => one.name === '{column}'), "
        f"y = (v) => g.top + 6 + (1 - c.share(v)) * (g.height - 12); "
        f"return [g.left + g.width / 2, y({low}), y({high})]; }})()"
    )
    mouse(browser, "mouseMoved", x, begin)
    mouse(browser, "mousePressed", x, begin)
    mouse(browser, "mouseMoved", x, (begin + end) / 2)
    mouse(browser, "mouseMoved", x, end)
    mouse(browser, "mouseReleased", x, end)


@in_a_browser
def test_a_hundred_thousand_runs_are_first_drawn_within_10_s_of_a_processor(tmp_path: Path) -> None:
    made = page.write(sweep_folder.write(tmp_path / "many", 100_000))
    with Browser(tmp_path / "profile") as own:
        before = own.processor()
        own.open(made)
        own.wait("typeof report === 'object' && report.ready === true")
        own.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        took = own.processor() - before
        drawn = own.evaluate(DRAWN)
        assert own.problems == []
    print(f"page of 100,000 runs: {made.stat().st_size / 1e6:.1f} MB, first drawing {took:.1f} s of a processor")
    assert drawn == [100_000, True, True]
    assert took < 10.0 and made.stat().st_size < 20e6


@in_a_browser
def test_a_drag_along_an_axis_keeps_the_runs_there_and_a_click_all(opened: Browser, folder: Path) -> None:
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    drag(opened, "speed", 0.5, 1.0)
    opened.wait("sweep.left < sweep.count")
    low, high = opened.evaluate(
        "(() => { const c = sweep.columns[0]; return sweep.brushes.get('speed').map((s) => c.value(s)); })()"
    )
    assert (low, high) == (pytest.approx(0.5, abs=0.02), pytest.approx(1.0, abs=0.02))
    kept = int(((table.speed >= low) & (table.speed <= high)).sum())
    assert opened.evaluate("sweep.left") == pytest.approx(kept, abs=1)
    assert opened.evaluate("document.getElementById('shown').textContent").startswith(
        f"{opened.evaluate('sweep.left')} of {RUNS} runs"
    )
    drag(opened, "speed", 1.4, 1.4)
    opened.wait("sweep.left === sweep.count && document.getElementById('clear').hidden")


@in_a_browser
def test_what_is_brushed_away_is_grey_in_the_pairs_too(opened: Browser) -> None:
    blue = """(() => { const c = document.querySelector('#matrix canvas');
      const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let n = 0; for (let k = 0; k < d.length; k += 4) n += d[k + 3] > 60 && d[k + 2] > d[k] + 60; return n; })()"""
    before = opened.evaluate(blue)
    opened.evaluate("sweep.brushes.set('speed', [0, 0.1]); sweep.soon()")
    opened.wait("sweep.left < sweep.count")
    assert 0 < opened.evaluate(blue) < 0.5 * before


@in_a_browser
def test_hovering_a_line_tells_its_run_and_a_click_its_command(opened: Browser, folder: Path) -> None:
    left, top = in_sight(opened, "#parallel svg")
    row = opened.evaluate("sweep.columns[4].shares.indexOf(Math.max(...sweep.columns[4].shares))")
    x, y = opened.evaluate(
        "(() => { const { x, y, step, columns } = sweep.parallel.shape; "
        f"return [x(4) + step / 2, (y(columns[4].shares[{row}]) + y(columns[5].shares[{row}])) / 2]; }})()"
    )
    mouse(opened, "mouseMoved", left + x, top + y)
    opened.wait("!document.getElementById('tip').hidden")
    table = parquet.read_table(folder / "runs.parquet").to_pandas()
    assert opened.problems == []
    told = opened.evaluate("document.getElementById('tip').textContent")
    assert table.id[row] in told and f"{table.peak[row]:.4g} N" in told
    mouse(opened, "mousePressed", left + x, top + y)
    mouse(opened, "mouseReleased", left + x, top + y)
    command = opened.evaluate("document.getElementById('picked-command').textContent")
    assert command == f"hric sweep rerun 'peak force' {table.id[row]}"


@in_a_browser
def test_hovering_a_point_of_a_pair_tells_its_run(opened: Browser, folder: Path) -> None:
    left, top = in_sight(opened, "#matrix svg")
    row = 7
    x, y = opened.evaluate(
        f"[sweep.matrix.x(0, sweep.columns[0].shares[{row}]), sweep.matrix.y(1, sweep.columns[1].shares[{row}])]"
    )
    mouse(opened, "mouseMoved", left + x, top + y)
    opened.wait("!document.getElementById('tip').hidden")
    assert parquet.read_table(folder / "runs.parquet")["id"][row].as_py() in opened.evaluate(
        "document.getElementById('tip').textContent"
    )


@in_a_browser
def test_keys_do_what_a_drag_does(opened: Browser) -> None:
    opened.evaluate("document.querySelector('.axis[data-column=mass]').focus()")
    opened.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowUp")
    opened.wait("sweep.brushes.has('mass') && sweep.left < sweep.count")
    assert opened.evaluate("document.activeElement.dataset.column") == "mass"
    opened.call("Input.dispatchKeyEvent", type="keyDown", key="Escape")
    opened.wait("sweep.left === sweep.count")


@in_a_browser
def test_a_kind_of_runs_is_switched_off_by_its_button(opened: Browser) -> None:
    opened.evaluate("document.querySelector('#kinds button[data-kind=exceeded]').click()")
    opened.wait("sweep.left < sweep.count")
    exceeded = opened.evaluate("sweep.kinds.filter((kind) => kind === 1).length")
    assert opened.evaluate("sweep.left") == RUNS - exceeded


@in_a_browser
def test_a_page_logs_no_problem_and_sends_no_request(opened: Browser) -> None:
    opened.emulate(scheme="dark")
    opened.wait("document.documentElement.dataset.theme === 'dark'")
    opened.emulate(scheme="light")
    assert opened.problems == [] and opened.requests == []
    assert opened.evaluate("document.title") == "peak force"


@in_a_browser
def test_the_page_of_a_running_sweep_loads_itself_again_and_keeps_what_was_chosen(
    browser: Browser, tmp_path: Path
) -> None:
    folder = sweep_folder.write(tmp_path / "a", 40, planned=64)
    browser.open(page.write(folder, running=True))
    browser.wait("typeof report === 'object' && report.ready === true && sweep.count === 40")
    browser.evaluate("sweep.brushes.set('speed', [0.2, 0.7]); sweep.soon()")
    sweep_folder.write(folder, 64, planned=64)
    page.write(folder)
    browser.wait("typeof sweep === 'object' && sweep.count === 64 && report.ready === true")
    assert not browser.evaluate("document.body.textContent.includes('This sweep is running')")
