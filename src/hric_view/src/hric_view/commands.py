"""Commands `hric view`, recorded runs in the browser, and `hric try`, a contact under chosen conditions."""

import argparse
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from hric_bags.arguments import LATEST, RUNS, run_names
from hric_bags.run_folder import RunFolder
from hric_core.command import Argument, Command
from hric_core.parameters import whole

if TYPE_CHECKING:
    from hric_view.server import Receiver, WindowContents

ADDRESS = (
    Argument(
        "--host", default="127.0.0.1", help="address of this machine on which the window listens (default: 127.0.0.1)"
    ),
    Argument("--port", type=int, default=0, help="TCP port (default: 8090, or a free one if 8090 is taken)"),
)
"""Options of both commands: address and port of the web server."""


class ViewCommand(Command):
    """Show recorded runs in the browser: a list, replays, two runs together, and reports.

    Prints the address to open in the browser, and runs until Ctrl-C. Shows live and headless runs. A page also starts
    new headless runs: it calls `hric run` with an experiment of the workspace.
    """

    def arguments(self) -> list[Argument]:
        """Return the runs and the options of `hric view`."""
        return [
            Argument(
                "run",
                nargs="?",
                metavar="RUN",
                help=f"run folder, its name, or {LATEST}; without it the list of all runs",
                complete=run_names,
            ),
            RUNS,
            *ADDRESS,
        ]

    def run(self, arguments: argparse.Namespace) -> None:
        """Serve the pages until Ctrl-C."""
        from hric_view.recordings import RecordedWindow

        root, query = Path(arguments.runs), ""
        if arguments.run is not None:
            folder = RunFolder.open(arguments.run, root)
            root, query = folder.path.parent, f"run={folder.path.name}"
        window = RecordedWindow(root)
        try:
            serve(window, arguments, "/run" if query else "/", query, window.new)
        finally:
            window.new.close()


class TryCommand(Command):
    """Try a contact of the arm with a person in the browser: sliders, and the figures of each run.

    Each change of a slider runs the experiment try_contact again, without a ROS master. Prints the address to open in
    the browser, and runs until Ctrl-C.
    """

    def arguments(self) -> list[Argument]:
        """Return the options of `hric try`."""
        return [*ADDRESS]

    def run(self, arguments: argparse.Namespace) -> None:
        """Serve the pages until Ctrl-C."""
        from hric_view.tryout import Tryout
        from hric_view.tryout_window import TryoutWindow

        tryout = Tryout()
        try:
            window = TryoutWindow(tryout)
            serve(window, arguments, receiver=window)
        finally:
            tryout.close()


def serve(
    window: "WindowContents",
    arguments: argparse.Namespace,
    path: str = "/",
    query: str = "",
    receiver: "Receiver | None" = None,
) -> None:
    """Print the address of a window and serve its pages until Ctrl-C.

    Args:
        window: pages and scenes.
        arguments: parsed command line, with --host and --port.
        path: path of the page whose address is printed.
        query: query of that address, without the token.
        receiver: receiver of the messages from browsers; None: the connection of a browser that sends one is closed.

    Raises:
        FailureError: the port is taken, or the host is not an address of this machine.
    """
    from hric_view.server import ViewServer

    server = ViewServer(
        window, arguments.host, whole(minimum=0, maximum=65535).checked(arguments.port, "--port"), receiver
    )
    print(f"The window is open at {server.link(path, query)}\nend: Ctrl-C", flush=True)
    try:
        threading.Event().wait()
    finally:
        server.close()
