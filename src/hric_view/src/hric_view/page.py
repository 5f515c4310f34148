"""Page of the window, and the message with its scene."""

import json
from collections.abc import Sequence
from pathlib import Path

from hric_report.html import libraries, templates
from hric_report.html.scene import Blob, PageScene, SceneRobot

ASSETS = Path(__file__).parent / "assets"


def render(title: str, socket: str) -> str:
    """Return the page.

    Args:
        title: what is seen.
        socket: address of the WebSocket, without its path.

    Raises:
        HricError: a library of the page is not installed.
    """
    template = templates.environment(ASSETS).get_template("view.html")
    return template.render(title=title, connect=socket, libraries=(libraries.three(),))


def scene_message(robots: Sequence[SceneRobot]) -> str:
    """Return the first message of a viewer: the robots and persons, with their meshes.

    Raises:
        DescriptionError: a description cannot be read.
    """
    blob = Blob()
    scene = PageScene(blob)
    for robot in robots:
        scene.add(robot)
    data = {"scene": scene.data(), "notes": scene.notes}
    return json.dumps({"data": data, "numbers": blob.text()}, allow_nan=False, separators=(",", ":"))
