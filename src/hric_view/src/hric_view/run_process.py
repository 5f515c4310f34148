"""Run that a window starts: `hric run` in a process of its own, its progress, and how it ended.

The process has a terminal of its own for its messages, so that it shows the progress bar that is read here.
"""

import contextlib
import os
import re
import subprocess
import tempfile
import termios
import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hric_core.errors import HricError
from hric_core.processes import describe_exit, end_process, start_dependent

RUNNING, DONE, CANCELLED, FAILED = "running", "done", "cancelled", "failed"
"""Phases of a run."""
PATIENCE = 120.0
"""Longest wait for the end of a cancelled run, which still writes its report [s]; project default."""
CLOSING = 10.0
"""The same if the window is closed [s]; project default."""
CONTROL = re.compile(r"\x1b\[[\d;?]*[A-Za-z]")
"""Control sequences of a terminal."""
LONGEST = 10_000
"""Longest part of the messages that is kept [characters]."""


@dataclass(frozen=True)
class RunState:
    """State of the run that a window has started last.

    Attributes:
        number: number of the run since the window opened; 0: there was none.
        experiment: name of the experiment.
        phase: RUNNING, DONE, CANCELLED or FAILED; "": there was no run.
        time, duration: robot time simulated so far, and of the complete run [s]; None: not known yet.
        text: what the process does now, or why it failed.
        folder: name of the run folder; "": there is none.
    """

    number: int = 0
    experiment: str = ""
    phase: str = ""
    time: float | None = None
    duration: float | None = None
    text: str = ""
    folder: str = ""


class RunProcess:
    """Runs that a window starts, one at a time.

    Args:
        root: folder of the runs.

    Attributes:
        state: state of the last run.
    """

    def __init__(self, root: Path) -> None:
        self.state = RunState()
        self._root, self._lock = root, threading.Lock()
        self._begun, self._cancelled = threading.Event(), False
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None

    def command(self, name: str, words: Sequence[str]) -> list[str]:
        """Return the command of a run; words: overrides `KEY:=VALUE`."""
        return ["hric", "run", name, *words, "--runs", str(self._root)]

    def start(self, name: str, words: Sequence[str]) -> None:
        """Start a run.

        Args:
            name: name of an experiment of the workspace.
            words: overrides `KEY:=VALUE`.

        Raises:
            HricError: the run before has not ended yet.
        """
        with self._lock:
            if self.state.phase == RUNNING:
                raise HricError(f"{self.state.experiment} is running; valid: wait for its end, or cancel it")
            self.state = RunState(self.state.number + 1, name, RUNNING, text="starting")
            self._process, self._cancelled = None, False
            self._begun.clear()
            # The thread lasts as long as the process: the system ends the process with the thread that started it.
            self._thread = threading.Thread(
                target=self._run, args=(self.command(name, words),), name="run", daemon=True
            )
            self._thread.start()
            self._begun.wait()

    def cancel(self) -> None:
        """Let the run end early, as Ctrl-C does, without waiting for its end; do nothing if none runs."""
        with self._lock:
            if self._process is not None and not self._cancelled:
                self._cancelled = True
                threading.Thread(target=end_process, args=(self._process, PATIENCE), daemon=True).start()

    def close(self) -> None:
        """End the run, and wait for its end."""
        with self._lock:
            if self._process is not None:
                end_process(self._process, CLOSING)
        if self._thread is not None:
            self._thread.join()

    def _run(self, command: Sequence[str]) -> None:
        """Start the process and follow it to its end."""
        ours, theirs = os.openpty()
        termios.tcsetwinsize(theirs, (24, 120))  # a terminal without columns gets no progress bar
        with tempfile.TemporaryFile() as output:
            try:
                self._process = start_dependent(command, stdin=subprocess.DEVNULL, stdout=output, stderr=theirs)
            except OSError as error:
                self.state = replace(self.state, phase=FAILED, text=f"{command[0]} cannot be started: {error.strerror}")
                os.close(ours)
                return
            finally:
                os.close(theirs)
                self._begun.set()
            messages = self._followed(ours)
            os.close(ours)
            code = self._process.wait()
            output.seek(0)
            self._end(code, messages, output.read().decode(errors="replace"))

    def _followed(self, terminal: int) -> str:
        """Show the messages of the process until it ends, and return the last ones; terminal: file descriptor."""
        text, messages = b"", ""
        with contextlib.suppress(OSError):  # the process has closed its terminal
            while part := os.read(terminal, 4096):
                text = (text + part)[-LONGEST:]
                messages = CONTROL.sub("", text.decode(errors="replace").replace("\r\n", "\n"))
                last = next(filter(None, map(str.strip, reversed(re.split(r"[\r\n]+", messages)))), "")
                self.state = replace(self.state, text="" if "s robot time" in last else last)
                if bars := re.findall(r"([\d.]+)/([\d.]+) s robot time", messages):
                    time, duration = map(float, bars[-1])
                    self.state = replace(self.state, time=time, duration=duration)
        return messages

    def _end(self, code: int, messages: str, output: str) -> None:
        """Store how the run ended; output: its standard output."""
        phase = DONE if code == 0 else CANCELLED if self._cancelled else FAILED
        reason = messages.rpartition("hric run: ")[2] if code > 0 and "hric run: " in messages else ""
        text = (reason.strip() or describe_exit("hric run", code)) if phase == FAILED else ""
        folder = re.search("^run folder: (.+)$", output, re.MULTILINE)
        self.state = replace(self.state, phase=phase, text=text, folder=Path(folder[1]).name if folder else "")
