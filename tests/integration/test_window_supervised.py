"""Setpoint, and distance to the person, of a running collaboration as the window draws them."""

import base64
import io
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from browser import Browser, installed
from live_system import LiveSystem
from PIL import Image
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin

pytestmark = [
    pytest.mark.alone,
    pytest.mark.live,  # a browser that draws in software takes the processors that others need
    pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it"),
]
STEP = 0.05
"""Time between the instants that are looked at [s]."""
MOVING, RESTING = 0.3, 0.01
"""Velocities of the first joint above which it moves, and below which it rests [rad/s]."""
SCENE = """
const { scene, robots } = report.replay;
const [ghost, line] = ["setpoint", "separation"].map((name) => scene.getObjectByName(name));
scene.updateMatrixWorld(true);
const box = (robot) => robot.meshes().reduce((whole, mesh) => whole.expandByObject(mesh), new THREE.Box3());
const angle = (root) => new THREE.Euler().setFromQuaternion(root.getObjectByName("panda_link1").quaternion).z;
const ends = line.geometry.attributes.position.array;
const far = (robot, k) => box(robot).distanceToPoint(new THREE.Vector3().fromArray(ends, 3 * k));
"""
"""Names for what the window draws: first joint position [rad], distance of an end of the line from a body [m]."""
NEAR = 0.1
"""Largest distance of an end of the line from the shapes [m]: the supervisor's capsules are larger; project default."""
RADII = 0.3
"""Bound of the sum of the radii of two capsules, on whose axes the line ends [m]: of an arm and a trunk."""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of the window of a run."""
    words = "env:=sim experiment:=shared_workspace simulator:=mujoco rviz:=false view:=web record:=false"
    system = LiveSystem(tmp_path_factory.mktemp("supervised"), *words.split())
    try:
        system.wait_output("  see it ")
        match = re.search(r"see it +(\S+)", system.output)
        assert match is not None
        yield match[1]
    finally:
        system.close()


@pytest.fixture(scope="module")
def browser(address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Window after the first seconds of the run; what came is kept in the page."""
    with Browser(tmp_path_factory.mktemp("profile")) as made:
        made.open_address(address)
        made.wait("report.started === true && report.end > 12", 90.0)  # near the person the arm rests for seconds
        made.evaluate("document.getElementById('live').click()")
        yield made
        lost = "WebSocket connection"  # the run may end before the tests do
        assert [text for text in made.problems if not text.startswith(lost)] == [] and made.requests == []


def test_without_control_a_command_ends_the_connection(address: str) -> None:
    origin, _, query = address.partition("/?")
    with connect(f"{origin.replace('http', 'ws')}/socket?{query}", origin=Origin(origin), close_timeout=0.1) as client:
        client.recv(20)
        client.send('{"command":"take","name":"Eve"}')
        with pytest.raises(ConnectionClosed):
            for _ in range(200):
                client.recv(20)


def at(browser: Browser, time: float, expression: str) -> Any:
    """Return the value of an expression about the scene at an instant [s]."""
    return browser.evaluate(f"(() => {{ report.setTime({time}); {SCENE} return {expression}; }})()")


def drawn(browser: Browser, name: str) -> int:
    """Return the number of pixels that an object of the scene changes."""
    pictures = []
    for visible in ("true", "false"):
        code = f"report.replay.scene.getObjectByName('{name}').visible = {visible}; report.replay.draw();"
        data = browser.evaluate(f"(() => {{ {code} return document.querySelector('#view canvas').toDataURL(); }})()")
        pictures.append(np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))), dtype=float))
    return int(np.count_nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 8.0))


@pytest.fixture(scope="module")
def course(browser: Browser) -> np.ndarray:
    """First joint: setpoint and position [rad], and velocity [rad/s], shape (n, 3), while the setpoint is shown."""
    browser.evaluate("document.getElementById('show-ghost').click()")
    begin, end = browser.evaluate("[report.begin, report.end]")
    rows = [at(browser, t, "[ghost.visible, angle(ghost), angle(robots[0].root)]") for t in np.arange(begin, end, STEP)]
    browser.evaluate("document.getElementById('show-ghost').click()")
    angles = np.array([(setpoint if visible else np.nan, arm) for visible, setpoint, arm in rows])
    return np.column_stack([angles, np.gradient(angles[:, 1], STEP)])


def test_the_setpoint_is_hidden_until_it_is_wanted(browser: Browser) -> None:
    assert at(browser, browser.evaluate("report.end"), "ghost.visible") is False


def test_the_setpoint_leads_the_moving_arm(course: np.ndarray) -> None:
    known = course[np.isfinite(course).all(axis=1)]  # a setpoint that is late is not known
    setpoint, arm, velocity = known[np.abs(known[:, 2]) > MOVING].T
    assert len(arm) > 5 and np.all((setpoint - arm) * velocity > 0.0)


def test_the_setpoint_covers_the_resting_arm(course: np.ndarray) -> None:
    setpoint, arm, _ = course[np.abs(course[:, 2]) < RESTING].T
    assert np.nanmin(np.abs(setpoint - arm)) < 0.01


def test_the_setpoint_is_drawn_beside_the_arm(browser: Browser, course: np.ndarray) -> None:
    apart = int(np.nanargmax(np.abs(course[:, 0] - course[:, 1])))
    at(browser, browser.evaluate("report.begin") + STEP * apart, "null")
    assert drawn(browser, "setpoint") > 200


def test_the_line_joins_arm_and_person(browser: Browser) -> None:
    visible, arm, person = at(
        browser, browser.evaluate("report.end"), "[line.visible, far(robots[0], 0), far(robots[1], 1)]"
    )
    assert visible and max(arm, person) < NEAR


def test_the_line_is_the_distance_and_two_radii(browser: Browser) -> None:
    end = browser.evaluate("report.end")
    text, ends = at(browser, end, "[document.getElementById('distance').textContent, [...ends]]")
    length = np.linalg.norm(np.subtract(ends[:3], ends[3:]))
    assert 0.0 < length - float(text.split(" m")[0]) < RADII


def test_the_line_is_drawn(browser: Browser) -> None:
    at(browser, browser.evaluate("report.end"), "null")
    assert drawn(browser, "separation") > 20
