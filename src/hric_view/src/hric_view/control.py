"""Commands from the page of a running system: checks of control, keys and values; needs no ROS master."""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from hric_core.errors import HricError, UnknownNameError
from hric_view.server import ForeignMessageError, Viewer

MAX_PUSH = 50.0
"""Largest force that a viewer can apply to a link with the mouse [N]; project default, unconfirmed."""
MAX_STEP = 1000
"""Largest number of control cycles that one command `step` simulates; project default."""
MAX_JOG = (0.05, 0.2)
"""Largest displacement of the end effector per axis by one command: translation [m], rotation [rad]; project default.
"""
MAX_WIDTH = 0.08
"""Largest opening of the Franka hand [m]; Franka's data sheet of the hand."""
PERIOD = 0.5
"""Time between two messages to the browsers on who controls and which commands are available [s of wall time]."""
BUTTONS = ("user_stop", "guiding")
"""Buttons on an arm; an emulated arm has them as services `franka_control/set_user_stop` and `set_guiding`."""
MAX_NAME = 40
"""Largest number of characters of a viewer's name."""


class Actions(Protocol):
    """Interface to the system that executes the commands.

    Each method raises HricError if the system refuses the command or does not respond.
    """

    def begin(self) -> None:
        """Delete the setpoints sent so far, since another viewer has taken control; motions start at measured ones."""

    def pause(self) -> None:
        """Pause the simulation."""

    def proceed(self) -> None:
        """Continue the simulation."""

    def step(self, cycles: int) -> None:
        """Simulate a number of control cycles of a paused simulation."""

    def reset(self) -> None:
        """Reset the simulation to its start state."""

    def set_pace(self, factor: float) -> None:
        """Set the real-time factor of the simulation; 0: as fast as possible."""

    def switch(self, start: str, stop: Sequence[str]) -> None:
        """Stop controllers and start another one in the same cycle.

        Args:
            start: name of the controller to start; "": none.
            stop: names of the controllers to stop.
        """

    def move_joints(self, positions: Mapping[str, float]) -> None:
        """Move joints with the running controller; positions: target by joint name [rad]."""

    def jog(self, displacement: Sequence[float]) -> None:
        """Move the end effector; displacement: 3 translations [m] and a rotation vector [rad], axes of the base."""

    def push(self, link: str, point: Sequence[float], force: Sequence[float]) -> None:
        """Apply a force to a link for a short time; the viewer repeats the command while the mouse is held.

        Args:
            link: name of the link.
            point: point of application in the frame of the link, x, y, z [m].
            force: force in the axes of the world, x, y, z [N].
        """

    def grip(self, width: float) -> None:
        """Move the fingers of the Franka hand; width: distance between them [m]."""

    def recover(self) -> None:
        """Start the error recovery of the arm after a reflex."""

    def press(self, button: str, pressed: bool) -> None:
        """Press or release a button of an emulated arm.

        Args:
            button: one of BUTTONS.
            pressed: True: press; False: release.
        """

    def summary(self) -> Mapping[str, object]:
        """Return the state of arm and controllers and the available commands, as values that JSON can represent."""


