"""Recorded runs in the window: list, replay, two runs together, report."""

import base64
import io
import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rosbag
from browser import Browser, installed
from PIL import Image

from hric_assessment.verdict.result import VERSION
from hric_bags.run_folder import RunFolder
from hric_core.command import main
from hric_core.errors import HricError
from hric_core.urdf import mimic_laws, read
from hric_report import html
from hric_report.html.scene import SceneRobot
from hric_view import page
from hric_view.live import LiveJoints
from hric_view.recordings import RecordedWindow, entry, run_names
from hric_view.server import ViewServer, Visit, WebPage

INSTANT = 1.0
"""Instant at which the pictures are compared [s]."""


def run(root: Path, *words: str) -> str:
    """Run an experiment without a ROS master; return the name of its folder."""
    before = set(run_names(root)) if root.exists() else set()
    assert main(["run", *words, "--quiet", "--no-figures", "--runs", str(root)]) == 0
    (name,) = set(run_names(root)) - before
    return name


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a run of the arm, one with softer gains, one with a person, and one that is broken."""
    folder = tmp_path_factory.mktemp("recorded")
    for words in (("pd_step",), ("pd_step", "kp:=200"), ("contact", "simulator:=mujoco")):
        run(folder, *words)
    broken = folder / "broken_20260101-000000"
    broken.mkdir()
    (broken / "run.yaml").write_text("experiment: [")
    return folder


@pytest.fixture
def names(root: Path) -> dict[str, list[str]]:
    """Names of the runs by their experiment."""
    return {kind: sorted(name for name in run_names(root) if name.startswith(kind)) for kind in ("pd_step", "contact")}


@pytest.fixture
def server(root: Path) -> Iterator[ViewServer]:
    made = ViewServer(RecordedWindow(root))
    yield made
    made.close()


def visit(path: str, **query: str) -> Visit:
    return Visit(path, query, "ws://127.0.0.1:1", "token")


def test_the_list_has_every_run_and_the_fault_of_a_broken_one(root: Path, names: dict[str, list[str]]) -> None:
    listed = RecordedWindow(root).page(visit("/"))
    assert listed is not None
    text = listed.body.decode()
    assert all(f"/run?run={name}&amp;token=token" in text for runs in names.values() for name in runs)
    assert "/run?run=broken" not in text and "broken_20260101-000000" in text
    broken = entry(RunFolder(root / "broken_20260101-000000"))
    assert "run.yaml" in broken.fault and broken.verdict == ""


def test_the_list_tells_runs_of_an_experiment_apart(root: Path, names: dict[str, list[str]], tmp_path: Path) -> None:
    rows = [entry(RunFolder(root / name)) for name in names["pd_step"]]
    assert sorted(row.arguments for row in rows) == ["", "kp:=200"] and {row.mode for row in rows} == {"headless"}
    listed = RecordedWindow(root).page(visit("/"))
    assert listed is not None and b"<td>kp:=200</td><td>headless</td>" in listed.body
    (tmp_path / "run.yaml").write_text("arguments: 3")
    assert (entry(RunFolder(tmp_path)).arguments, entry(RunFolder(tmp_path)).mode) == ("", "")


def test_only_the_file_says_that_it_needs_no_network(root: Path, names: dict[str, list[str]]) -> None:
    window, query = RecordedWindow(root), {"run": names["pd_step"][0]}
    says = {}
    for path in ("/", "/new", "/run", "/report"):
        served = window.page(visit(path, **query))
        assert served is not None
        says[path] = b"loads nothing from the network" in served.body
    assert says == {"/": False, "/new": False, "/run": False, "/report": True}


def test_a_run_that_was_not_assessed_is_not_known(root: Path, names: dict[str, list[str]]) -> None:
    assert entry(RunFolder(root / names["pd_step"][0])).verdict == "no person"
    folder = RunFolder(root / names["contact"][0])
    (folder.path / "verdict.json").unlink(missing_ok=True)
    assert entry(folder).verdict == "not known: not assessed yet"


@pytest.mark.parametrize(
    "content", ["[1]", '{"version": %d}', '{"version": %d, "input": {"name": "damaged", "kind": "run"}}']
)
def test_a_damaged_verdict_is_not_known(tmp_path: Path, content: str) -> None:
    folder = tmp_path / "damaged"
    folder.mkdir()
    (folder / "run.yaml").write_text("experiment: contact")
    (folder / "verdict.json").write_text(content.replace("%d", json.dumps(VERSION)))
    assert entry(RunFolder(folder)).verdict == "not known: verdict.json cannot be read"


def test_a_damaged_definition_is_listed_as_fault(tmp_path: Path) -> None:
    (tmp_path / "run.yaml").write_text("definition: text")
    assert "definition is 'text'; valid: a mapping" in entry(RunFolder(tmp_path)).fault


@pytest.mark.parametrize("name", ["", "..", "../recorded", "/etc", "latest", "no_such_run", "broken\0"])
def test_only_runs_of_the_folder_are_shown(root: Path, name: str) -> None:
    window = RecordedWindow(root)
    for path in ("/run", "/report"):
        with pytest.raises(HricError, match=r"the newest runs: .*contact"):
            window.page(visit(path, run=name))
    with pytest.raises(HricError, match="no run"):
        window.scene(visit("/socket", run=name))


def test_the_scene_has_the_motions_of_the_report(root: Path, names: dict[str, list[str]]) -> None:
    (name,) = names["contact"]
    message = json.loads(RecordedWindow(root).scene(visit("/socket", run=name)))
    expected = html.page_of(RunFolder(root / name)).robots
    assert message["type"] == "scene" and message["live"] is False
    counts = [robot["time"]["count"] for robot in message["data"]["scene"]["robots"]]
    assert counts == [len(robot.time) for robot in expected] and min(counts) > 100


def test_two_runs_of_different_motions_are_refused(root: Path, names: dict[str, list[str]]) -> None:
    with pytest.raises(HricError):
        RecordedWindow(root).scene(visit("/socket", run=names["pd_step"][0], other=names["contact"][0]))


def test_the_command_prints_the_address_and_ends_with_ctrl_c(root: Path) -> None:
    command = ["hric", "view", "latest", "--runs", str(root)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None and process.stderr is not None
            line = process.stdout.readline()
            process.send_signal(signal.SIGINT)
            process.wait(30)
        finally:
            process.kill()  # else the end of the block would wait for ever
        assert line.startswith("The window is open at http://127.0.0.1:") and "/run?run=" in line
        assert process.returncode == 130 and "Traceback" not in process.stderr.read()


class LiveCopy:
    """Live window of the robots of a run, without their motions."""

    def __init__(self, robots: list[SceneRobot]) -> None:
        self.robots, self.joints = [], []
        for robot in robots:
            joints = read(robot.description).joints
            laws = mimic_laws(joints)
            names = tuple(name for name, joint in joints.items() if joint.type != "fixed" and name not in laws)
            self.joints.append(LiveJoints(names))
            empty = (np.zeros(1), np.zeros((1, len(names))))
            self.robots.append(SceneRobot("", robot.description, names, *empty, pose=robot.pose, skin=robot.skin))

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page."""
        return page.render("live", visit)

    def scene(self, visit: Visit) -> str:
        """Return the scene."""
        return page.scene_message(self.robots, live=True)


