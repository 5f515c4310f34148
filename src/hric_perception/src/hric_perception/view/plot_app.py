"""Node `live_plot`: a window with the curves of the last seconds, or a picture of it."""

import argparse
import signal
import threading
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import rospy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from hric_core.command import Argument, Command
from hric_core.errors import HricError, UnknownNameError
from hric_core.processes import run_command
from hric_core.ros import shut_down
from hric_core.ros.process import check_private
from hric_msgs.msg import SampleChunk
from hric_perception.view import curves
from hric_perception.view.curves import History, Panel, Picture

SIZE = (9.0, 2.2)
"""Width of the picture, height of a panel [inch]."""
REFRESH = 200
"""Time between pictures in the window [ms]."""
DEFAULT = ("positions", "velocities", "efforts", "wrench")
TYPES: dict[str, type] = {
    "joints": JointState,
    "wrench": WrenchStamped,
    "arm_wrench": WrenchStamped,
    "emg": SampleChunk,
}
"""Message type by the last word of a topic."""


class PlotError(HricError):
    """Error of a window that cannot be opened, or a picture that cannot be saved."""


class LivePlotCommand(Command):
    """Show a window with the curves of the last seconds: joints, forces, EMG; what live_view sends. Without a display:
    a picture of it."""

    is_node = True

    def arguments(self) -> list[Argument]:
        """Return the arguments."""
        return [
            Argument(
                "panels",
                nargs="*",
                metavar="PANEL",
                help=f"of {', '.join(curves.panels())}, from top to bottom (default: {' '.join(DEFAULT)})",
                complete=curves.panels,
            ),
            Argument("--plate", default="1", metavar="ID", help="name of the force plate (default: 1)"),
            Argument(
                "--screenshot", type=Path, metavar="FILE", help="no window: save a picture, .png, .svg or .pdf, and end"
            ),
            Argument(
                "--after",
                type=float,
                default=curves.WINDOW,
                metavar="SECONDS",
                help="save the picture so much later (default: %(default)g)",
            ),
        ]

    def run(self, given: argparse.Namespace) -> int:
        """Show until the window is closed or Ctrl-C."""
        check_private("live_plot")
        return run_command("hric live_plot", lambda: _show(given), interrupted=0)


def _show(given: argparse.Namespace) -> None:
    known = curves.panels(given.plate)
    for name in given.panels:
        if name not in known:
            raise UnknownNameError("panel", name, known)
    if given.screenshot and given.screenshot.suffix not in (".png", ".svg", ".pdf"):
        raise PlotError(f"--screenshot {given.screenshot}: no kind of picture; valid: .png, .svg, .pdf")
    shown = [known[name] for name in given.panels or DEFAULT]
    shutdown = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: shutdown.set())
    show = _window() if given.screenshot is None else None
    rospy.init_node("live_plot", anonymous=True, disable_signals=True)
    rospy.on_shutdown(shutdown.set)
    histories = {panel.title: _listen(panel) for panel in shown}
    try:
        if show is not None:
            show(shown, histories, shutdown)
        else:
            _save(given.screenshot, given.after, shown, histories, shutdown)
    finally:
        shut_down("shutdown requested")


def _listen(panel: Panel) -> History:
    history = History()

    def on_message(message: Any) -> None:
        history.add(message.header.stamp.to_sec(), panel.read(message))

    rospy.Subscriber(panel.topic, TYPES[panel.topic.rpartition("/")[2]], on_message, queue_size=100)
    return history


def _save(
    path: Path, after: float, shown: Sequence[Panel], histories: dict[str, History], shutdown: threading.Event
) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    end = time.monotonic() + after
    while not shutdown.is_set() and time.monotonic() < end:
        shutdown.wait(0.1)
    figure = _figure(len(shown))
    FigureCanvasAgg(figure)
    Picture(figure, shown, histories).update()
    try:
        figure.savefig(path, dpi=100)
    except (OSError, ValueError) as error:
        raise PlotError(f"cannot save {path}: {error}") from error


def _window() -> Any:
    """Return a function that shows panels until the window is closed.

    It is made before ROS begins, so that a missing display is an error at once.
    """
    try:
        import tkinter

        root = tkinter.Tk(className="live_plot")
    except ImportError as error:
        raise PlotError(
            "a window needs the Debian package python3-tk (scripts/setup --gui); without it: --screenshot FILE"
        ) from error
    except tkinter.TclError as error:
        raise PlotError(f"no window: {error}; without a display: --screenshot FILE") from error
    root.title("live_plot")
    return partial(_run_window, root)


def _run_window(root: Any, shown: Sequence[Panel], histories: dict[str, History], shutdown: threading.Event) -> None:
    from matplotlib.backends.backend_tkagg import FigureCanvasTkAgg

    figure = _figure(len(shown))
    canvas = FigureCanvasTkAgg(figure, master=root)
    canvas.get_tk_widget().pack(fill="both", expand=True)
    width, height = (round(figure.dpi * inches) for inches in figure.get_size_inches())
    root.geometry(f"{width}x{min(height, round(0.9 * root.winfo_screenheight()))}")
    picture = Picture(figure, shown, histories)

    def refresh() -> None:
        if shutdown.is_set():
            root.destroy()
            return
        picture.update()
        canvas.draw_idle()
        root.after(REFRESH, refresh)

    refresh()
    root.mainloop()


def _figure(panels: int) -> Any:
    from matplotlib.figure import Figure  # slow to load, which a wrong word need not wait for

    return Figure(figsize=(SIZE[0], SIZE[1] * panels), layout="constrained")
