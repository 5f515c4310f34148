"""Terminals as a reader has them: an interactive bash each, on a pseudo-terminal, so that Ctrl-C goes where it goes for
the reader, and what a shell was told lasts."""

import contextlib
import itertools
import os
import re
import signal
import subprocess
import termios
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

MARK = "HRIC_MANUAL_PAGE"
"""Variable by which the processes of a page are known."""
PROMPT = "manual-prompt"
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b\][^\x07]*\x07|\r")
"""Colours, titles and returns to the beginning of the line."""
PERIOD = 0.05
"""Between two looks [s]."""
WINDOW = (50, 250)
"""Rows and columns."""
STOP_AT_A_FAILURE = (
    'trap \'manual_code=$?; if [ "${BASH_SOURCE[0]}" = "$manual_block" ]; then '
    'echo "manual: exit code $manual_code: $BASH_COMMAND" >&2; return $manual_code; fi\' ERR\n'
)
"""What a block begins with; what it sources may have commands that fail."""


class TerminalError(Exception):
    """A terminal did not do in time what the page says; has the output."""


class Terminal:
    """One shell.

    Args:
        folder: for the blocks that it runs.
        where: its working folder at the start.
        environment: all variables that it begins with.
    """

    def __init__(self, folder: Path, where: Path, environment: Mapping[str, str]) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder, self._blocks = folder, itertools.count(1)
        self._prompt = f"{PROMPT}-{uuid.uuid4().hex}"
        self._commands, slave = os.openpty()
        _prepare(slave)
        told = {
            "PS1": "",
            "PS2": "",
            "PROMPT_COMMAND": f"printf '\\n%s %s\\n' {self._prompt} $?",
            "VIRTUAL_ENV_DISABLE_PROMPT": "1",
            "TERM": "dumb",
        }
        self._shell = subprocess.Popen(
            # As from a terminal, also where whoever runs the tests lets processes ignore Ctrl-C.
            [
                "env",
                "--default-signal=INT,QUIT",
                "setsid",
                "--ctty",
                "bash",
                "--noprofile",
                "--norc",
                "--noediting",
                "+o",
                "history",
                "-i",
            ],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            env={**environment, **told},
            cwd=where,
        )
        os.close(slave)
        self._printed = bytearray()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self._begun, self._prompts_before = 0, 0
        self._wait_prompt(10.0)

    @property
    def pid(self) -> int:
        """Of the shell."""
        return self._shell.pid

    @property
    def output(self) -> str:
        """What was printed since the last commands began, without colours and prompts."""
        text = CONTROL.sub("", self._printed[self._begun :].decode(errors="replace"))
        return re.sub(rf"\n?{self._prompt} \d+\n", "", text)

    @property
    def busy(self) -> bool:
        """Whether commands still run."""
        return self._prompts() == self._prompts_before

    def start(self, commands: str) -> None:
        """Type commands, and do not wait for their end."""
        block = self._folder / f"block_{next(self._blocks)}.bash"
        block.write_text(f"manual_block={block}\n{STOP_AT_A_FAILURE}{commands}\ntrap - ERR\n")
        self._begun, self._prompts_before = len(self._printed), self._prompts()
        os.write(self._commands, f". {block}\n".encode())

    def wait(self, timeout: float) -> int:
        """Wait until the commands end; answers their exit code: 0, or that of the first one that failed.

        Raises:
            TerminalError: they still run after `timeout` [s], or the shell itself ended.
        """
        return self._wait_prompt(timeout)

    def wait_until(self, condition: Callable[[str], object], timeout: float, what: str) -> None:
        """Wait until the output fulfils a condition, while the commands run.

        Raises:
            TerminalError: it does not after `timeout` [s], or the commands ended before.
        """
        ends = time.monotonic() + timeout
        while not condition(self.output):
            if not self.busy and not condition(self.output):
                raise TerminalError(f"the commands ended before: {what}\n{self.output}")
            if time.monotonic() > ends:
                raise TerminalError(f"after {timeout:g} s still not: {what}\n{self.output}")
            time.sleep(PERIOD)

    def type(self, line: str) -> None:
        """Give a line to the program that runs. The output begins anew."""
        self._begun = len(self._printed)
        os.write(self._commands, f"{line}\n".encode())

    def interrupt(self) -> None:
        """Ctrl-C. The output begins anew."""
        self._begun = len(self._printed)
        os.write(self._commands, b"\x03")

    def close(self) -> None:
        """End the shell."""
        self._shell.kill()
        self._shell.wait()
        self._reader.join(2.0)
        os.close(self._commands)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the other side is closed
            while block := os.read(self._commands, 65536):
                self._printed += block

    def _prompts(self) -> int:
        return self._printed.count(f"{self._prompt} ".encode())

    def _wait_prompt(self, timeout: float) -> int:
        ends = time.monotonic() + timeout
        pattern = re.compile(rf"{self._prompt} (\d+)\n".encode())
        while len(codes := pattern.findall(bytes(self._printed))) <= self._prompts_before:
            if self._shell.poll() is not None:
                raise TerminalError(f"the shell ended with code {self._shell.returncode}\n{self.output}")
            if time.monotonic() > ends:
                raise TerminalError(f"still running after {timeout:g} s\n{self.output}")
            time.sleep(PERIOD)
        return int(codes[-1])


def has_words(output: str, words: Iterable[str]) -> list[str]:
    """Those of the expected lines that the output lacks; `...` in a line stands for anything."""
    seen = " ".join(output.split())
    return [line for line in words if not re.search(_pattern(line), seen)]


def _pattern(line: str) -> str:
    return ".*?".join(re.escape(" ".join(part.split())) for part in line.split("..."))


def marked(mark: str) -> dict[int, str]:
    """Processes that carry this mark: pid -> command line."""
    found = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            environment, command = (entry / "environ").read_bytes(), (entry / "cmdline").read_bytes()
        except OSError:
            continue
        if f"{MARK}={mark}".encode() in environment.split(b"\0") and command:
            found[int(entry.name)] = command.replace(b"\0", b" ").decode(errors="replace").strip()
    return found


def end_marked(mark: str, patience: float = 10.0) -> dict[int, str]:
    """End processes by their pids, first by request; answers those that had to be killed."""
    for pid in marked(mark):
        _signal(pid, signal.SIGTERM)
    ends = time.monotonic() + patience
    while (left := marked(mark)) and time.monotonic() < ends:
        time.sleep(PERIOD)
    for pid in left:
        _signal(pid, signal.SIGKILL)
    return left


def _signal(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)


def _prepare(terminal: int) -> None:
    """No echo of what is typed, and line ends as they are printed."""
    settings = termios.tcgetattr(terminal)
    settings[1] &= ~termios.ONLCR
    settings[3] &= ~termios.ECHO
    termios.tcsetattr(terminal, termios.TCSANOW, settings)
    termios.tcsetwinsize(terminal, WINDOW)
