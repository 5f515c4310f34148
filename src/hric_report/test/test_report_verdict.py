"""Verdict on the page of a run: colours of the body, charts over time, and clicks in a browser."""

import copy
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import laboratory_files
import pytest
from browser import Browser, installed

from hric_assessment.findings import DISCLAIMER
from hric_assessment.tables import rula_table
from hric_assessment.verdict.result import VERSION
from hric_bags.run_folder import RunFolder
from hric_core.command import main, perform
from hric_core.errors import HricError
from hric_human.body import Body, describe
from hric_human.participant.settings import HumanSettings
from hric_report import html as report_html
from hric_report.html import strip, verdict
from hric_report.html.body_picture import colour, picture, touched, views
from hric_report.html.strip import time_axis
from hric_skin import REGION_KEYS, SCALE

HAND, FACE, CHEST, ARM = "hand, fingers", "face", "chest", "lower arm, wrist"
RIGHT_HAND, RIGHT_ARM, LEFT_ARM = f"right {HAND}", f"right {ARM}", f"left {ARM}"


def finding(group: str, outcome: str, share: float | None = None, **more: Any) -> dict[str, Any]:
    return {
        "group": group,
        "subject": f"{group} <of> somebody",
        "outcome": outcome,
        "reason": "a reason",
        "table": "a table",
        "share": share,
        "values": {"force [N]": 12.5},
        "window": [0.5, 0.9],
        "signals": ["/a"],
        "missing": [],
        "notes": ["a note"],
        "regions": [],
        "side": "",
        "evidence": None,
        "remedy": "",
        "person": "",
        **more,
    }


def conclusion(question: str, reply: str, **more: Any) -> dict[str, Any]:
    """Return a conclusion of a verdict.json."""
    words = {"subject": f"{question} <of> somebody", "unit": "%", "reason": "a reason", "remedy": "", "person": ""}
    return {"question": question, "reply": reply, "value": None, "limit": None, "finding": None, **words, **more}


def capsule(link: str, x: float, *, decides: bool = False) -> dict[str, Any]:
    return {"link": link, "ends": [[x, 0.0, 0.5], [x, 0.0, 0.9]], "radius": 0.05, "decides": decides}


MADE: dict[str, Any] = {
    "version": VERSION,
    "disclaimer": DISCLAIMER,
    "outcome": "above limits",
    "answers": [
        conclusion("contact", "no", value=125.0, limit=100.0, finding=0, person="/hric/human2"),
        conclusion("distance", "unknown", remedy="record the arm's motion (control_log)"),
        conclusion("posture", "warning"),
        conclusion("effort", "no limit", value=31.0),
        conclusion("task", "yes"),
    ],
    "input": {"name": "a", "kind": "run", "experiment": None, "begin": 0.0, "end": 2.0, "notes": []},
    "limits": {"title": "ISO/TS 15066", "edition": "2016"},
    "person": None,
    "assumptions": ["a body of the middle"],
    "certainty": [],
    "findings": [
        finding("contact", "above limits", 1.25, regions=[HAND], side="right", window=[1.2, 1.3]),
        finding("contact", "above limits", None, regions=[FACE], window=[0.2, 0.3]),
        finding("contact", "not assessable", None, regions=[CHEST]),
        finding("contact", "not assessable", 0.3, regions=[ARM], side="right"),
        finding("contact", "within limits", 0.5, regions=[HAND, ARM], side="right"),
        finding("posture", "warning", None, window=[0.0, 2.0]),
    ],
    "figures": [{"group": "muscles", "name": "largest activation", "value": 0.7, "unit": "1", "note": "estimate"}],
    "missing": [{"signal": "EMG", "gives": "activation"}],
    "timelines": {
        "rula": [{"side": "right", "time": [0.0, 0.5, 1.0, 1.5], "score": [2, 2, 5, 7], "stricter": [], "looser": []}],
        "reba": [],
        "separation": None,
        "activation": {
            "name": ["quiet", "busy"],
            "time": [0.0, 1.0, 2.0],
            "activation": [[0, None, 0.1], [0.2, 0.9, 1]],
        },
    },
    "moment": {
        "time": 1.25,
        "question": "contact",
        "reply": "no",
        "subject": "contact of the arm with <hand>",
        "arm": [capsule("link0", 0.0), capsule("link7", 0.4, decides=True)],
        "person": [capsule("r_wrist", 0.5, decides=True), capsule("torso", 1.0)],
    },
}


