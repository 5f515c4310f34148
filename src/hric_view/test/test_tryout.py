"""`hric try`: each change runs the experiment anew, and its figures stand beside those before."""

import json
import os
import re
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, installed
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

from hric_assessment.verdict import opened
from hric_assessment.verdict.assess import assess
from hric_core.command import main
from hric_core.errors import FailureError, HricError
from hric_view.server import ViewServer, Visit
from hric_view.tryout import SLIDERS, Tryout, checked, overrides, run
from hric_view.tryout_figures import TryoutFigure, figures_of
from hric_view.tryout_window import TryoutWindow


@pytest.fixture(scope="module")
def tryout() -> Iterator[Tryout]:
    made = Tryout()
    yield made
    made.close()


@pytest.fixture
def server(tryout: Tryout) -> Iterator[ViewServer]:
    window = TryoutWindow(tryout)
    made = ViewServer(window, receiver=window)
    yield made
    made.close()


def figures(message: str) -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in json.loads(message)["figures"]}


def test_figures_are_those_of_the_recorded_run(tryout: Tryout, tmp_path: Path) -> None:
    values = checked({"speed": 1.5, "mass": 60, "sex": 1})
    assert main(["run", "try_contact", *overrides(values), "--quiet", "--no-figures", "--runs", str(tmp_path)]) == 0
    (folder,) = (path.parent for path in tmp_path.glob("*_*/run.yaml"))
    expected = {one.name: (one.value, one.limit, one.reply) for one in figures_of(assess(opened(str(folder))))}
    shown = figures(tryout.result(values))
    assert {name: (one["value"], one["limit"], one["reply"]) for name, one in shown.items()} == expected
    assert shown["largest contact force"]["value"] > 20.0


def test_a_faster_arm_hits_harder(tryout: Tryout) -> None:
    slow, fast = (figures(tryout.result({"speed": speed})) for speed in (0.8, 1.6))
    for name in ("largest contact force", "speed at contact"):
        assert fast[name]["value"] > 1.2 * slow[name]["value"]


def test_an_unassessable_contact_has_no_figures(tmp_path: Path) -> None:
    shown = judged(tmp_path, "human.contact_area:=null")
    assert shown["contact, share of its limit"].reply == "unknown"
    for name in ("largest contact force", "speed at contact", "permitted speed", "contact, share of its limit"):
        assert shown[name].value is None and "area" in shown[name].reason


def test_all_runs_have_the_same_figures(tryout: Tryout) -> None:
    names = {tuple(figures(tryout.result(values))) for values in ({}, {"speed": 2.0}, {"speed": 0.2})}
    assert len(names) == 1 and {"RULA", "REBA"} <= set(*names)


def judged(folder: Path, override: str) -> dict[str, TryoutFigure]:
    """Return the figures of a recorded run of the experiment with another value of one key, by name."""
    assert main(["run", "try_contact", override, "--quiet", "--no-figures", "--runs", str(folder)]) == 0
    (run,) = (path.parent for path in folder.glob("*_*/run.yaml"))
    return {one.name: one for one in figures_of(assess(opened(str(run))))}


def test_a_score_that_unknown_angles_can_change_is_unknown(tmp_path: Path) -> None:
    shown = judged(tmp_path, "human.parts:=right_arm")
    for name in ("RULA", "REBA"):
        assert (shown[name].value, shown[name].reply) == (None, "unknown") and "neck_flexion" in shown[name].reason


def crash(values: Mapping[str, float]) -> str:
    """End the worker at a run of the fastest arm; hang at that of the slowest; fail at that of the softest."""
    if values["speed"] == 2.0:
        os.kill(os.getpid(), signal.SIGKILL)
    if values["speed"] == 0.2:
        time.sleep(60.0)
    if values["stiffness"] == 20.0:
        raise KeyError("nowhere")
    return str(os.getpid())


def refuse_defaults(values: Mapping[str, float]) -> str:
    """Refuse the first run of a page, as on a busy machine."""
    if values == checked({}):
        raise HricError("not in time")
    return run(values)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"speed": 2.0}, "the process of the run has died"),
        ({"speed": 0.2}, "was stopped, since it took more than 5 s"),
        ({"stiffness": 20.0}, "because of a programming error: .*nowhere"),
    ],
)
def test_a_broken_run_ends_with_one_message(values: dict[str, Any], text: str) -> None:
    broken = Tryout(crash, timeout=5.0)
    with pytest.raises(FailureError, match=text):
        broken.result(values)
    assert broken.result({}).isdigit()
    broken.close()


