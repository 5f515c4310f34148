"""Page of the window, and the messages of its WebSocket: the scene and its frames."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from hric_report.html import libraries, templates
from hric_report.html.scene import Blob, PageScene, SceneRobot
from hric_view.live import LiveJoints
from hric_view.server import HTML, Visit, WebPage

ASSETS = Path(__file__).parent / "assets"


class Part(Protocol):
    """Part of the window besides the robots, e.g. forces or curves; a script of the page draws it.

    The part contributes keys of its own to the scene and to each frame. Both methods are called in other threads than
    those that receive the data.
    """

    def scene(self) -> Mapping[str, object]:
        """Return what a new viewer needs to know, once: plain values without NaN."""

    def frame(self) -> Mapping[str, object]:
        """Return the newest data: plain values without NaN."""


def render(
    title: str,
    visit: Visit,
    *,
    control: bool = False,
    live: bool = False,
    links: Sequence[tuple[str, str]] = (),
    waiting: str = "connecting",
    sliders: Sequence[Mapping[str, object]] = (),
) -> WebPage:
    """Return the page.

    Args:
        title: name of what is shown.
        visit: request of the viewer.
        control: True: the page has the controls.
        live: True: the page has the parts of a running system.
        links: texts and addresses of links to other pages.
        waiting: text until the scene is there.
        sliders: conditions of a run that can be chosen; empty: none.

    Raises:
        HricError: a library of the page is not installed.
    """
    template = templates.environment(ASSETS).get_template("view.html")
    text = template.render(
        title=title,
        connect=visit.socket,
        control=control,
        live=live,
        links=links,
        waiting=waiting,
        sliders=sliders,
        libraries=(libraries.three(),),
    )
    return WebPage(HTML, text.encode())


def scene_message(
    robots: Sequence[SceneRobot], parts: Sequence[Part] = (), *, notes: Sequence[str] = (), live: bool
) -> str:
    """Return the first message of a viewer: the robots and persons, with their meshes and motions.

    Args:
        robots: robots and persons.
        parts: other parts of the window.
        notes: remarks for the viewer.
        live: True if frames follow; False: the motions of the robots are those of a recorded run.

    Raises:
        DescriptionError: a description cannot be read.
    """
    blob = Blob()
    scene = PageScene(blob)
    for robot in robots:
        scene.add(robot)
    others = {name: value for part in parts for name, value in part.scene().items()}
    return _text(
        {
            "type": "scene",
            "live": live,
            "data": {"scene": scene.data(), "notes": list(dict.fromkeys([*notes, *scene.notes]))},
            "numbers": blob.text(),
            **others,
        }
    )


def frame_message(robots: Sequence[LiveJoints], parts: Sequence[Part] = ()) -> str:
    """Return the frame of the newest states."""
    times = [robot.time for robot in robots if not math.isnan(robot.time)]
    others = {name: value for part in parts for name, value in part.frame().items()}
    return _text(
        {"type": "frame", "t": max(times, default=None), "robots": [robot.state() for robot in robots], **others}
    )


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False, separators=(",", ":"))
