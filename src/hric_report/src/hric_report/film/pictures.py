"""Pictures of a run at any robot time, drawn by the replay of its report in headless Chromium."""

import base64
import contextlib
import io
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from hric_bags.run_folder import RunFolderError
from hric_report.film.browser import Browser
from hric_report.html.page import Page, render_page
from hric_report.html.run_data import RunData
from hric_report.html.run_page import robots


@dataclass(frozen=True)
class FilmView:
    """Size of pictures, and direction of the camera.

    Attributes:
        width, height: size [px].
        azimuth: direction from the scene to the camera, from the world's x axis towards its y axis [rad].
        elevation: elevation of this direction above the ground [rad].
    """

    width: int = 1280
    height: int = 720
    azimuth: float = 0.9
    elevation: float = 0.3


class Pictures:
    """Replay of a run in a browser, which draws pictures.

    Attributes:
        begin, end: robot time at which the replay begins and ends [s].
    """

    def __init__(self, browser: Browser) -> None:
        self._browser = browser
        browser.wait("report.ready")
        self.begin, self.end = (float(time) for time in browser.evaluate("[report.begin, report.end]"))

    def prepare(self, view: FilmView, begin: float, end: float) -> None:
        """Set size and direction of the pictures, so that the camera sees all motions between two robot times.

        Args:
            view: size and direction.
            begin: earlier robot time [s].
            end: later robot time [s].
        """
        content = {"begin": begin, "end": end, **vars(view)}
        self._browser.evaluate(f"report.replay.film({json.dumps(content)})")

    def draw(self, time: float) -> Image.Image:
        """Return the picture at a robot time [s]."""
        png = base64.b64decode(self._browser.evaluate(f"report.replay.picture({time!r})"))
        return Image.open(io.BytesIO(png)).convert("RGB")


@contextlib.contextmanager
def opened(data: RunData) -> Iterator[Pictures]:
    """Open the replay of a run in a browser; it is closed at the end of the block.

    Raises:
        HricError: Chromium is not installed or fails, or the run folder has no description of the robot.
    """
    name = data.folder.path.name
    if not (shown := robots(data, [])):
        raise RunFolderError(f"{data.folder.path} has no robot.urdf, so the robot cannot be drawn")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = Path(folder) / "page.html"
        page.write_text(render_page(Page(title=name, subtitle="", robots=shown)))
        with Browser(Path(folder) / "profile") as browser:
            browser.open(page)
            yield Pictures(browser)
