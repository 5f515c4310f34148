"""Text console for what a person does to a real arm by hand: user stop, guiding, a push, an object in the hand."""

import os
from collections.abc import Callable, Mapping

from franka_sim.box.requests import RequestOutcome
from franka_sim.fci.complaints import LOG
from franka_sim.fci.device import Device
from franka_sim.gripper import Gripper
from hric_core.errors import CommandError, HricError, UnknownNameError
from hric_core.parameters import as_number

MAX_LINE = 4096
"""Maximum number of characters in a line."""
HELP = """user_stop on|off             press or release the user stop
guiding on|off               press or release the guiding buttons
push LINK FX FY FZ SECONDS   push a link with a force in the world frame [N]
object WIDTH                 put an object of this width between the fingers [m]; 0: remove it
reset                        put the arm back to its start pose
help                         print these commands
With several arms, begin with the name of one, e.g. left user_stop on"""


class Console:
    """Console that reads commands from a file descriptor and executes them between two cycles of the arm.

    Args:
        devices: arms by name; if there are several, a command begins with the name of its arm.
        file: file descriptor, e.g. that of the standard input.
        on_end: callback for the end of the file.
    """

    def __init__(self, devices: Mapping[str, Device], file: int, on_end: Callable[[], None]) -> None:
        self._devices, self._file, self._on_end = devices, file, on_end
        self._device = next(iter(devices.values()))
        self._text = b""
        self._actions: dict[str, tuple[int, Callable[[list[str]], object]]] = {
            "user_stop": (1, lambda words: self._device.set_user_stop(_switch(words[0]))),
            "guiding": (1, lambda words: self._device.set_guiding(_switch(words[0]))),
            "push": (5, self._push),
            "object": (1, self._object),
            "reset": (0, lambda _: self._device.reset()),
            "help": (0, lambda _: print(HELP, flush=True)),
        }

    def on_input(self, _: int) -> None:
        """Read and execute the available lines."""
        received = os.read(self._file, MAX_LINE)
        if not received:
            self._on_end()
            return
        *lines, self._text = (self._text + received).split(b"\n")
        self._text = self._text[-MAX_LINE:]
        for line in lines:
            self._carry_out(line.decode(errors="replace").split())

    def _carry_out(self, words: list[str]) -> None:
        if not words:
            return
        try:
            name, *values = self._of_arm(words)
            if name not in self._actions:
                raise UnknownNameError("console command", name, self._actions)
            count, action = self._actions[name]
            if len(values) != count:
                raise CommandError(f"{name} needs {count} values; got {len(values)}. Commands:\n{HELP}")
            outcome = action(values)
            text = f": {outcome.value}" if isinstance(outcome, RequestOutcome) else ""
            LOG.info("console: %s%s", " ".join(words), text)
        except HricError as error:
            LOG.error("console: %s", error)

    def _of_arm(self, words: list[str]) -> list[str]:
        """Choose the arm that the words name, if there are several; return the other words."""
        if len(self._devices) == 1 or words[0] == "help":
            return words
        if words[0] not in self._devices:
            raise UnknownNameError("arm", words[0], self._devices)
        self._device = self._devices[words[0]]
        return words[1:] or [""]

    def _push(self, words: list[str]) -> None:
        x, y, z, duration = (_number(word) for word in words[1:])
        self._device.push(words[0], (x, y, z), duration)

    def _object(self, words: list[str]) -> None:
        hand, width = self._device.hand, _number(words[0])
        if not isinstance(hand, Gripper):
            raise CommandError("object: the emulated arm has no hand that could grasp one")
        hand.object_width = width or None


def _number(word: str) -> float:
    try:
        return as_number(float(word))
    except ValueError:
        raise CommandError(f"{word!r} is no finite number") from None


def _switch(word: str) -> bool:
    if word not in ("on", "off"):
        raise CommandError(f"invalid value {word!r}; valid: on, off")
    return word == "on"