def drawn(findings: Any, arms: Any = ()) -> dict[tuple[str, str], str]:
    """Return the SVG of each region by view and region."""
    views = [one for one in ElementTree.fromstring(picture(findings, arms)).iter("g") if one.get("data-view")]
    return {
        (view.get("data-view", ""), one.get("data-region", "")): ElementTree.tostring(one).decode()
        for view in views
        for one in view.iter("g")
        if one.get("data-region")
    }


def test_every_region_is_seen_in_a_view() -> None:
    assert {region for view in views() for region in view} == set(REGION_KEYS)
    front, back = views()
    assert {"back, shoulders", "pelvis"} <= set(back) and {"face", "chest", "abdomen"} <= set(front)


def test_a_region_has_the_largest_share_of_its_contacts_and_the_worst_outcome() -> None:
    met = touched(MADE["findings"])
    assert met[RIGHT_HAND].share == 1.25 and met[RIGHT_HAND].outcome == "above limits" and met[RIGHT_HAND].time == 1.2
    assert met[RIGHT_ARM].share == 0.5 and not met[RIGHT_ARM].assessable
    assert met[FACE].share is None and met[FACE].outcome == "above limits"
    assert set(met) == {RIGHT_HAND, FACE, CHEST, RIGHT_ARM}


def test_the_colour_of_a_share_goes_through_the_points_of_the_scale() -> None:
    for share, rgb in SCALE:
        assert colour(share) == "#" + "".join(f"{x:02x}" for x in rgb)
    assert colour(3.0) == colour(1.0) and len({colour(0.1 * k) for k in range(11)} | {colour(None)}) == 12


def test_what_is_above_assessable_and_not_touched_differ_in_the_picture() -> None:
    text = {region: svg for (view, region), svg in drawn(MADE["findings"]).items() if view == "front"}
    assert colour(1.25) in text[RIGHT_HAND] and 'class="above"' in text[RIGHT_HAND]
    assert "hatched" not in text[RIGHT_HAND] and "125 % of the limit" in text[RIGHT_HAND]
    assert colour(1.0) in text[FACE] and 'class="above"' in text[FACE]  # above, whatever its force
    assert "hatched" in text[CHEST] and "hatched" in text[RIGHT_ARM] and colour(0.5) in text[RIGHT_ARM]
    assert colour(None) in text[CHEST] and 'class="free"' in text["neck"] and "not touched" in text["neck"]


def test_only_the_touched_forearm_is_coloured() -> None:
    text = drawn([finding("contact", "warning", 0.9, regions=[ARM], side="left")])
    for view in ("front", "back"):
        assert colour(0.9) in text[view, LEFT_ARM] and "hatched" not in text[view, LEFT_ARM]
        assert 'class="free"' in text[view, RIGHT_ARM] and "not touched" in text[view, RIGHT_ARM]


def test_a_contact_on_an_unknown_side_is_hatched_on_both() -> None:
    text = drawn([finding("contact", "within limits", 0.2, regions=[ARM])])
    for side in (LEFT_ARM, RIGHT_ARM):
        assert "hatched" in text["front", side] and "it is not known on which side" in text["front", side]


def test_an_arm_that_the_body_lacks_is_drawn_faintly() -> None:
    text = drawn([finding("contact", "within limits", 0.2, regions=[ARM])], ["right"])
    assert "lacks" in text["front", LEFT_ARM] and "not part of the body model" in text["front", LEFT_ARM]
    assert "lacks" not in text["front", RIGHT_ARM]


def test_the_part_opens_with_five_answers_and_a_picture_and_folds_the_rest_away() -> None:
    head, rest = verdict.part(MADE).split("<details>", 1)
    replies = re.findall(r"<th scope=row>(\w+)</th><td><span class=\"reply \w+\">([\w ]+)</span>", head)
    assert replies == [(one["question"], one["reply"]) for one in MADE["answers"]]
    assert "<b>125 % of the limit</b> /hric/human2: " in head and "To find out: record the arm&#39;s motion" in head
    assert '<svg class="moment"' in head and 'data-time="1.25"' in head
    assert "Findings" in rest and '<svg class="body"' in rest and '<svg class="strip"' in rest


