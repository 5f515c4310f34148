"""libfranka connected to an emulated control box, for tests of what the bindings offer."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import panda_py.libfranka
import pylibfranka
from fci_peer import control_box

BINDINGS: dict[str, Any] = {"panda": panda_py.libfranka, "fr3": pylibfranka}
"""The binding for each kind of robot."""


def connect(robot: str, ip: str) -> Any:
    """libfranka's Robot. It takes real-time priority where it may, which is given back here: the tests that follow
    would starve the machine."""
    binding = BINDINGS[robot]
    connected = binding.Robot(ip, binding.RealtimeConfig.kIgnore)
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return connected


@contextmanager
def arm(robot: str, *words: str) -> Iterator[Any]:
    """A libfranka Robot to a control box of its own, slow in order to leave the machine to the tests; words: further
    arguments of the box."""
    with control_box("--robot", robot, "--no-collision", "--real-time-factor", "0.05", *words) as (ip, _):
        yield connect(robot, ip)


class Arms:
    """Arms that stay connected, one of each kind, until `close`."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._arms: dict[tuple[str, bool], tuple[Any, Any]] = {}

    def get(self, robot: str, hand: bool) -> tuple[Any, Any]:
        """Return libfranka's Robot and its model."""
        key = (robot, hand)
        if key not in self._arms:
            connected = self._stack.enter_context(arm(robot, *([] if hand else ["--no-hand"])))
            self._arms[key] = connected, connected.load_model()
        return self._arms[key]

    def close(self) -> None:
        """End the control boxes."""
        self._arms.clear()
        self._stack.close()
