"""Virtual display for rviz, and functions to check its content."""

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib.image
import numpy as np
import numpy.typing as npt

SIZE = (1300, 800)
STILL = 2000
"""Number of pixels that may differ between two pictures of an arm at rest, due to clocks in the window."""


@contextmanager
def virtual_display(log: Path) -> Iterator[str]:
    """Start an X server without a screen, and yield its DISPLAY."""
    read, write = os.pipe()
    width, height = SIZE
    command = [
        "Xvfb",
        "-displayfd",
        str(write),
        "-screen",
        "0",
        f"{width}x{height}x24",
        "+extension",
        "GLX",
        "-nolisten",
        "tcp",
    ]
    with log.open("w") as output:
        server = subprocess.Popen(command, pass_fds=[write], stdout=output, stderr=subprocess.STDOUT)
    os.close(write)
    try:
        number = os.read(read, 16).decode().strip()
        assert number, f"Xvfb did not start: {log.read_text()}"
        yield f":{number}"
    finally:
        os.close(read)
        server.terminate()
        server.wait(timeout=10.0)


def environment(display: str) -> dict[str, str]:
    """Return the environment variables for software rendering on a virtual display."""
    return {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1", "LANG": "C.UTF-8"}


def shot(display: str, path: Path) -> npt.NDArray[np.float64]:
    """Save a screenshot of the display, and return it, shape (height, width, 3), values 0 to 1."""
    subprocess.run(
        ["import", "-window", "root", "-display", display, f"PNG24:{path}"],
        check=True,
        timeout=30.0,
        capture_output=True,
    )
    picture: npt.NDArray[np.float64] = matplotlib.image.imread(path)[..., :3].astype(float)
    return picture


def wait_for_picture(display: str, path: Path, timeout: float, died: Callable[[], bool]) -> npt.NDArray[np.float64]:
    """Wait until the arm is drawn and the window does not change, and return the picture.

    The arm is drawn if many pixels are much brighter or darker than the background around them.

    Raises:
        AssertionError: the arm was not drawn within `timeout` [s], or `died` returned True.
    """
    deadline = time.monotonic() + timeout
    before = shot(display, path)
    while True:
        time.sleep(1.0)
        picture = shot(display, path)
        if arm_pixels(picture) > 5000 and changed_pixels(before, picture) < STILL:
            return picture
        assert not died(), "what draws the arm died"
        assert time.monotonic() < deadline, f"no arm on the display after {timeout:g} s; see {path}"
        before = picture


def arm_pixels(picture: npt.NDArray[np.float64]) -> int:
    """Return the number of pixels in the middle of the picture that are clearly not background."""
    height, width, _ = picture.shape
    middle = picture[height // 5 : -height // 5, width // 4 : -width // 4].mean(axis=2)
    return int(np.sum(np.abs(middle - np.median(middle)) > 0.08))


def changed_pixels(first: npt.NDArray[np.float64], second: npt.NDArray[np.float64]) -> int:
    """Return the number of pixels that differ clearly between two pictures."""
    return int(np.sum(np.abs(first - second).max(axis=2) > 0.1))