def test_the_disclaimer_stands_once_and_words_of_a_recording_are_escaped() -> None:
    text = verdict.part(MADE)
    assert text.count(DISCLAIMER) == 1
    assert "<of>" not in text and "contact &lt;of&gt; somebody" in text and "<hand>" not in text
    for words in ("125 %", "largest activation", "EMG", "a note", "a body of the middle", "ISO/TS 15066 (2016)"):
        assert words in text


def test_a_verdict_whose_places_are_not_known_has_no_picture_of_the_worst_moment() -> None:
    assert 'svg class="moment"' not in verdict.part(MADE | {"moment": None})


@pytest.mark.parametrize(
    ("begin", "end", "expected"),
    [(0.0, 3.99, [0, 1, 2, 3]), (0.2, 18.3, [5, 10, 15]), (1.0, 1.05, [1.0, 1.01, 1.02, 1.03, 1.04, 1.05])],
)
def test_times_along_an_axis_are_round(begin: float, end: float, expected: list[float]) -> None:
    assert time_axis(begin, end).ticks == pytest.approx(expected)


def test_each_strip_has_a_key_of_its_colours() -> None:
    strips = re.findall(r"<figure class=along>.*?</figure>", verdict.part(MADE), re.DOTALL)
    findings, rula, activation = strips
    assert all(word in findings for word in verdict.KINDS)
    assert all(f"up to {highest}<" in rula for highest in rula_table().levels)
    assert "0 (light) to 1 (dark)" in activation


def test_a_low_score_of_an_arm_whose_angles_are_not_all_known_is_not_green() -> None:
    lacking = finding("posture", "not assessable", subject="RULA of the right arm")
    text = verdict.part(MADE | {"findings": [lacking]})
    assert re.findall(r'<rect class="jump (\w+)"[^>]*data-time="[\d.]+"', text.split('data-strip="RULA"')[1])[:3] == [
        "unknown",
        "level3",
        "level4",
    ]


def test_stretches_of_scores_begin_where_their_level_does() -> None:
    text = verdict.part(MADE)
    strip = re.search(r'<svg class="strip" data-strip="RULA".*?</svg>', text, re.DOTALL)
    assert strip is not None
    bars = re.findall(r'<rect class="jump (\w+)"[^>]*data-time="([\d.]+)"', strip[0])
    assert bars == [("level1", "0"), ("level3", "1"), ("level4", "1.5")]


def test_the_most_active_muscle_comes_first_and_gaps_stay() -> None:
    text = verdict.part(MADE)
    assert text.index(">busy<") < text.index(">quiet<") and "data:image/png;base64," in text


def test_a_verdict_without_findings_in_time_has_no_strips() -> None:
    bare = copy.deepcopy(MADE) | {"findings": [], "timelines": {"rula": [], "reba": [], "activation": None}}
    text = verdict.part(bare)
    assert 'class="strip"' not in text and 'class="body"' in text


# -- of a run ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Return a run in which the arm hits a forearm."""
    root = tmp_path_factory.mktemp("runs")
    words = ["contact", "simulator:=mujoco", "duration:=2", "--quiet", "--no-figures", "--html", "--runs", str(root)]
    assert main(["run", *words]) == 0
    return RunFolder((root / "latest").resolve())


def test_a_run_with_a_person_gets_a_verdict_with_its_page(run: RunFolder) -> None:
    found = json.loads((run.path / "verdict.json").read_text())
    page = (run.path / report_html.NAME).read_text()
    assert page.index('id="safety-and-ergonomics"') < page.index('id="key-figures"')
    assert page.count("<th scope=row>") == len(found["answers"]) and page.count(DISCLAIMER) == 1


def test_a_verdict_of_this_run_that_is_there_is_shown_as_it_is(run: RunFolder, tmp_path: Path) -> None:
    folder = RunFolder(tmp_path / "copy")
    folder.path.mkdir()
    folder.write(run.read())
    made = MADE | {"input": MADE["input"] | {"name": "copy"}}
    (folder.path / "verdict.json").write_text(json.dumps(made))
    assert verdict.verdict_of(folder) == made


