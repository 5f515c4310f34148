"""The compiled model library, made in a thread of its own so that the robot goes on meanwhile."""

from __future__ import annotations

import platform
import queue
import threading
from collections.abc import Callable

from franka_sim.fci.complaints import LOG
from hric_control.errors import HricError

ARCHITECTURES = {"x86_64": 0, "i686": 1, "armv7l": 2, "aarch64": 3}
"""Numbers of LoadModelLibrary."""
LINUX = 0


class ModelLibrary:
    """Makes the library once, and tells when it is there.

    Args:
        make: returns the shared library; may take a while. Raises HricError.
    """

    def __init__(self, make: Callable[[], bytes]) -> None:
        self._make = make
        self._library: bytes | None = None
        self._done: queue.SimpleQueue[bytes | str] = queue.SimpleQueue()
        self._busy = False

    def refusal(self, architecture: int, system: int) -> str:
        """Why there is no library for such a client; empty if there is."""
        if (architecture, system) == (ARCHITECTURES.get(platform.machine()), LINUX):
            return ""
        return f"a model library can be compiled for this machine ({platform.machine()} Linux) only"

    def ask(self) -> None:
        """Begin to make it, if it is neither made nor in the making."""
        if not self._busy:
            self._busy = True
            if self._library is not None:
                self._done.put(self._library)
            else:
                threading.Thread(target=self._run, name="model library", daemon=True).start()

    def _run(self) -> None:
        try:
            self._done.put(self._make())
        except HricError as error:
            self._done.put(str(error))
        except Exception as error:  # a thread must not die with the question unanswered
            LOG.exception("the model library")
            self._done.put(f"{type(error).__name__}: {error}")

    def take(self) -> bytes | str | None:
        """The library, or why there is none; None while it is being made."""
        try:
            result = self._done.get_nowait()
        except queue.Empty:
            return None
        self._busy = False
        if isinstance(result, bytes):
            self._library = result
        return result
