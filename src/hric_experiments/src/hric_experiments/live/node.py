"""Common start and end of this package's nodes: arguments, wait for the master, signals, exit codes."""

import math
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import rosgraph
import rospy
from std_srvs.srv import Trigger

from hric_core.errors import FailureError, HricError
from hric_core.parameters import Settings
from hric_core.processes import INTERRUPTED_CODE
from hric_core.ros import RosNode
from hric_core.ros.process import check_words, refuse_unread, shut_down

POLL = 0.01
"""Polling period of the clock and of responses [s of wall time]."""
MASTER_TIMEOUT = 30.0
"""Maximum wait for a ROS master [s of wall time]."""


_stop = threading.Event()


class LiveInterrupted(BaseException):
    """Ctrl-C or SIGTERM was received; raised in the main thread, during waits and computations."""


def main(
    name: str, text: str, work: Callable[[], None], *known: type[Settings] | str, interrupted: int = INTERRUPTED_CODE
) -> int:
    """Run a node.

    Args:
        name: default name of the node.
        text: description for --help.
        work: function that does the work of the node; it raises HricError for a failure to report to the user, and
            Ctrl-C interrupts it at once.
        known: parameters that the node reads.
        interrupted: exit code after Ctrl-C; 0 for a node that runs until Ctrl-C.

    Returns:
        The exit code: 0 if the work is done, else the code of the HricError.
    """
    check_words(name, f"{text} Parameters: INTERFACE.md of hric_experiments.", known)
    _on_signals(_interrupt)
    try:
        wait_for_master()
        rospy.init_node(name, disable_signals=True)
        refuse_unread(RosNode("~"), known)
        work()
        return 0
    except HricError as error:
        rospy.logfatal("%s", error)
        return error.exit_code
    except LiveInterrupted:
        return interrupted
    finally:
        _on_signals(signal.SIG_IGN)
        shut_down("end")


def wait_for_master(timeout: float = MASTER_TIMEOUT) -> None:
    """Wait until a ROS master responds.

    Raises:
        FailureError: no master responds within `timeout` [s].
    """
    deadline = time.monotonic() + timeout
    while not rosgraph.is_master_online():
        if time.monotonic() > deadline:
            raise FailureError(
                f"no ROS master responds at {os.environ.get('ROS_MASTER_URI', '(ROS_MASTER_URI is not set)')}"
            )
        sleep(0.1)


def sleep(seconds: float) -> None:
    """Wait for a wall time [s], unless a signal was received.

    Raises:
        LiveInterrupted: Ctrl-C or SIGTERM was received, now or earlier.
    """
    if not _stop.is_set():
        time.sleep(seconds)
    if _stop.is_set():
        raise LiveInterrupted


def call(service: str, kind: Any, timeout: float) -> Any:
    """Call a service without arguments.

    Raises:
        TimeoutError: there is no response within `timeout` [s of wall time]; a stopped process (SIGSTOP) accepts the
            call but never responds.
    """
    result: Future[Any] = Future()

    def work() -> None:
        try:
            result.set_result(rospy.ServiceProxy(service, kind)())
        except Exception as error:
            result.set_exception(error)

    threading.Thread(target=work, daemon=True).start()
    deadline = time.monotonic() + timeout
    while not result.done():
        if time.monotonic() > deadline:
            raise TimeoutError(f"no response of the service {service} within {timeout:g} s")
        sleep(POLL)
    return result.result()


def trigger(service: str, silent: str, refused: str, timeout: float = math.inf) -> str:
    """Call a service std_srvs/Trigger and return its message; timeout: longest wait [s of wall time].

    Raises:
        FailureError: it does not respond (the text begins with `silent`), or refuses (it begins with `refused`).
    """
    try:
        response = call(service, Trigger, timeout)
    except (rospy.ServiceException, TimeoutError) as error:
        raise FailureError(f"{silent}: {error}") from error
    if not response.success:
        raise FailureError(f"{refused}: {response.message}")
    return str(response.message)


def interrupted() -> bool:
    """Return True if Ctrl-C or SIGTERM was received; for other threads, in which LiveInterrupted is not raised."""
    return _stop.is_set()


def _interrupt(*_: Any) -> None:
    # Only the first signal raises, so that a second one does not interrupt the shutdown. The flag is needed, too,
    # because rospy catches all exceptions in some places.
    first = not _stop.is_set()
    _stop.set()
    if first:
        raise LiveInterrupted


def _on_signals(handler: Any) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)
