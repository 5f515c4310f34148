"""Main function of a ROS node's process: command line, start, periodic work, and shutdown."""

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

from hric_core import yaml_text
from hric_core.errors import HricError, failing
from hric_core.parameters import Known, Settings, known_names, refuse_unknown
from hric_core.processes import run_command
from hric_core.ros import prompt as ros_prompt
from hric_core.ros.inbound import widen
from hric_core.ros.node import RosNode

PERIOD = 1.0
"""Default period of `NodeApp.tick` [s]: that of diagnostics, REP 107."""


class NodeApp:
    """Base class for the work of a ROS node, which lasts from the constructor to `close`.

    A HricError raised by any method ends the node.

    Args:
        node: node with the process's private namespace.

    Attributes:
        period: period of `tick` [s of wall time].
    """

    period = PERIOD

    def __init__(self, node: RosNode) -> None:
        """Start the work."""

    def tick(self) -> None:
        """Do periodic work in the main thread."""

    def close(self) -> None:
        """End the work; called once, also after an error of `tick`."""


def check_private(name: str, known: Known = (), words: Sequence[str] | None = None) -> None:
    """Exit with an error if a parameter on the command line (`_KEY:=VALUE`) is one that the node does not read.

    No ROS master is needed.

    Args:
        name: name of the node.
        known: parameters that the node reads.
        words: words of the command line; None: those of `sys.argv`.
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
    """Raise ParameterError if a parameter server value in the node's namespace is not among those that it reads."""
    content = node.param(node.namespace, {})
    refuse_unknown(content if isinstance(content, dict) else {}, known_names(known), node.namespace)


def end_with_roslaunch() -> None:
    """Let this process end with the roslaunch that started it, even if that is killed: an unattended robot must stop.

    A thread watches the process of roslaunch. The system's own signal (PR_SET_PDEATHSIG) cannot be used: it is sent at
    the end of the thread that started this process, and such threads of roslaunch may end early.
    """
    if not any(word.startswith("__log:=") for word in sys.argv):  # set by roslaunch only
        return
    launcher = os.pidfd_open(os.getppid())

    def watch() -> None:
        select.select([launcher], [], [])
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, name="watches roslaunch", daemon=True).start()


def check_words(name: str, text: str, known: Known | None = ()) -> None:
    """Handle a node's command line before ROS is used: print --help, or exit with an error for an unknown word.

    After this call, the process ends with the roslaunch that started it.

    Args:
        name: name of the node.
        text: help text; its part from "Usage: " on is also printed after an unknown word.
        known: parameters that the node reads; None: they are checked later.
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
    """Run a ROS node until it is shut down. A parameter that it does not read ends it before its work starts.

    Args:
        name: default name of the node.
        text: help text.
        app: function that starts the node's work and returns it, given the private node.
        known: parameters that the node reads.

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
    """Call `rospy.signal_shutdown` at the end of a process, without the traceback that rospy's TCP server may print.

    If the server's thread has not run yet, it reports the closed socket as an error."""
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
    """Send the messages of a Python logger to ROS (rosout and terminal). To be called after `rospy.init_node`.

    It is meant for rare messages, as rosout is written in the calling thread.
    """
    logger.setLevel(logging.INFO)
    logger.propagate = False
    if not any(isinstance(handler, _RosHandler) for handler in logger.handlers):
        logger.addHandler(_RosHandler())
