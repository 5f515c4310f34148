"""The emulated hand of a node: what lies between its fingers is a live parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from franka_sim.gripper import Gripper
from hric_control.node import LiveParameter, Node


def emulated_hand(node: Node) -> tuple[Gripper, Callable[[], None]]:
    """A hand with the live parameter `object_width` on the node, and what takes that back."""
    hand = Gripper()
    parameter = LiveParameter("object_width", 0.0, 0.0, hand.max_width, "width of what lies between the fingers [m]; 0: nothing")

    def change(values: dict[str, Any]) -> dict[str, Any]:
        hand.object_width = values["object_width"] or None
        return values

    registration = node.live_parameters([parameter], change)
    return hand, registration.unregister
