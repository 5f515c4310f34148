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
    """Part of the window in addition to the robots, e.g. forces or curves, which a script of the page draws.

    The part adds its own keys to the first message of a viewer (the scene) and to each frame. Both methods are called
    in other threads than those that receive the data.
    """

    def scene(self) -> Mapping[str, object]:
        """Return the data that each new viewer gets once, as values that JSON can represent, without NaN."""

    def frame(self) -> Mapping[str, object]:
        """Return the newest data for a frame, as values that JSON can represent, without NaN; empty: nothing new."""


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
    """Return the HTML page that shows a scene.

    Args:
        title: title of the page.
        visit: request of the viewer.
        control: True: the page can send commands to a running system.
        live: True: the page shows a running system; False: recorded runs.
        links: text and address of each link to another page.
        waiting: text that is shown until the scene has arrived.
        sliders: conditions of a run that the viewer can change (tryout.Slider as mapping); empty: none.

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
        parts: other parts of the window, which add their keys.
        notes: remarks that the page shows.
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
    """Return a message with the newest joint positions of all robots and the newest data of all parts, as JSON."""
    times = [robot.time for robot in robots if not math.isnan(robot.time)]
    others = {name: value for part in parts for name, value in part.frame().items()}
    return _text(
        {"type": "frame", "t": max(times, default=None), "robots": [robot.state() for robot in robots], **others}
    )


def _text(message: Mapping[str, Any]) -> str:
    return json.dumps(message, allow_nan=False, separators=(",", ":"))
