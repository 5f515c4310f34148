"""One viewer at a time controls a window, and only valid commands reach the system."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, installed

from hric_core.errors import HricError
from hric_report.html.scene import SceneRobot
from hric_view import page
from hric_view.control import MAX_PUSH, Controls
from hric_view.live import LiveJoints
from hric_view.server import ForeignMessageError, ViewServer, Visit, WebPage

LIMITS = {"joint1": (-1.0, 2.0), "joint2": (0.0, 1.0)}
ARM = '<robot name="arm"><link name="base"/></robot>'


class Noted:
    """Actions that note what they are asked to do."""

    def __init__(self) -> None:
        self.done: list[object] = []
        self.mode = "move"

    def __getattr__(self, name: str) -> Any:
        return lambda *values: self.done.append((name, *values))

    def summary(self) -> Mapping[str, object]:
        """Return the state of an arm."""
        state = {"simulated": True, "stands": False, "gripper": False, "recovery": True, "emulated": True}
        return {**state, "controllers": [], "mode": self.mode}


class ShownArm:
    """Window with the controls of an arm."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls

    def page(self, visit: Visit) -> WebPage | None:
        """Return the page."""
        return page.render("live", visit, control=True, live=True)

    def scene(self, visit: Visit) -> str:
        """Return the scene."""
        return page.scene_message([SceneRobot("", ARM, (), np.zeros(1), np.zeros((1, 0)))], [self._controls], live=True)


class Person:
    """Viewer with a name who keeps what they are told."""

    def __init__(self, name: str) -> None:
        self.name, self.told = name, list[object]()

    def tell(self, message: Mapping[str, object]) -> None:
        """Keep a message."""
        self.told.append(message)


@pytest.fixture
def actions() -> Noted:
    return Noted()


@pytest.fixture
def controls(actions: Noted) -> Controls:
    return Controls(actions, LIMITS, ["link0", "hand"])


@pytest.fixture
def anna(controls: Controls) -> Person:
    """Viewer who has taken control."""
    person = Person("127.0.0.1:1")
    controls.receive(person, {"command": "take", "name": "Anna"})  # type: ignore[arg-type]
    return person


VALID: Sequence[tuple[dict[str, Any], tuple[object, ...]]] = [
    ({"command": "pause"}, ("pause",)),
    ({"command": "proceed"}, ("proceed",)),
    ({"command": "step", "cycles": 100}, ("step", 100)),
    ({"command": "reset"}, ("reset",)),
    ({"command": "recover"}, ("recover",)),
    ({"command": "pace", "factor": 0.5}, ("set_pace", 0.5)),
    ({"command": "grip", "width": 0.04}, ("grip", 0.04)),
    ({"command": "switch", "start": "a", "stop": ["b"]}, ("switch", "a", ["b"])),
    ({"command": "joints", "positions": {"joint1": 2}}, ("move_joints", {"joint1": 2})),
    ({"command": "jog", "displacement": [0.02, 0, 0, 0, 0, -0.1]}, ("jog", [0.02, 0, 0, 0, 0, -0.1])),
    (
        {"command": "push", "link": "hand", "point": [0, 0, 0.1], "force": [0, 30.0, -40.0]},
        ("push", "hand", [0, 0, 0.1], [0, 30.0, -40.0]),
    ),
    ({"command": "press", "button": "guiding", "pressed": True}, ("press", "guiding", True)),
]
IDS = [str(message["command"]) for message, _ in VALID]


@pytest.mark.parametrize(("message", "expected"), VALID, ids=IDS)
def test_a_command_reaches_the_system(
    controls: Controls, actions: Noted, anna: Person, message: dict[str, Any], expected: tuple[object, ...]
) -> None:
    controls.receive(anna, message)  # type: ignore[arg-type]
    assert actions.done == [("begin",), expected]


@pytest.mark.parametrize("message", [message for message, _ in VALID], ids=IDS)
def test_a_second_controller_is_refused_by_name(
    controls: Controls, actions: Noted, anna: Person, message: dict[str, Any]
) -> None:
    second = Person("127.0.0.1:2")
    for refused in (message, {"command": "take", "name": "Bob"}):
        with pytest.raises(HricError, match=r"Anna \(127.0.0.1:1\) controls this robot") as error:
            controls.receive(second, refused)  # type: ignore[arg-type]
        assert not isinstance(error.value, ForeignMessageError)
    assert actions.done == [("begin",)]