@pytest.mark.parametrize(
    "changes",
    [{"version": VERSION - 1}, {"input": MADE["input"]}, {"input": MADE["input"] | {"kind": "bag"}}, {"input": None}],
)
def test_a_verdict_of_an_older_version_or_another_recording_is_made_anew(
    run: RunFolder, tmp_path: Path, changes: dict[str, Any]
) -> None:
    folder = RunFolder(tmp_path / run.path.name)
    shutil.copytree(run.path, folder.path)
    own = MADE | {"input": MADE["input"] | {"name": run.path.name}}
    (folder.path / "verdict.json").write_text(json.dumps(own | changes))
    made = verdict.verdict_of(folder)
    assert made is not None and made["version"] == VERSION and made["input"]["name"] == run.path.name
    assert made["findings"] != MADE["findings"]


def test_a_run_without_a_person_has_none(tmp_path: Path) -> None:
    folder = RunFolder(tmp_path)
    folder.write({"definition": {"human": None, "person": None}})
    assert verdict.verdict_of(folder) is None and not (tmp_path / "verdict.json").exists()


def robots_of(page: str) -> list[dict[str, Any]]:
    found = re.search(r"<script[^>]*id=data>(.*?)</script>", page, re.DOTALL)
    assert found is not None
    return list(json.loads(found[1])["scene"]["robots"])


