"""Interventions of a supervisor in metrics, report, verdict and page of a run."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, installed
from rosbags.highlevel import AnyReader

from hric_analysis import supervised
from hric_analysis.supervised import Latency, SupervisorEvent, SupervisorMetrics
from hric_bags.records import safety_record
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_report import headline, text
from hric_report import html as report_html
from hric_report.html.strip import LEFT, WIDTH
from hric_run.definition import experiment

NAME, END = "shared_workspace", 3.5


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Run in which a person approaches and the arm stops; a second person is only monitored."""
    root = tmp_path_factory.mktemp("runs")
    setpoints = [row for row in experiment.read(NAME)["setpoints"] if row["time"] < END]
    short = [f"duration:={END}", f"setpoints:={json.dumps(setpoints)}", "simulator:=mujoco"]
    arguments = ["run", NAME, *short, "--runs", str(root), "--quiet"]
    assert main([*arguments, "--html"]) == 0
    first = RunFolder.open("latest", root)
    assert main([*arguments, "supervisor.active:=false", "--no-figures"]) == 0
    return first


@pytest.fixture(scope="module")
def watched(run: RunFolder) -> RunFolder:
    return RunFolder.open("latest", run.path.parent)


def states(folder: RunFolder) -> list:
    with AnyReader([folder.bag_path]) as bag:
        chosen = [one for one in bag.connections if one.topic == "/hric/safety/state"]
        return [bag.deserialize(raw, one.msgtype) for one, _, raw in bag.messages(chosen)]


def test_the_shares_of_the_time_are_those_of_the_decisions(run: RunFolder) -> None:
    found, own = json.loads(run.metrics_path.read_text())["supervisor"], states(run)
    for word in ("stopped", "slowed"):
        # All decisions are 10 ms apart; the last one lasts no time.
        assert found[f"share_{word}"] == pytest.approx(np.mean([one.state == word for one in own[:-1]]), abs=1e-6)
    assert found["share_stopped"] > 0.1 and found["share_slowed"] > 0.1
    assert found["separation_min"] == pytest.approx(min(one.separation for one in own))
    assert [one["kind"] for one in found["events"]] == ["slowed", "stopped"] and found["violations"] == []


def test_a_watched_arm_violates_and_all_of_it_says_so(run: RunFolder, watched: RunFolder) -> None:
    found, own = json.loads(watched.metrics_path.read_text())["supervisor"], states(watched)
    violated = [one for one in own if one.violation]
    assert sum(one["end"] - one["begin"] for one in found["violations"]) == pytest.approx(
        0.01 * len(violated), abs=0.02
    )
    assert found["margin_min_violated"] == pytest.approx(min(one.margin for one in violated))
    assert "MOVED CLOSER THAN THE PROTECTIVE DISTANCE" in (watched.path / "summary.txt").read_text()
    assert "never moved closer than the protective distance" in (run.path / "summary.txt").read_text()


def test_a_motion_that_the_supervisor_does_not_judge_is_told() -> None:
    event = SupervisorEvent(0.2, "moved", "the arm must stand still, but something else moves it", 0.1, -0.4)
    seen = SupervisorMetrics("speed_and_separation", 1.0, 0.0, 0.0, 0.1, (), None, Latency(None, None), (event,))
    assert text.violations(seen).endswith("except perhaps while something else than its controllers moved it")
    assert [one.kind for one in headline._supervised(seen)] == [headline.PLAIN] * 2
    assert headline._supervised(replace(seen, events=()))[1].kind == headline.GOOD


def test_the_time_in_which_the_distance_was_not_known_is_told_beside_the_smallest(run: RunFolder) -> None:
    record = safety_record.read(run.bag_path, lambda stamp: stamp)
    assert record is not None
    separation = record.separation.copy()
    separation[: len(separation) // 4] = np.nan
    found = supervised.metrics(replace(record, separation=separation))
    assert found is not None and found.share_unknown == pytest.approx(0.25, abs=0.01)
    told = f"m where it was known, not for {100.0 * found.share_unknown:.1f} % of the time"
    assert told in text._supervisor(found)
    assert "where it was known" not in (run.path / "summary.txt").read_text()


def test_a_run_without_a_supervisor_has_nothing_of_it(run: RunFolder, tmp_path: Path) -> None:
    arguments = ["run", "pd_step", "simulator:=mujoco", "duration:=1.1", "--runs", str(tmp_path), "--no-figures"]
    assert main([*arguments, "--quiet"]) == 0
    folder = RunFolder.open("latest", tmp_path)
    assert json.loads(folder.metrics_path.read_text())["supervisor"] is None
    assert "supervisor" not in (folder.path / "summary.txt").read_text()


def test_it_is_the_verdicts_productivity(run: RunFolder) -> None:
    verdict, own = json.loads((run.path / "verdict.json").read_text()), states(run)
    shares = {one["name"]: one["value"] for one in verdict["figures"] if one["group"] == "productivity"}
    for word in ("stopped", "slowed"):
        share = np.mean([one.state == word for one in own])
        assert shares[f"share of time {word} by the supervisor"] == pytest.approx(share, abs=0.01)


def test_the_figure_is_in_the_folder_with_what_it_shows(run: RunFolder) -> None:
    assert (run.path / "figures" / "supervisor.svg").is_file()
    assert "protective distance" in (run.path / "figures" / "captions.md").read_text()


@pytest.fixture(scope="module")
def opened(run: RunFolder, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(run.path / report_html.NAME)
        browser.wait("typeof report === 'object' && report.ready === true")
        yield browser


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
def test_a_click_on_the_stop_shows_it_in_the_replay(run: RunFolder, opened: Browser) -> None:
    assert not opened.problems
    stop = next(one for one in states(run) if one.state == "stopped").header.stamp
    begin = stop.sec + 1e-9 * stop.nanosec
    bar = "document.querySelector('svg[data-strip=supervisor] rect.level3')"
    opened.evaluate(f"{bar}.dispatchEvent(new MouseEvent('click', {{bubbles: true}}))")
    assert opened.evaluate("report.time") == pytest.approx(begin, abs=1e-6)
    where = opened.evaluate(f"Number({bar}.getAttribute('x'))")
    assert where == pytest.approx(LEFT + (WIDTH - LEFT) * (begin - 0.01) / (END - 0.02), abs=1.0)
    opened.evaluate("document.getElementById('plot-supervisor').scrollIntoView()")  # what is in sight is drawn
    opened.wait("document.querySelectorAll('#plot-supervisor .graph svg').length > 0")