class Controls:
    """Receiver of the viewers' commands; it executes those of the viewer who has taken control, one at a time.

    Args:
        actions: system that executes the commands.
        limits: lowest and highest position [rad] of each joint that can be moved, by its name.
        links: names of the links that can be pushed.
    """

    def __init__(self, actions: Actions, limits: Mapping[str, tuple[float, float]], links: Sequence[str]) -> None:
        self._actions, self._limits, self._links = actions, limits, frozenset(links)
        self._lock = threading.Lock()
        self._holder: Viewer | None = None
        self._reported = 0.0
        self._name = ""
        self._commands: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "pause": lambda message: actions.pause(),
            "proceed": lambda message: actions.proceed(),
            "reset": lambda message: actions.reset(),
            "recover": lambda message: actions.recover(),
            "step": lambda message: actions.step(_whole(message, "cycles", MAX_STEP)),
            "pace": lambda message: actions.set_pace(_number(message, "factor")),
            "grip": lambda message: actions.grip(_number(message, "width", 0.0, MAX_WIDTH)),
            "switch": self._switch,
            "joints": self._joints,
            "jog": self._jog,
            "push": self._push,
            "press": self._press,
        }
        self._keys = {
            "step": {"cycles"},
            "pace": {"factor"},
            "grip": {"width"},
            "switch": {"start", "stop"},
            "joints": {"positions"},
            "jog": {"displacement"},
            "push": {"link", "point", "force"},
            "press": {"button", "pressed"},
        }

    def scene(self) -> dict[str, object]:
        """Return the limits of joints, forces, displacements and finger width for the controls on the page."""
        limits = {name: list(bounds) for name, bounds in self._limits.items()}
        return {"control": {"limits": limits, "push": MAX_PUSH, "jog": MAX_JOG, "width": MAX_WIDTH}}

    def frame(self) -> dict[str, object]:
        """Return who controls, and `Actions.summary`; empty if less than PERIOD has passed since the last one."""
        now = time.monotonic()
        if now - self._reported < PERIOD:
            return {}
        self._reported = now
        return {"control": {"holder": self.holder, **self._actions.summary()}}

    @property
    def holder(self) -> str:
        """Name and address of the viewer who has control; "": no viewer has."""
        with self._lock:
            return "" if self._holder is None else f"{self._name} ({self._holder.name})"

    def receive(self, viewer: Viewer, message: Mapping[str, Any]) -> None:
        """Execute the command in a message of a viewer, or hand control over.

        Args:
            viewer: sender of the message.
            message: key `command`, and the arguments of this command.

        Raises:
            ForeignMessageError: no page sends such a message; the connection is closed.
            HricError: the viewer does not have control, a value is outside its range, or the system refuses.
        """
        kind = message.get("command")
        if kind == "take" and set(message) == {"command", "name"}:
            return self._take(viewer, _text(message, "name"))
        if kind == "release" and set(message) == {"command"}:
            return self.leave(viewer)
        if not isinstance(kind, str) or kind not in self._commands:
            raise ForeignMessageError(f"no command {kind!r}")
        if set(message) != {"command"} | self._keys.get(kind, set()):
            raise ForeignMessageError(f"command {kind} has the wrong keys: {', '.join(message)}")
        with self._lock:
            holder = self._holder
        if holder is not viewer:
            raise HricError(f'{self.holder or "nobody"} controls this robot; press "take control" first')
        self._commands[kind](message)

    def leave(self, viewer: Viewer) -> None:
        """Release the control of a viewer who releases it or has disconnected; do nothing if they have none."""
        with self._lock:
            if held := self._holder is viewer:
                self._holder, self._name = None, ""
        if held:  # without the lock, as a viewer that does not read holds up its sender
            viewer.tell({"type": "control", "held": False})

    def _take(self, viewer: Viewer, name: str) -> None:
        with self._lock:
            free = self._holder is None or self._holder is viewer
            if free:
                self._holder, self._name = viewer, "".join(filter(str.isprintable, name))[:MAX_NAME] or "somebody"
        if free:
            self._actions.begin()
            viewer.tell({"type": "control", "held": True})
        else:
            raise HricError(f"{self.holder} controls this robot; take control after they have released it")

    def _switch(self, message: Mapping[str, Any]) -> None:
        stop = message["stop"]
        if not isinstance(stop, list) or not all(isinstance(name, str) for name in stop):
            raise ForeignMessageError("`stop` must be a list of controller names")
        self._actions.switch(_text(message, "start"), stop)

    def _joints(self, message: Mapping[str, Any]) -> None:
        positions = message["positions"]
        if not isinstance(positions, dict) or not positions:
            raise ForeignMessageError("`positions` must be a mapping with one joint or more")
        for name in positions:
            if name not in self._limits:
                raise UnknownNameError("joint", name, self._limits)
            lower, upper = self._limits[name]
            if not lower <= (value := _number(positions, name)) <= upper:
                raise HricError(
                    f"{name} at {value:.3f} rad is outside its range; valid: {lower:.3f} to {upper:.3f} rad"
                )
        self._actions.move_joints(positions)

    def _jog(self, message: Mapping[str, Any]) -> None:
        displacement = _vector(message, "displacement", 6)
        if any(abs(value) > MAX_JOG[k // 3] for k, value in enumerate(displacement)):
            raise HricError(f"one step of the end effector is too large; valid: up to {MAX_JOG[0]} m, {MAX_JOG[1]} rad")
        self._actions.jog(displacement)

    def _push(self, message: Mapping[str, Any]) -> None:
        link, force = _text(message, "link"), _vector(message, "force", 3)
        if link not in self._links:
            raise UnknownNameError("link", link, self._links)
        if math.hypot(*force) > MAX_PUSH * (1.0 + 1e-9):
            raise HricError(f"a push of {math.hypot(*force):.1f} N is too large; valid: up to {MAX_PUSH:g} N")
        self._actions.push(link, _vector(message, "point", 3), force)

    def _press(self, message: Mapping[str, Any]) -> None:
        button, pressed = _text(message, "button"), message["pressed"]
        if not isinstance(pressed, bool):
            raise ForeignMessageError("`pressed` must be true or false")
        if button not in BUTTONS:
            raise UnknownNameError("button", button, BUTTONS)
        self._actions.press(button, pressed)


def _number(message: Mapping[str, Any], key: str, lower: float = -math.inf, upper: float = math.inf) -> float:
    value = message[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ForeignMessageError(f"`{key}` must be a number")
    if not lower <= value <= upper:
        raise HricError(f"{key} {value:g} is outside its range; valid: {lower:g} to {upper:g}")
    return float(value)


def _whole(message: Mapping[str, Any], key: str, upper: int) -> int:
    if not isinstance(message[key], int):
        raise ForeignMessageError(f"`{key}` must be a whole number")
    return int(_number(message, key, 1, upper))


def _text(message: Mapping[str, Any], key: str) -> str:
    if not isinstance(message[key], str):
        raise ForeignMessageError(f"`{key}` must be a text")
    return str(message[key])


def _vector(message: Mapping[str, Any], key: str, size: int) -> list[float]:
    values = message[key]
    if not isinstance(values, list) or len(values) != size:
        raise ForeignMessageError(f"`{key}` must be a list of {size} numbers")
    return [_number({key: value}, key) for value in values]
