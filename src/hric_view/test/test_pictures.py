"""Pictures of plates whose force is not known, and of a second run beside the first."""

import base64
import io
import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, installed
from geometry_msgs.msg import TransformStamped, WrenchStamped
from PIL import Image
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from hric_core.command import main
from hric_core.robot_time import stamps
from hric_report.html.scene import SceneRobot
from hric_view import page
from hric_view.live import LiveJoints
from hric_view.parts import LivePlates, LiveStatics
from hric_view.recordings import RecordedWindow, run_names
from hric_view.server import ViewServer, Visit, WebPage

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it"),
]
ARM = """<robot name="arm"><link name="base"/><link name="one"><visual><geometry><box size="0.1 0.1 0.4"/></geometry>
</visual></link><joint name="joint1" type="revolute"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="2" velocity="2" effort="10"/></joint></robot>"""
DIFFERENT = 24.0
"""Smallest difference of a channel of a pixel, 0 to 255, that counts; project default."""


class PlateWindow:
    """Live window of an arm beside a force plate.

    Attributes:
        push: receiver of the wrench of the plate.
    """

    def __init__(self) -> None:
        self._joints, plates = LiveJoints(("joint1",)), list[str]()
        statics = LiveStatics(["base"], plates.append)
        self._plates = LivePlates(statics)
        place = TransformStamped(child_frame_id="force_plate_1")
        place.header.frame_id, place.transform.translation.x, place.transform.rotation.w = "base", 0.8, 1.0
        statics.push(TFMessage([place]))
        self.push = self._plates.add(*plates)

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page."""
        return page.render("plate", visit, live=True)

    def scene(self, visit: Visit) -> str:
        """Return the scene."""
        robot = SceneRobot("", ARM, ("joint1",), np.zeros(1), np.zeros((1, 1)))
        return page.scene_message([robot], [self._plates], live=True)

    def frame(self, time: float) -> str:
        """Return the frame of an instant [s]."""
        self._joints.push(JointState(Header(stamp=stamps.to_time(time)), ["joint1"], [0.0], [0.0], [0.0]))
        return page.frame_message([self._joints], [self._plates])


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    with Browser(tmp_path / "profile") as made:
        yield made
        assert made.problems == []


def picture(browser: Browser) -> np.ndarray:
    """Return the drawn scene, shape (height, width, 3)."""
    data = browser.evaluate("(report.replay.draw(), document.querySelector('#view canvas').toDataURL())")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB"), dtype=float)


def test_a_plate_is_fainter_without_its_force(browser: Browser) -> None:
    window = PlateWindow()
    server = ViewServer(window)
    browser.open_address(server.address)
    browser.wait("report.replay !== undefined")
    shown, opacity = list[float](), "report.replay.robots[0].plates[0].box.material.opacity"
    for number, force in enumerate((None, -700.0, math.nan, 0.0)):
        if force is not None:
            wrench = WrenchStamped()
            wrench.wrench.force.z = force
            window.push(wrench)
        server.send(window.frame(1.0 + number))
        browser.wait(f"report.end === {1.0 + number}")
        shown.append(browser.evaluate(opacity))
    server.close()
    assert max(shown[0], shown[2]) < 0.5 < min(shown[1], shown[3])  # 0 N is known


def test_a_second_run_is_drawn_translucent_where_it_was(browser: Browser, tmp_path: Path) -> None:
    for words in ((), ("kp:=200",)):
        assert main(["run", "pd_step", *words, "--quiet", "--no-figures", "--runs", str(tmp_path / "runs")]) == 0
    first, second = sorted(run_names(tmp_path / "runs"))
    server = ViewServer(RecordedWindow(tmp_path / "runs"))
    browser.open_address(server.link("/run", f"run={first}&other={second}"))
    browser.wait("report.started === true")
    browser.evaluate("report.setTime(1.1)")
    assert browser.evaluate(
        "report.replay.robots.map((robot) => robot.meshes().every(({ material }) => material.transparent))"
    ) == [False, True]
    hands = browser.evaluate(
        "(report.replay.scene.updateMatrixWorld(true), report.replay.robots.map(({ links }) => "
        "links.get('panda_link7').getWorldPosition(new THREE.Vector3()).toArray()))"
    )
    assert np.linalg.norm(np.subtract(*hands)) > 0.01, json.dumps(hands)
    both = picture(browser)
    browser.evaluate("report.replay.robots[1].root.visible = false")
    changed = np.abs(both - picture(browser)).max(axis=2) > DIFFERENT
    assert np.count_nonzero(changed) > 200
    server.close()