@pytest.mark.parametrize("leave", ["leave", "release"])
def test_after_the_first_left_another_controls(controls: Controls, actions: Noted, anna: Person, leave: str) -> None:
    second = Person("127.0.0.1:2")
    if leave == "leave":
        controls.leave(anna)  # type: ignore[arg-type]
    else:
        controls.receive(anna, {"command": "release"})  # type: ignore[arg-type]
    controls.receive(second, {"command": "take", "name": ""})  # type: ignore[arg-type]
    controls.receive(second, {"command": "pause"})  # type: ignore[arg-type]
    assert actions.done == [("begin",), ("begin",), ("pause",)] and "127.0.0.1:2" in controls.holder
    assert second.told == [{"type": "control", "held": True}] and anna.told[-1] == {"type": "control", "held": False}


@pytest.mark.parametrize(
    ("message", "text"),
    [
        ({"command": "joints", "positions": {"joint1": 2.1}}, "valid: -1.000 to 2.000"),
        ({"command": "joints", "positions": {"joint9": 0}}, "valid: joint1, joint2"),
        ({"command": "jog", "displacement": [0.06, 0, 0, 0, 0, 0]}, "valid: up to 0.05 m"),
        ({"command": "push", "link": "hand", "point": [0, 0, 0], "force": [MAX_PUSH, 1, 0]}, "valid: up to 50 N"),
        ({"command": "push", "link": "world", "point": [0, 0, 0], "force": [1, 1, 0]}, "valid: hand, link0"),
        ({"command": "grip", "width": 0.2}, "valid: 0 to 0.08"),
        ({"command": "press", "button": "brake", "pressed": True}, "valid: guiding, user_stop"),
        ({"command": "step", "cycles": 100000}, "valid: 1 to 1000"),
    ],
)
def test_what_is_impossible_is_refused_with_the_valid_values(
    controls: Controls, actions: Noted, anna: Person, message: dict[str, Any], text: str
) -> None:
    with pytest.raises(HricError, match=text) as error:
        controls.receive(anna, message)  # type: ignore[arg-type]
    assert not isinstance(error.value, ForeignMessageError) and actions.done == [("begin",)]


@pytest.mark.parametrize(
    "message",
    [
        {},
        {"command": "rm"},
        {"command": ["pause"]},
        {"command": "pause", "more": 1},
        {"command": "step"},
        {"command": "step", "cycles": 1.5},
        {"command": "step", "cycles": True},
        {"command": "pace", "factor": "fast"},
        {"command": "grip", "width": "0.02"},
        {"command": "switch", "start": "a", "stop": "b"},
        {"command": "switch", "start": None, "stop": []},
        {"command": "joints", "positions": {}},
        {"command": "joints", "positions": [0, 0]},
        {"command": "joints", "positions": {"joint1": None}},
        {"command": "jog", "displacement": [0, 0, 0]},
        {"command": "push", "link": "hand", "point": [0, 0, 0], "force": [0, 0, "1"]},
        {"command": "press", "button": "user_stop", "pressed": 1},
        {"command": "take"},
        {"command": "take", "name": 3},
    ],
    ids=str,
)
def test_a_message_of_no_page_is_bad(controls: Controls, actions: Noted, anna: Person, message: dict[str, Any]) -> None:
    with pytest.raises(ForeignMessageError):
        controls.receive(anna, message)  # type: ignore[arg-type]
    assert actions.done == [("begin",)]


@pytest.mark.slow
@pytest.mark.skipif(not installed(), reason="no chromium; scripts/setup --with checks installs it")
def test_only_an_arm_with_an_error_can_recover(controls: Controls, actions: Noted, tmp_path: Path) -> None:
    server, joints = ViewServer(ShownArm(controls), receiver=controls), LiveJoints(())
    with Browser(tmp_path) as browser:
        browser.open_address(server.address)
        browser.wait("report.live === true")
        for actions.mode, disabled in (("move", "true"), ("reflex", "false"), ("idle", "false"), ("move", "true")):
            frame = {**json.loads(page.frame_message([joints])), "control": {"holder": "", **actions.summary()}}
            server.send(json.dumps(frame))
            browser.wait(f"document.getElementById('mode').textContent === '{actions.mode}'")
            assert browser.evaluate(f"document.getElementById('recover').disabled === {disabled}")
        assert browser.problems == []
    server.close()