def picture(browser: Browser) -> np.ndarray:
    """Return the drawn scene, shape (height, width, 3), from a fixed place and without what only a recording has."""
    browser.evaluate("document.getElementById('view').style.cssText = 'flex: none; width: 640px; height: 480px'")
    browser.evaluate(
        "report.replay.orbit.target.set(0.2, 0, 0.5); "
        "Object.assign(report.replay.orbit, { distance: 1.6, azimuth: 0.9, elevation: 0.3 })"
    )
    browser.evaluate(
        "for (const { arrows } of report.replay.robots) for (const { object } of arrows) object.visible = false"
    )
    data = browser.evaluate("(report.replay.draw(), document.querySelector('#view canvas').toDataURL())")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB"), dtype=float)


def messages(bag: Path, topic: str, after: float) -> Any:
    """Return the first message of a topic after an instant."""
    with rosbag.Bag(str(bag)) as reader:
        return next(one for _, one, _ in reader.read_messages([topic]) if one.header.stamp.to_sec() >= after)


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
class TestInABrowser:
    def test_from_the_list_to_two_runs_and_a_report(
        self, server: ViewServer, names: dict[str, list[str]], tmp_path: Path
    ) -> None:
        with Browser(tmp_path) as browser:
            browser.open_address(server.address)
            assert browser.evaluate("document.getElementById('compare').disabled")
            for name in names["pd_step"]:
                browser.evaluate(f"document.querySelector('.mark[value=\"{name}\"]').click()")
            browser.evaluate("document.getElementById('compare').click()")
            browser.wait("typeof report !== 'undefined' && report.started === true")
            labels = browser.evaluate("report.replay.robots.map(({ label }) => label)")
            assert sorted(label for label in labels if label) == names["pd_step"]
            lines = "[...document.querySelectorAll('#view-legend span')]"
            assert browser.evaluate(f"{lines}.map((line) => line.textContent)") == [label for label in labels if label]
            assert len(browser.evaluate(f"[...new Set({lines}.map((line) => line.style.color))]")) == 2
            assert browser.evaluate("document.getElementById('view').innerText") == ""  # nothing lies on the picture
            assert browser.evaluate("document.getElementById('notes').textContent") != ""
            browser.evaluate("(report.begin = -1, report.setTime(-0.001))")
            assert browser.evaluate("document.getElementById('now').textContent") == "0.00 s"
            browser.evaluate("document.querySelectorAll('nav a')[1].click()")
            browser.wait("typeof report !== 'undefined' && report.ready === true")
            assert browser.problems == []
            ours = server.address.partition("?")[0].partition("//")[2]
            assert all(address.partition("//")[2].startswith(ours) for address in browser.requests)

    def test_a_minute_is_played_and_scrubbed_by_keyboard(self, tmp_path: Path) -> None:
        name = run(tmp_path / "runs", "pd_step", "duration:=60")
        server = ViewServer(RecordedWindow(tmp_path / "runs"))
        with Browser(tmp_path / "profile") as browser:
            browser.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
            browser.open_address(server.link("/run", f"run={name}"))
            browser.wait("report.started === true")
            assert browser.evaluate("report.end - report.begin") == pytest.approx(60.0, abs=0.1)
            assert browser.evaluate("document.documentElement.scrollWidth") <= 390
            key(browser, " ")
            browser.wait("report.time > report.begin + 0.2")
            key(browser, " ")
            browser.evaluate("document.getElementById('time').focus()")
            for place, share in (("End", 1.0), ("Home", 0.0)):
                key(browser, place)
                browser.wait(f"report.time === report.begin + {share} * (report.end - report.begin)")
            elbow = "report.replay.robots[0].links.get('panda_link4').getWorldPosition(new THREE.Vector3()).toArray()"
            first = browser.evaluate(elbow)
            key(browser, "End")
            browser.wait("report.time === report.end")
            assert not np.allclose(browser.evaluate(elbow), first, atol=0.05)
            assert browser.problems == []
        server.close()

    def test_live_and_replayed_picture_of_an_instant_are_equal(
        self, server: ViewServer, root: Path, names: dict[str, list[str]], tmp_path: Path
    ) -> None:
        (name,) = names["contact"]
        folder = RunFolder(root / name)
        with Browser(tmp_path) as browser:
            live = LiveCopy([robot for robot in html.page_of(folder).robots if robot.position.size])
            topics = ("/joint_states", "/hric/human/joint_states")[: len(live.joints)]
            states = [messages(folder.bag_path, topic, INSTANT) for topic in topics]
            browser.open_address(server.link("/run", f"run={name}"))
            browser.wait("report.started === true")
            browser.evaluate("for (const id of ['show-tracks', 'show-trails']) document.getElementById(id).click()")
            begin = browser.evaluate("report.begin")
            browser.evaluate(f"report.setTime({states[0].header.stamp.to_sec()})")
            replayed = picture(browser)
            browser.evaluate(f"report.setTime({begin})")
            other = picture(browser)
            second = ViewServer(live)
            browser.open_address(second.address)
            for joints, state in zip(live.joints, states, strict=True):
                joints.push(state)
            browser.wait("report.replay !== undefined")
            second.send(page.frame_message(live.joints))
            browser.wait("report.started === true")
            shown = picture(browser)
            second.close()
        differing = np.mean(np.abs(shown - replayed).max(axis=2) > 24.0)
        assert differing < 0.002, f"{100 * differing:.2f} % of the pixels differ"
        assert np.mean(np.abs(shown - other).max(axis=2) > 24.0) > 0.01  # another instant looks different


def key(browser: Browser, name: str) -> None:
    """Press and release a key."""
    text = {"text": name} if name == " " else {}
    code = {" ": "Space"}.get(name, name)
    number = {" ": 32, "End": 35, "Home": 36}[name]
    for kind in ("keyDown", "keyUp"):
        browser.call(
            "Input.dispatchKeyEvent",
            type=kind,
            key=name,
            code=code,
            windowsVirtualKeyCode=number,
            **(text if kind == "keyDown" else {}),
        )