def test_a_process_that_dies_between_runs_is_replaced() -> None:
    made = Tryout(crash)
    first = int(made.result({}))
    os.kill(first, signal.SIGKILL)
    deadline = time.monotonic() + 60.0
    while made.alive and time.monotonic() < deadline:
        time.sleep(0.05)
    assert int(made.result({"mass": 80})) != first
    made.close()


def test_without_a_contact_the_force_is_not_known(tryout: Tryout) -> None:
    shown = figures(tryout.result({"speed": 0.2}))
    for name, reply in (("largest contact force", ""), ("contact, share of its limit", "no contact")):
        assert (shown[name]["value"], shown[name]["reply"]) == (None, reply)
        assert "nothing touched the person" in shown[name]["reason"]


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"speed": 3.0}, "largest joint speed is 3.0; valid: 0.2 to 2 rad/s"),
        ({"speed": "fast"}, "valid: 0.2 to 2"),
        ({"speed": True}, "valid: 0.2 to 2"),
        ({"sex": 0.5}, "sex of the person is 0.5"),
        ({"spede": 1.0}, "did you mean speed"),
    ],
)
def test_conditions_outside_their_range_are_refused(tryout: Tryout, values: dict[str, Any], text: str) -> None:
    with pytest.raises(HricError, match=text):
        tryout.result(values)


def test_every_condition_changes_the_experiment() -> None:
    default = overrides(checked({}))
    assert all(
        overrides(checked({one.name: one.upper if one.default < one.upper else one.lower})) != default
        for one in SLIDERS
    )


@pytest.mark.parametrize("message", ['{"command":"rm"}', '{"command":"run"}', '{"command":"run","values":[]}', "1"])
def test_a_message_of_no_page_closes_the_connection(server: ViewServer, message: str) -> None:
    with client(server) as viewer, pytest.raises(ConnectionClosed):
        viewer.send(message)
        for _ in range(3):
            viewer.recv(60)


def test_a_refused_first_run_can_be_followed_by_another() -> None:
    tryout = Tryout(refuse_defaults)
    window = TryoutWindow(tryout)
    server = ViewServer(window, receiver=window)
    with client(server) as viewer:
        assert json.loads(viewer.recv(60)) == {"type": "refused", "text": "not in time"}
        viewer.send('{"command":"run","values":{"speed":1.6}}')
        assert json.loads(viewer.recv(60))["values"]["speed"] == 1.6
    server.close()
    tryout.close()


def client(server: ViewServer) -> Any:
    origin, _, query = server.address.partition("/?")
    address = f"{origin.replace('http', 'ws')}/socket?{query}"
    return connect(address, origin=Origin(origin), max_size=None, close_timeout=0.1)


def slide(page: Browser, **values: float) -> None:
    """Set sliders as a user does, all before the run begins."""
    page.evaluate(
        f"(() => {{ for (const [name, value] of Object.entries({json.dumps(values)})) "
        "document.querySelector(`[name=${name}]`).value = value; "
        "document.querySelector('[name=speed]').dispatchEvent(new Event('change', { bubbles: true })); })()"
    )


def rows(page: Browser) -> dict[str, list[str]]:
    """Return the texts of the table by the name of the figure: note, now, before, change, mark, limit, reply."""
    cells = page.evaluate(
        "[...document.querySelectorAll('#figures tbody tr')].map((row) => [...row.cells].flatMap((cell, k) => ["
        "cell.firstChild?.data ?? '', ...(k % 3 ? [] : [cell.querySelector('small')?.textContent ?? ''])]))"
    )
    return {name: texts for name, *texts in cells}


