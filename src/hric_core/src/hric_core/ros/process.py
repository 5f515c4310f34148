"""Process of a node, from its start to its shutdown request."""

import argparse
import errno
import logging
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Sequence

import rospy
from rospy.impl import tcpros_base

from hric_core import yaml_text
from hric_core.errors import HricError, failing
from hric_core.parameters import Known, Settings, known_names, refuse_unknown
from hric_core.processes import run_command
from hric_core.ros import prompt as ros_prompt
from hric_core.ros.node import RosNode

PERIOD = 1.0
"""Time between ticks [s]; that of diagnostics, REP 107."""


class NodeApp:
    """Work of a node, from its construction until `close`. Any method may raise HricError, which ends the node.

    Args:
        node: private node.

    Attributes:
        period: time between ticks [s of wall time].
    """

    period = PERIOD

    def __init__(self, node: RosNode) -> None:
        """Start the work."""

    def tick(self) -> None:
        """Do periodic work in the main thread."""

    def close(self) -> None:
        """End the work; called once, also after an error of `tick`."""


def check_private(name: str, known: Known = (), words: Sequence[str] | None = None) -> None:
    """Refuse parameters (`_KEY:=VALUE`) that a node does not read, before the search for a master; exits.

    Args:
        name: name of the node.
        known: parameters that it reads.
        words: words of the command line; None: those of this process.
    """
    names = known_names(known)
    try:
        for word in sys.argv[1:] if words is None else words:
            if ":=" in word and word.startswith("_") and not word.startswith("__"):
                key, _, text = word[1:].partition(":=")
                value = yaml_text.parse(text, f"~{name}/{key}")
                for part in reversed(key.split("/")):
                    value = {part: value}
                refuse_unknown(value, names, f"~{name}")
    except HricError as error:
        print(f"{name}: {error}", file=sys.stderr)
        raise SystemExit(error.exit_code) from None


def refuse_unread(node: RosNode, known: Known) -> None:
    """Refuse parameters on the master that a node does not read. Raises ParameterError."""
    content = node.param(node.namespace, {})
    refuse_unknown(content if isinstance(content, dict) else {}, known_names(known), node.namespace)


def end_with_roslaunch() -> None:
    """End this process with the roslaunch that started it, whatever its end: an unattended robot must stop.

    roslaunch may start nodes from threads that end early, as it does for other machines, so its process is watched; the
    system's own signal (PR_SET_PDEATHSIG) comes with the end of the thread.
    """
    if not any(word.startswith("__log:=") for word in sys.argv):  # set by roslaunch only
        return
    launcher = os.pidfd_open(os.getppid())

    def watch() -> None:
        select.select([launcher], [], [])
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="watches roslaunch", daemon=True).start()


def check_words(name: str, text: str, known: Known | None = ()) -> None:
    """Print --help, and refuse any other word of the command line, before the search for a master; exits.

    From here on the process ends with the roslaunch that started it.

    Args:
        name: name of the node.
        text: help text; its part from "Usage: " on is also printed for a wrong word.
        known: parameters that it reads; None: they are checked later.
    """
    what, _, usage = text.partition("Usage: ")
    argparse.ArgumentParser(
        name,
        usage.strip() or "%(prog)s [_PARAMETER:=VALUE ...]",
        what,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args(rospy.myargv(sys.argv)[1:])
    if known is not None:
        check_private(name, known)
    end_with_roslaunch()


def run(name: str, text: str, app: Callable[[RosNode], NodeApp], *known: type[Settings] | str) -> int:
    """Run a node. Parameters that it does not read end it before its work starts.

    Args:
        name: default name.
        text: help text.
        app: starts its work, given the private node.
        known: parameters that it reads.

    Returns:
        the exit code.
    """
    check_words(name, text, known)
    shutdown_requested = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: shutdown_requested.set())
    rospy.init_node(name, disable_signals=True)
    widen()
    ros_prompt.send_promptly()
    rospy.on_shutdown(shutdown_requested.set)
    forward_to_ros(logging.getLogger("hric"))

    def work() -> None:
        node = RosNode("~")
        refuse_unread(node, known)
        running = app(node)
        try:
            with failing():
                while not shutdown_requested.wait(running.period):
                    running.tick()
        finally:
            running.close()
            shut_down("requested")

    return run_command(name, work, rospy.logfatal)


def shut_down(reason: str) -> None:
    """Call `rospy.signal_shutdown` at the end of a process, without a traceback of rospy's server.

    The server, if its thread has not run yet, takes the closed socket for an error."""
    threading.excepthook = _report_unless_closed
    rospy.signal_shutdown(reason)


def _report_unless_closed(error: threading.ExceptHookArgs) -> None:
    if not (isinstance(error.exc_value, OSError) and error.exc_value.errno == errno.EBADF):
        threading.__excepthook__(error)


class _RosHandler(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)
        if record.levelno >= logging.ERROR:
            rospy.logerr(text)
        elif record.levelno >= logging.WARNING:
            rospy.logwarn(text)
        else:
            rospy.loginfo(text)


def forward_to_ros(logger: logging.Logger) -> None:
    """Send the messages of `logger` to rosout instead of the terminal alone. After `rospy.init_node`.

    Meant for rare messages: rosout is written in the calling thread.
    """
    logger.setLevel(logging.INFO)
    logger.propagate = False
    if not any(isinstance(handler, _RosHandler) for handler in logger.handlers):
        logger.addHandler(_RosHandler())


BACKLOG = 128
"""Number of connections that may wait to be accepted (project default, unconfirmed).

It is above the number of topics of any node here."""


def widen() -> None:
    """Allow many listeners to connect at once. After `rospy.init_node`.

    rospy lets 5 connections wait. A recorder connects to all topics of a node within a millisecond: the kernel refuses
    the rest, which try again a second later. Until then the recorder receives nothing on these topics.
    """
    tcpros_base.start_tcpros_server()
    tcpros_base._tcpros_server.tcp_ros_server.server_sock.listen(BACKLOG)
