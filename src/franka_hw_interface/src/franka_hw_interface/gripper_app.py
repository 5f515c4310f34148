"""The process `franka_gripper`: a hand behind its actions, until its shutdown is requested."""

from collections.abc import Callable
from functools import partial

from franka_hw_interface.gripper_actions import GripperActions, GripperSettings
from franka_hw_interface.hand import Hand
from hric_control.node import Node
from hric_control.parameters import Settings
from hric_control.ros.process import NodeApp, run

MakeHand = Callable[[Node], tuple[Hand, Callable[[], None]]]
"""Private node -> the hand, and what closes it; may raise a HricError."""


class GripperApp(NodeApp):
    """The actions of a hand."""

    period = 0.01

    def __init__(self, make_hand: MakeHand, node: Node) -> None:
        settings = GripperSettings.read(node)
        hand, self._close_hand = make_hand(node)
        self._actions = GripperActions(node, hand, settings)

    def tick(self) -> None:
        """Follow the hand."""
        self._actions.update()

    def close(self) -> None:
        """Take the actions back and close the hand."""
        self._actions.shutdown()
        self._close_hand()


def main(make_hand: MakeHand, text: str, *known: type[Settings] | str) -> int:
    """Run the node. Returns the exit code.

    Args:
        make_hand: makes the hand.
        text: for --help.
        known: parameters that `make_hand` reads.
    """
    return run("franka_gripper", text, partial(GripperApp, make_hand), GripperSettings, *known)