class HeldWindow(TryoutWindow):
    """Window whose first run begins when the test lets it."""

    def __init__(self, tryout: Tryout) -> None:
        super().__init__(tryout)
        self.begin = threading.Event()

    def scene(self, visit: Visit) -> str:
        """Return the run with the default conditions."""
        self.begin.wait(60.0)
        return super().scene(visit)


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
class TestInABrowser:
    @pytest.fixture
    def window(self, tryout: Tryout) -> HeldWindow:
        return HeldWindow(tryout)

    @pytest.fixture
    def page(self, window: HeldWindow, tmp_path: Path) -> Iterator[Browser]:
        """Page on the screen of a phone."""
        server = ViewServer(window, receiver=window)
        with Browser(tmp_path) as page:
            page.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
            page.open_address(server.address)
            yield page
            assert page.problems == [] and page.requests == []
        server.close()

    def test_each_row_has_both_runs_and_their_difference(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        first = rows(page)["largest contact force"]
        assert first[2:5] == ["", "", ""]
        slide(page, speed=1.6)
        page.wait("document.getElementById('changes').textContent === 'speed: 1 to 1.6 rad/s'")
        _, now, before, change, *_ = rows(page)["largest contact force"]
        newtons = [float(text.split()[0].replace("+", "")) for text in (now, before, change)]
        assert before == first[1] and newtons[2] == pytest.approx(newtons[0] - newtons[1], abs=0.1)
        assert page.evaluate("report.replay.robots.length") == 2

    def test_rows_nearer_to_their_limit_are_marked_worse(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        for speed, mark in ((1.6, "worse"), (0.8, "better")):
            slide(page, speed=speed)
            page.wait(f"document.getElementById('changes').textContent.endsWith('to {speed} rad/s')")
            shown = rows(page)
            for name in ("speed at contact", "contact, share of its limit"):
                assert shown[name][4] == mark
            assert shown["effort, largest joint torque"][4] == ""  # it has no limit
            assert "right shoulder flexion" in shown["effort, largest joint torque"][0]

    def test_a_figure_that_is_lost_is_marked(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        slide(page, speed=0.2)
        page.wait("document.getElementById('changes').textContent.endsWith('to 0.2 rad/s')")
        note, now, _, change, mark, *_ = rows(page)["largest contact force"]
        assert (note, now, change, mark) == ("nothing touched the person", "not known", "", "no longer known")
        note, now, _, change, mark, _, reply = rows(page)["contact, share of its limit"]
        assert (note, now, change, mark, reply) == ("nothing touched the person", "no contact", "", "", "")

    def test_lengths_are_shown_to_the_millimetre(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        slide(page, speed=1.6)
        page.wait("document.getElementById('changes').textContent !== ''")
        now = rows(page)["smallest distance"][1]
        assert re.fullmatch(r"0 m|-?\d\.\d{1,3} m", now)

    def test_the_sex_is_chosen_in_words(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        assert page.evaluate("[...document.querySelector('[name=sex]').options].map(({ text }) => text)") == [
            "male",
            "female",
        ]
        slide(page, sex=1)
        page.wait("document.getElementById('changes').textContent === 'sex: male to female'")

    def test_a_change_after_a_refused_first_run_is_simulated(self, tmp_path: Path) -> None:
        tryout = Tryout(refuse_defaults)
        window = TryoutWindow(tryout)
        server = ViewServer(window, receiver=window)
        with Browser(tmp_path) as page:
            page.open_address(server.address)
            page.wait("document.getElementById('running').textContent === 'refused: not in time.'")
            slide(page, speed=1.6)
            page.wait("report.started === true")
            assert page.problems == []
        server.close()
        tryout.close()

    def test_figures_of_other_conditions_look_old(self, window: HeldWindow, page: Browser) -> None:
        window.begin.set()
        page.wait("report.started === true")
        slide(page, mass=120, height=1.5)
        page.wait("document.getElementById('running').textContent.startsWith('refused: ')")
        assert page.evaluate("document.getElementById('figures').classList.contains('old')")

    def test_no_state_is_wider_than_a_phone(self, window: HeldWindow, page: Browser) -> None:
        widths = {"waiting": page.evaluate("document.documentElement.scrollWidth")}
        window.begin.set()
        page.wait("report.started === true")
        widths["result"] = page.evaluate("document.documentElement.scrollWidth")
        slide(page, speed=2.0, hand=0.73)
        page.wait("document.getElementById('changes').textContent.includes('hand')")
        widths["two runs"] = page.evaluate("document.documentElement.scrollWidth")
        slide(page, mass=120, height=1.5)
        page.wait("document.getElementById('running').textContent.startsWith('refused: ')")
        widths["refused"] = page.evaluate("document.documentElement.scrollWidth")
        assert max(widths.values()) <= 390, widths
