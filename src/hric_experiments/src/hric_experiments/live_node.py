"""What the nodes of this package share: how they start, and how they end."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import Any

import rosgraph
import rospy

from hric_control.errors import HricError

INTERRUPTED_CODE = 130
MASTER_TIMEOUT = 30.0
"""How long to wait for a master [s]."""


class Interrupted(BaseException):
    """Ctrl-C or SIGTERM, raised in the main thread wherever it waits or computes."""


def main(name: str, work: Callable[[], None]) -> int:
    """Run a node.

    Args:
        name: its default name.
        work: what it does; may return, raise HricError for a failure that a user can understand, and is left at once on Ctrl-C.

    Returns:
        exit code: 0 done, 1 failed, 130 interrupted.
    """
    _on_signals(_interrupt)
    try:
        wait_for_master()
        rospy.init_node(name, disable_signals=True)
        work()
        return 0
    except HricError as error:
        rospy.logfatal("%s", error)
        return 1
    except Interrupted:
        return INTERRUPTED_CODE
    finally:
        _on_signals(signal.SIG_IGN)
        rospy.signal_shutdown("end")


def wait_for_master(timeout: float = MASTER_TIMEOUT) -> None:
    """Wait until a master answers.

    Raises:
        HricError: none does.
    """
    deadline = time.monotonic() + timeout
    while not rosgraph.is_master_online():
        if time.monotonic() > deadline:
            raise HricError(f"no ROS master at {os.environ.get('ROS_MASTER_URI', '(ROS_MASTER_URI is not set)')}")
        time.sleep(0.1)


def _interrupt(*_: Any) -> None:
    _on_signals(signal.SIG_IGN)  # once is enough; what is being closed is not to be left half done
    raise Interrupted


def _on_signals(handler: Any) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)
