"""Takes (recordings by Motive): started and stopped on request, and with each recorded run, with the run's name."""

import queue
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from std_msgs.msg import String

from hric_core.errors import CommandError, HricError
from hric_core.ros import RosNode

Request = Callable[..., bytes]
"""Function that sends a request to Motive, such as `NatNetClient.request`: (words, timeout [s]) -> response."""
START, STOP = "StartRecording", "StopRecording"
TOPIC = "hric/experiment/recording"
"""Topic of the bag recorder in this namespace: folder of the run that it records; empty: the recording has ended."""
RETRY = 1.0
"""Time between attempts while Motive does not respond [s] (project default, unconfirmed)."""
LAST_WORD = 0.5
"""Longest time that the shutdown of a node waits for Motive [s] (project default, unconfirmed)."""


def order(request: Request, words: str, timeout: float = 2.0) -> None:
    """Send a command to Motive.

    Raises:
        CommandError: Motive does not respond, does not know the command, or refuses it.
    """
    response = request(words, timeout)
    if len(response) >= 4 and any(response[:4]):
        raise Refused(f"Motive refuses the command {words}")


def start(request: Request, name: str) -> None:
    """Start a take; an empty name leaves its name to Motive. Raises CommandError."""
    if name:
        order(request, f"SetRecordTakeName,{name}")
    order(request, START)


class Refused(CommandError):
    """Error of a command that Motive refuses at present."""


class TakeRecorder:
    """Recorder that makes Motive record while a run is recorded; Motive may start later than the run.

    Args:
        node: node for messages.
        request: function that sends a request to Motive.
    """

    def __init__(self, node: RosNode, request: Request) -> None:
        self._node, self._request, self._recording = node, request, False
        self._runs: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="takes", daemon=True)
        self._thread.start()
        self._subscription = node.subscribe(node.beside(TOPIC), String, self._on_run)

    def close(self) -> None:
        """Stop the thread, and a take that it has started."""
        self._subscription.unregister()
        self._runs.put(None)
        self._thread.join(LAST_WORD)
        if self._recording:
            try:
                order(self._request, STOP, LAST_WORD)
            except HricError as error:
                self._node.log_warn(f"Motive may still record, since the take could not be ended: {error}")

    def _on_run(self, message: Any) -> None:
        self._runs.put(Path(message.data).name)

    def _work(self) -> None:
        while (run := self._runs.get()) is not None:
            logged = False
            while self._runs.empty() and not self._done(run, logged):
                logged = True
                time.sleep(RETRY)

    def _done(self, run: str, logged: bool) -> bool:
        """Start the take of a run, or stop it if `run` is empty; return False if Motive does not respond yet."""
        if not run and not self._recording:
            return True
        try:
            if run:
                start(self._request, run)
                self._recording = True
                self._node.log_info(f"Motive records the take {run}")
            else:
                order(self._request, STOP)
                self._recording = False
                self._node.log_info("Motive has ended the take")
        except Refused as error:
            self._node.log_warn(f"the take {run or 'of the last run'}: {error}")
        except HricError as error:
            if not logged:
                self._node.log_warn(f"the take {run or 'of the last run'} waits for Motive: {error}")
            return False
        return True
