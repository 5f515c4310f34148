"""The process `franka_gripper`: a hand behind its actions, until it is told to end."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable

import rospy

from franka_hw_interface.gripper_actions import GripperActions
from franka_hw_interface.gripper_settings import read_settings
from franka_hw_interface.hand import Hand
from hric_control.errors import HricError
from hric_control.node import Node
from hric_control.ros_logging import forward_to_ros
from hric_control.ros_node import RosNode

UPDATE_EVERY = 0.01
"""[s of wall time]"""


def main(make_hand: Callable[[Node], tuple[Hand, Callable[[], None]]], text: str) -> int:
    """Run the node.

    Args:
        make_hand: gets the private node; returns the hand and what closes it, or raises a HricError.
        text: for --help.
    """
    if {"-h", "--help"} & set(sys.argv[1:]):
        print(text)
        return 0
    # rospy's own handler asks the master from within the signal, and waits for ever where the signal met a question to the master.
    told_to_end = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told_to_end.set())
    rospy.init_node("franka_gripper", disable_signals=True)
    forward_to_ros(logging.getLogger("hric"))
    try:
        node = RosNode("~")
        settings = read_settings(node)
        hand, close = make_hand(node)
    except HricError as error:
        rospy.logfatal(str(error))
        return 1
    actions = GripperActions(node, hand, settings)
    try:
        while not rospy.is_shutdown() and not told_to_end.wait(UPDATE_EVERY):
            actions.update()
    finally:
        actions.shutdown()
        close()
        rospy.signal_shutdown("the gripper has stopped")
    return 0
