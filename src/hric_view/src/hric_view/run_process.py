"""Process `hric run` that a page of `hric view` starts, with its progress and its result.

The standard error of the process is a pseudo-terminal, so that it prints a progress bar, which is read here.
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
"""Longest wait for the end of a cancelled run, which still writes its report, before it is killed [s]; project default.
"""
CLOSING = 10.0
"""Longest wait for the end of the run when `hric view` ends [s]; project default."""
CONTROL = re.compile(r"\x1b\[[\d;?]*[A-Za-z]")
"""Pattern of control sequences of a terminal, which are removed from messages."""
LONGEST = 10_000
"""Number of characters of the process's last messages that are stored; project default."""


@dataclass(frozen=True)
class RunState:
    """State of the run that was started last.

    Attributes:
        number: number of runs started since `hric view` began; 0: none yet.
        experiment: name of the experiment.
        phase: RUNNING, DONE, CANCELLED or FAILED; "": no run yet.
        time, duration: robot time simulated so far, and of the complete run [s]; None: not known yet.
        text: present message of the process, or the reason of its failure.
        folder: name of the run folder; "": the run has none (yet).
    """

    number: int = 0
    experiment: str = ""
    phase: str = ""
    time: float | None = None
    duration: float | None = None
    text: str = ""
    folder: str = ""


class RunProcess:
    """Starter of runs, one at a time.

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
        """Return the command line of a run.

        Args:
            name: name of an experiment of the workspace.
            words: overrides `KEY:=VALUE`.
        """
        return ["hric", "run", name, *words, "--runs", str(self._root)]

    def start(self, name: str, words: Sequence[str]) -> None:
        """Start a run in the background.

        Args:
            name: name of an experiment of the workspace.
            words: overrides `KEY:=VALUE`.

        Raises:
            HricError: the previous run has not ended yet.
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
        """Send the run an interrupt, as Ctrl-C does, and do not wait for its end; do nothing if none is running."""
        with self._lock:
            if self._process is not None and not self._cancelled:
                self._cancelled = True
                threading.Thread(target=end_process, args=(self._process, PATIENCE), daemon=True).start()

    def close(self) -> None:
        """Cancel the run, and wait for its end, at most CLOSING [s]."""
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
        """Copy progress and messages of the process to `state` until it ends; return its last messages.

        Args:
            terminal: file descriptor of the pseudo-terminal.
        """
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
        """Store the result of the run in `state`.

        Args:
            code: exit code of the process.
            messages: its last messages.
            output: its standard output.
        """
        phase = DONE if code == 0 else CANCELLED if self._cancelled else FAILED
        reason = messages.rpartition("hric run: ")[2] if code > 0 and "hric run: " in messages else ""
        text = (reason.strip() or describe_exit("hric run", code)) if phase == FAILED else ""
        folder = re.search("^run folder: (.+)$", output, re.MULTILINE)
        self.state = replace(self.state, phase=phase, text=text, folder=Path(folder[1]).name if folder else "")
