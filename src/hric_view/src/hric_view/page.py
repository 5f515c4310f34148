"""Page of the window, and the messages of its WebSocket: the scene and its frames."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hric_report.html import libraries, templates
from hric_report.html.scene import Blob, PageScene, SceneRobot
from hric_view.live import Force, LiveJoints

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


def frame(robots: Sequence[LiveJoints], forces: Sequence[Force]) -> str:
    """Return the frame of the newest states: JSON without NaN."""
    times = [robot.time for robot in robots if not math.isnan(robot.time)]
    content: dict[str, Any] = {"t": max(times, default=None), "robots": [robot.state() for robot in robots]}
    if forces:
        content["forces"] = [
            {"name": name, "point": [round(v, 4) for v in point], "force": [round(v, 2) for v in force]}
            for name, point, force in forces
        ]
    return json.dumps(content, allow_nan=False, separators=(",", ":"))
