"""A node's process: from its start until it is told to end."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable

import rospy

from hric_control import ros_backlog, ros_prompt
from hric_control.errors import HricError
from hric_control.ros_logging import forward_to_ros
from hric_control.ros_node import RosNode

PERIOD = 1.0
"""Between ticks [s]; that of diagnostics, REP 107."""


def run(name: str, text: str, make: Callable[[RosNode], tuple[Callable[[], None], Callable[[], None]]]) -> int:
    """Run a node.

    Args:
        name: default name.
        text: for --help.
        make: gets the private node and starts; returns what is called each second, and what ends it. All may raise HricError, which ends the node.

    Returns:
        the exit code.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        print(text)
        return 0
    told_to_end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told_to_end.set())
    rospy.init_node(name, disable_signals=True)
    ros_backlog.widen()
    ros_prompt.send_promptly()
    rospy.on_shutdown(told_to_end.set)
    forward_to_ros(logging.getLogger("hric"))
    try:
        tick, close = make(RosNode("~"))
    except HricError as error:
        rospy.logfatal(str(error))
        return 1
    try:
        while not told_to_end.wait(PERIOD):
            tick()
    except HricError as error:
        rospy.logfatal(str(error))
        return 1
    finally:
        close()
        rospy.signal_shutdown("told to end")
    return 0
