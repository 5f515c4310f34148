"""Control of a running simulation from the window in a browser."""

import json
import math
import re
import time
from collections.abc import Iterator

import pytest
from browser import Browser, installed
from live_system import LiveSystem
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

pytestmark = [
    pytest.mark.alone,
    pytest.mark.live,  # a browser that draws in software takes the processors that others need
    pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it"),
]
JOINT1 = "report.replay.robots[0].position.at(-report.replay.robots[0].columns)"
"""Last position of the first joint [rad]."""
ON_THE_ARM = """
const canvas = document.querySelector("#view canvas").getBoundingClientRect(), { robots, camera } = report.replay;
const mesh = robots[0].links.get("panda_link5").children.find((child) => child.isMesh);
const at = new THREE.Box3().setFromObject(mesh).getCenter(new THREE.Vector3()).project(camera);
return [canvas.left + (canvas.width * (at.x + 1)) / 2, canvas.top + (canvas.height * (1 - at.y)) / 2];
"""
"""Returns a place of the screen at which the forearm is drawn."""
HEIGHT = (
    "(report.replay.scene.updateMatrixWorld(true), "
    "report.replay.robots[0].links.get('panda_hand').getWorldPosition(new THREE.Vector3()).z)"
)
"""Height of the hand [m]."""
ON_THE_HANDLE = """
const canvas = document.querySelector("#view canvas").getBoundingClientRect(), { scene, camera } = report.replay;
let arrow = null;
scene.traverse((object) => { if (object.userData.axis === 2 && !object.userData.turns) arrow = object; });
return [0.7, 1.2].map((length) => arrow.localToWorld(new THREE.Vector3(0, length, 0)).project(camera)).map(
  (at) => [canvas.left + (canvas.width * (at.x + 1)) / 2, canvas.top + (canvas.height * (1 - at.y)) / 2]);
"""
"""Returns two places of the screen on the arrow of the end effector's z axis, which points downwards."""
BAD = ["", "[]", "{", '{"command":"rm"}', '{"command":"pause","x":1}', "NaN", '{"command":"step","cycles":1e9}x', b"\0"]


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveSystem]:
    """Bring-up of the arm whose window takes commands."""
    folder = tmp_path_factory.mktemp("controlled")
    made = LiveSystem(folder, "env:=sim", "rviz:=false", "view:=web", "control:=true", "record:=false")
    made.wait_output("  see it ")
    yield made
    made.close()


@pytest.fixture(scope="module")
def address(system: LiveSystem) -> str:
    match = re.search(r"see it +(\S+)", system.output)
    assert match is not None
    return match[1]


