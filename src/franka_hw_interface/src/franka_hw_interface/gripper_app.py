"""ROS node `franka_gripper`: serves the actions of a hand until shutdown."""

from collections.abc import Callable
from functools import partial

from franka_hw_interface.gripper_actions import GripperActions, GripperSettings
from franka_hw_interface.hand import FrankaHand
from hric_core.node import Node
from hric_core.parameters import Settings
from hric_core.ros.process import NodeApp, run

MakeHand = Callable[[Node], tuple[FrankaHand, Callable[[], None]]]
"""Function that gets the private node and returns the hand and a function that closes it; may raise a HricError."""


class GripperApp(NodeApp):
    """ROS node that serves the gripper actions of an emulated or real hand."""

    period = 0.01

    def __init__(self, make_hand: MakeHand, node: Node) -> None:
        settings = GripperSettings.read(node)
        hand, self._close_hand = make_hand(node)
        self._actions = GripperActions(node, hand, settings)

    def tick(self) -> None:
        """Update the actions of the hand."""
        self._actions.update()

    def close(self) -> None:
        """Unregister the actions and close the hand."""
        self._actions.shutdown()
        self._close_hand()


def main(make_hand: MakeHand, text: str, *known: type[Settings] | str) -> int:
    """Run the node franka_gripper and return its exit code.

    Args:
        make_hand: function that creates the hand.
        text: text for --help.
        known: further parameters that are valid for this node, as settings classes or names.
    """
    return run("franka_gripper", text, partial(GripperApp, make_hand), GripperSettings, *known)