def test_a_bag_alone_gets_a_page_with_its_verdict_and_a_replay(
    run: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "alone.bag"
    shutil.copy(run.bag_path, bag)
    assert main(["report", str(bag), "--html"]) == 0
    printed, page = capsys.readouterr().out, (tmp_path / "alone_report.html").read_text()
    found = json.loads((tmp_path / "alone_verdict.json").read_text())
    assert f"verdict: {found['outcome']}" in printed and "alone_report.html" in printed and DISCLAIMER in printed
    assert page.count("<th scope=row>") == len(found["answers"]) and page.count(DISCLAIMER) == 1
    arm, person = robots_of(page)
    assert arm["columns"] == 7 and arm["motion"] is None
    assert person["columns"] == len(settings_body(run).joints) and person["motion"] is None
    assert "The position of the person is not known" in page  # their settings are in the run folder
    (tmp_path / "alone_verdict.json").write_text(
        json.dumps(found | {"outcome": "warning"})
    )  # as one left it with choices
    assert main(["report", str(bag)]) == 0
    assert "verdict: warning" in capsys.readouterr().out
    os.utime(bag, (os.path.getmtime(bag) + 100.0,) * 2)  # another bag of this name and time
    assert main(["report", str(bag)]) == 0
    assert f"verdict: {found['outcome']}" in capsys.readouterr().out
    (tmp_path / "alone_verdict.json").write_text(json.dumps(MADE))  # of another recording
    assert main(["report", str(bag)]) == 0
    assert f"verdict: {found['outcome']}" in capsys.readouterr().out


def settings_body(run: RunFolder) -> Body:
    return describe(HumanSettings.of(run.read()["definition"]["human"], "human").person)


def test_a_trc_file_gets_a_page_with_what_it_lacks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = laboratory_files.write_trc(tmp_path / "short.trc", laboratory_files.points("opencap"))
    file.write_text(file.read_text().replace("Units\n60\t60\tm", "Units\tNumFrames\n60\t60\tm\t61"))
    assert main(["report", str(file), "--html"]) == 0
    note = "left out of short.trc: 1 of the 61 frames stated in the header: the file does not contain them"
    assert f"note: {note}" in capsys.readouterr().out and note in (tmp_path / "short_report.html").read_text()


def test_a_bag_that_is_not_there_is_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(HricError, match=r"no bag nothing\.bag"):
        perform(["report", str(tmp_path / "nothing.bag"), "--html"])


def in_a_browser(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test as slow, because it needs a browser."""
    without = pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
    return pytest.mark.slow(without(test))


@pytest.fixture(scope="module")
def opened(run: RunFolder, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(run.path / report_html.NAME)
        browser.wait("typeof report === 'object' && report.ready === true")
        yield browser


@in_a_browser
def test_the_page_says_nothing_on_the_console_and_asks_for_nothing(opened: Browser) -> None:
    assert not opened.problems and not opened.requests


@in_a_browser
def test_a_click_on_an_episode_sets_the_time_of_the_replay(opened: Browser) -> None:
    opened.evaluate("document.querySelector('#safety-and-ergonomics details').open = true")
    times = opened.evaluate("[...document.querySelectorAll('rect.jump')].map((one) => Number(one.dataset.time))")
    assert len(times) > 3 and max(times) > 0.5
    for index, time in enumerate(times):
        opened.evaluate(
            f"document.querySelectorAll('rect.jump')[{index}].dispatchEvent(new MouseEvent('click', {{bubbles: true}}))"
        )
        assert opened.evaluate("report.time") == pytest.approx(time, abs=1e-6)
        assert opened.evaluate("Number(document.getElementById('time').value)") == pytest.approx(time, abs=1e-6)


@in_a_browser
def test_keys_and_rows_do_the_same(opened: Browser) -> None:
    opened.evaluate("report.setTime(report.begin)")
    late = "[...document.querySelectorAll('rect.jump')].find((one) => Number(one.dataset.time) > 0.5)"
    opened.evaluate(f"{late}.dispatchEvent(new KeyboardEvent('keydown', {{key: 'Enter', bubbles: true}}))")
    assert opened.evaluate("report.time") > 0.5
    row = "document.querySelector('#safety-and-ergonomics tr.event')"
    opened.evaluate(f"{row}.click()")
    assert opened.evaluate("report.time") == pytest.approx(opened.evaluate(f"Number({row}.dataset.time)"), abs=1e-6)


@in_a_browser
def test_the_lines_in_all_strips_follow_the_time(opened: Browser) -> None:
    for share in (0.0, 0.5, 1.0):
        opened.evaluate(f"report.setTime(report.begin + {share} * (report.end - report.begin))")
        where = opened.evaluate(
            "[...document.querySelectorAll('svg.strip .now')].map((one) => Number(one.getAttribute('x1')))"
        )
        expected = strip.LEFT + share * (strip.WIDTH - strip.LEFT)
        assert len(where) >= 4 and where == pytest.approx([expected] * len(where), abs=2.0)


@in_a_browser
def test_a_click_between_episodes_sets_the_time_that_is_there(opened: Browser) -> None:
    share = (strip.LEFT + 0.25 * (strip.WIDTH - strip.LEFT)) / strip.WIDTH
    opened.evaluate(
        "(() => { const svg = document.querySelector('svg.strip[data-strip=activation]'); "
        f"const box = svg.getBoundingClientRect(), x = box.left + {share} * box.width; "
        "svg.dispatchEvent(new MouseEvent('click', {bubbles: true, clientX: x, clientY: box.top + 5})); })()"
    )
    share = opened.evaluate("(report.time - report.begin) / (report.end - report.begin)")
    assert share == pytest.approx(0.25, abs=0.01)


@in_a_browser
def test_the_regions_that_were_touched_have_the_colour_of_their_share(opened: Browser, run: RunFolder) -> None:
    found = json.loads((run.path / "verdict.json").read_text())
    for region, one in touched(found["findings"]).items():
        path = f"document.querySelector('svg.body g[data-region=\"{region}\"] path')"
        red, green, blue = (int(colour(one.share or 0.0)[k : k + 2], 16) for k in (1, 3, 5))
        assert opened.evaluate(f"getComputedStyle({path}).fill") == f"rgb({red}, {green}, {blue})"


@in_a_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_first_screen_of_a_phone_has_every_reply(run: RunFolder, tmp_path: Path, scheme: str) -> None:
    with Browser(tmp_path) as browser:
        browser.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        browser.emulate(scheme=scheme)
        browser.open(run.path / report_html.NAME)
        browser.wait("report.ready === true")
        bottoms = "[...document.querySelectorAll('.reply')].map((one) => one.getBoundingClientRect().bottom)"
        assert len(found := browser.evaluate(bottoms)) == 5 and max(found) < 844
        assert browser.evaluate("document.documentElement.scrollWidth") <= 390


def test_first_label_of_a_page_is_the_outcome(run: RunFolder) -> None:
    text = (run.path / report_html.NAME).read_text()
    labels = re.findall(r'<span class="verdict (\w+)">([^<]*)</span>', text)
    outcome = json.loads((run.path / "verdict.json").read_text())["outcome"]
    assert labels[0] == (verdict.KINDS[outcome], f"safety and ergonomics: {outcome}")
