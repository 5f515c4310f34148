"""Command `hric live_plot`: a window with curves of the last seconds of a run, or a picture of these."""

import argparse
import signal
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import rospy

from hric_core.command import Argument, Command
from hric_core.errors import HricError, UnknownNameError
from hric_core.processes import run_command
from hric_core.ros import shut_down
from hric_core.ros.process import check_private
from hric_perception.view import curves
from hric_perception.view.curves import CurvePanel, SampleHistory, draw

SIZE = (9.0, 2.2)
"""Width of the picture, and height of one panel [inch]."""
REFRESH = 200
"""Time between updates of the window [ms]."""
DEFAULT = ("positions", "velocities", "efforts", "wrench")


class PlotError(HricError):
    """Error of a window that cannot be opened, or a picture that cannot be saved."""


class LivePlotCommand(Command):
    """Show a window with curves of the last seconds: joints, forces and EMG, as published by live_view.

    On a machine without a display, --screenshot saves a picture of the curves.
    """

    is_node = True

    def arguments(self) -> list[Argument]:
        """Return the command-line arguments of `hric live_plot`."""
        return [
            Argument(
                "panels",
                nargs="*",
                metavar="PANEL",
                help=f"panels, from top to bottom: {', '.join(curves.panels())} (default: {' '.join(DEFAULT)})",
                complete=curves.panels,
            ),
            Argument("--plate", default="1", metavar="ID", help="name of the force plate (default: 1)"),
            Argument(
                "--screenshot",
                type=Path,
                metavar="FILE",
                help="save a picture (.png, .svg or .pdf) without opening a window, and end",
            ),
            Argument(
                "--after",
                type=float,
                default=curves.WINDOW,
                metavar="SECONDS",
                help="time until the picture is saved (default: %(default)g)",
            ),
        ]

    def run(self, arguments: argparse.Namespace) -> int:
        """Show the window until it is closed or Ctrl-C, or save a picture; return the exit code."""
        check_private("live_plot")
        return run_command("hric live_plot", lambda: _show(arguments), interrupted=0)


def _show(arguments: argparse.Namespace) -> None:
    known = curves.panels(arguments.plate)
    for name in arguments.panels:
        if name not in known:
            raise UnknownNameError("panel", name, known)
    if arguments.screenshot and arguments.screenshot.suffix not in (".png", ".svg", ".pdf"):
        raise PlotError(f"--screenshot {arguments.screenshot}: unknown picture format; valid: .png, .svg, .pdf")
    shown = [known[name] for name in arguments.panels or DEFAULT]
    shutdown = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: shutdown.set())
    root = _window() if arguments.screenshot is None else None
    rospy.init_node("live_plot", anonymous=True, disable_signals=True)
    rospy.on_shutdown(shutdown.set)
    histories = [_listen(panel) for panel in shown]
    from matplotlib.figure import Figure  # imported late: it loads slowly, and wrong arguments are reported before

    figure = Figure(figsize=(SIZE[0], SIZE[1] * len(shown)), layout="constrained")
    picture = partial(draw, figure.subplots(len(shown), 1, squeeze=False).ravel().tolist(), shown, histories)
    try:
        if root is not None:
            _run_window(root, figure, picture, shutdown)
        else:
            shutdown.wait(arguments.after)
            picture()
            figure.savefig(arguments.screenshot, dpi=100)
    except (OSError, ValueError) as error:
        raise PlotError(f"cannot save {arguments.screenshot}: {error}") from error
    finally:
        shut_down("shutdown requested")


def _listen(panel: CurvePanel) -> SampleHistory:
    history = SampleHistory()
    rospy.Subscriber(
        panel.topic,
        panel.type,
        lambda message: history.store(message.header.stamp.to_sec(), panel.read(message)),
        queue_size=100,
    )
    return history


def _window() -> Any:
    """Open an empty window, before ROS starts, so that a missing display is reported at once."""
    try:
        import tkinter

        root = tkinter.Tk(className="live_plot")
    except ImportError as error:
        raise PlotError(
            "a window needs the Debian package python3-tk (scripts/setup --gui); without it, use --screenshot FILE"
        ) from error
    except tkinter.TclError as error:
        raise PlotError(f"cannot open a window: {error}; without a display, use --screenshot FILE") from error
    root.title("live_plot")
    return root


def _run_window(root: Any, figure: Any, picture: Callable[[], None], shutdown: threading.Event) -> None:
    """Show the curves, updated regularly, until the window is closed or the node shuts down."""
    from matplotlib.backends.backend_tkagg import FigureCanvasTkAgg

    canvas = FigureCanvasTkAgg(figure, master=root)
    canvas.get_tk_widget().pack(fill="both", expand=True)
    width, height = (round(figure.dpi * inches) for inches in figure.get_size_inches())
    root.geometry(f"{width}x{min(height, round(0.9 * root.winfo_screenheight()))}")

    def refresh() -> None:
        if shutdown.is_set():
            root.destroy()
            return
        picture()
        canvas.draw_idle()
        root.after(REFRESH, refresh)

    refresh()
    root.mainloop()