@pytest.fixture(scope="module")
def opened(address: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Page on the screen of a phone."""
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.call("Emulation.setDeviceMetricsOverride", width=390, height=844, deviceScaleFactor=1, mobile=True)
        browser.open_address(address)
        browser.wait("report.started === true")
        browser.wait("document.querySelector('#controllers li') !== null")
        browser.wait(f"Number.isFinite({JOINT1})")
        yield browser


@pytest.fixture
def page(opened: Browser) -> Iterator[Browser]:
    """Page that has control."""
    if opened.evaluate("document.getElementById('commands').disabled"):
        click(opened, "take")
        opened.wait("!document.getElementById('commands').disabled")
    yield opened
    opened.evaluate("document.querySelectorAll('#commands input:checked').forEach((box) => box.click())")
    assert opened.problems == [] and opened.requests == []


def click(browser: Browser, name: str) -> None:
    """Press a button by its id with the keyboard."""
    browser.evaluate(f"document.getElementById('{name}').focus()")
    for kind in ("keyDown", "keyUp"):
        browser.call(
            "Input.dispatchKeyEvent",
            type=kind,
            key="Enter",
            code="Enter",
            windowsVirtualKeyCode=13,
            **({"text": "\r"} if kind == "keyDown" else {}),
        )


def move_slider(browser: Browser, position: float) -> None:
    """Move the slider of the first joint [rad]."""
    browser.evaluate(
        f"(() => {{ const slider = document.querySelector('#joints input'); slider.value = {position}; "
        "slider.dispatchEvent(new Event('input')); slider.dispatchEvent(new Event('change')); })()"
    )


def viewer(address: str) -> ClientConnection:
    origin, _, query = address.partition("/?")
    return connect(f"{origin.replace('http', 'ws')}/socket?{query}", origin=Origin(origin), close_timeout=0.1)


def told(client: ClientConnection, kind: str) -> dict[str, object]:
    """Return the next message of a kind."""
    while True:
        message: dict[str, object] = json.loads(client.recv(20))
        if message["type"] == kind:
            return message


def test_a_slider_moves_the_arm(page: Browser) -> None:
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    for position in (0.4, 0.0):
        move_slider(page, position)
        page.wait(f"Math.abs({JOINT1} - {position}) < 0.01", 30.0)


def test_a_button_moves_the_end_effector_upwards(page: Browser) -> None:
    before = page.evaluate(HEIGHT)
    page.evaluate("document.querySelector('[aria-label=\"end effector plus z\"]').id = 'up'")
    click(page, "up")
    page.wait(f"Math.abs({HEIGHT} - {before} - 0.02) < 0.004", 30.0)


def test_time_stands_still_until_it_is_stepped(page: Browser) -> None:
    click(page, "pause")
    page.wait("document.getElementById('stands').textContent.includes('stands still')")
    before = page.evaluate("report.end")
    click(page, "step")
    page.wait(f"Math.abs(report.end - {before} - 0.1) < 0.02")
    time.sleep(0.5)
    assert page.evaluate("report.end") == pytest.approx(before + 0.1, abs=0.02)
    click(page, "proceed")
    page.wait(f"report.end > {before} + 0.5")


def test_a_step_of_running_time_is_refused(page: Browser) -> None:
    click(page, "step")
    page.wait("document.getElementById('link').textContent.startsWith('Refused')")


def test_a_pull_with_the_mouse_pushes_the_link(page: Browser) -> None:
    page.evaluate("document.getElementById('pushing').click()")
    page.evaluate("document.getElementById('view').scrollIntoView()")
    place = page.evaluate(f"(() => {{ {ON_THE_ARM} }})()")
    before = page.evaluate(JOINT1)
    mouse(page, "mousePressed", *place)
    for step in range(1, 5):  # gently, so that the arm does not protect itself
        mouse(page, "mouseMoved", place[0] + 6 * step, place[1])
        time.sleep(0.3)
    assert 2.0 < float(page.evaluate("document.getElementById('push-text').textContent").split()[0]) <= 50.0
    page.wait(f"Math.abs({JOINT1} - {before}) > 0.01", 30.0)
    mouse(page, "mouseReleased", place[0] + 24, place[1])
    page.wait(f"Math.abs({JOINT1} - {before}) < 0.01", 30.0)  # the controller brings it back


def mouse(browser: Browser, kind: str, x: float, y: float) -> None:
    pressed = 0 if kind == "mouseReleased" else 1
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=pressed, clickCount=1)


def test_the_speed_of_the_running_simulation_is_changed(page: Browser) -> None:
    achieved = "Number(document.getElementById('pace-now').textContent.split(' ').at(-4))"
    for factor in (0.25, 1):
        page.evaluate(
            f"(() => {{ const list = document.getElementById('pace'); list.value = '{factor}'; "
            "list.dispatchEvent(new Event('change')); })()"
        )
        page.wait(f"document.getElementById('pace-now').textContent.startsWith('{factor} x')")
        page.wait(f"Math.abs({achieved} - {factor}) < 0.1", 30.0)
        assert page.evaluate("document.getElementById('pace').value") == str(factor)


def drag_upwards(page: Browser, pixels: int) -> None:
    """Press on the arrow of the end effector's z axis, and pull against its direction."""
    page.evaluate("document.getElementById('view').scrollIntoView()")
    page.wait("document.getElementById('link').textContent === ''")
    (x, y), (x_tip, y_tip) = page.evaluate(f"(() => {{ {ON_THE_HANDLE} }})()")
    far = math.hypot(x_tip - x, y_tip - y)
    mouse(page, "mousePressed", x, y)
    for step in range(1, pixels + 1, 3):
        mouse(page, "mouseMoved", x - step * (x_tip - x) / far, y - step * (y_tip - y) / far)


def test_the_handle_drags_the_end_effector_until_control_is_lost(page: Browser) -> None:
    page.evaluate("document.getElementById('dragging').click()")
    page.evaluate("report.jogs = 0")
    page.evaluate(
        "(() => { const send = report.send; report.send = (message) => "
        "{ report.jogs += message.command === 'jog'; return send(message); }; })()"
    )
    before = page.evaluate(HEIGHT)
    drag_upwards(page, 12)
    page.wait(f"{HEIGHT} - {before} > 0.01", 30.0)
    mouse(page, "mouseReleased", 10, 10)
    drag_upwards(page, 120)
    page.evaluate("document.getElementById('take').click()")
    page.wait("document.getElementById('commands').disabled")
    sent = page.evaluate("report.jogs")
    time.sleep(0.5)
    assert 0 < page.evaluate("report.jogs") == sent
    mouse(page, "mouseReleased", 10, 10)


def test_steps_of_a_soft_controller_do_not_add_up_its_sag(page: Browser, system: LiveSystem) -> None:
    name = "cartesian_impedance_controller"
    system.run("rosservice", "call", "/controller_manager/load_controller", name)
    for start in (name, "joint_pd_controller"):
        label = f'[aria-label="start {start}"]'
        page.wait(f"document.querySelector('{label}') !== null")
        page.evaluate(f"document.querySelector('{label}').click()")
        page.wait(f"document.querySelector('{label.replace('start ', 'stop ')}') !== null")
        if start == name:
            move_sagging_arm(page, system)


def move_sagging_arm(page: Browser, system: LiveSystem) -> None:
    """Move an arm sidewards that is pulled down; check its height."""
    settled = (
        "(() => { const now = " + HEIGHT + ", before = report.before; report.before = now; "
        "return Math.abs(now - before) < 2e-4; })()"
    )
    start = page.evaluate(HEIGHT)
    pull = "{body_name: panda_link7, wrench: {force: {z: -10}}, duration: {secs: -1}}"
    system.run("rosservice", "call", "/sim/apply_body_wrench", pull)
    page.wait(f"{start} - {HEIGHT} > 0.02", 30.0)
    heights = []
    for _ in range(6):
        page.evaluate("document.querySelector('[aria-label=\"end effector plus y\"]').click()")
        time.sleep(1.0)
        page.wait(settled, 30.0)
        heights.append(page.evaluate(HEIGHT))
    system.run("rosservice", "call", "/sim/clear_body_wrenches", "body_name: ''")
    assert heights[-1] == pytest.approx(heights[0], abs=0.3 * (start - heights[0]))


def test_only_controls_of_what_there_is_are_shown(page: Browser) -> None:
    page.wait("!document.querySelector('.of-gripper').hidden && !document.querySelector('.of-franka').hidden")


def test_a_pressed_user_stop_holds_the_arm_until_recovery(page: Browser) -> None:
    page.wait("document.getElementById('user_stop').textContent === 'press the user stop'")
    click(page, "user_stop")
    page.wait("document.getElementById('mode').textContent === 'user stopped'")
    page.wait("document.getElementById('user_stop').textContent === 'release the user stop'")
    before = page.evaluate(JOINT1)
    move_slider(page, before + 0.2)
    time.sleep(1.0)
    assert page.evaluate(JOINT1) == pytest.approx(before, abs=1e-3)
    click(page, "user_stop")
    page.wait("document.getElementById('mode').textContent === 'idle'")
    click(page, "recover")
    page.wait("document.getElementById('mode').textContent === 'move'")


def test_guiding_is_refused_during_a_motion(page: Browser) -> None:
    click(page, "guiding")
    page.wait("document.getElementById('link').textContent.startsWith('Refused: guiding')")


def test_a_second_viewer_sees_and_is_refused(page: Browser, address: str) -> None:
    with viewer(address) as second:
        assert json.loads(second.recv(20))["type"] == "scene"
        second.send('{"command":"take","name":"Bob"}')
        assert "somebody (127.0.0.1:" in str(told(second, "refused")["text"])
        second.send('{"command":"reset"}')
        assert "controls this robot" in str(told(second, "refused")["text"])
        assert told(second, "frame")["t"] is not None
    move_slider(page, 0.1)
    page.wait(f"Math.abs({JOINT1} - 0.1) < 0.01", 30.0)


def test_bad_messages_end_their_connection_only(page: Browser, address: str) -> None:
    for number in range(20):
        with viewer(address) as bad, pytest.raises(ConnectionClosed):
            bad.recv(20)
            bad.send(BAD[number % len(BAD)])
            for _ in range(200):
                bad.recv(20)
    move_slider(page, 0.2)
    page.wait(f"Math.abs({JOINT1} - 0.2) < 0.01", 30.0)
