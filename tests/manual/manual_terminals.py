"""Terminals like those of a reader: interactive shells (bash) on pseudo-terminals, so that Ctrl-C reaches the same
processes, and variables of a shell are kept."""

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
"""Environment variable that marks the processes of a page."""
PROMPT = "manual-prompt"
CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b\][^\x07]*\x07|\r")
"""Pattern of control sequences: colours, titles and carriage returns."""
PERIOD = 0.05
"""Polling period [s]."""
WINDOW = (50, 250)
"""Rows and columns of a terminal."""
STOP_AT_A_FAILURE = (
    'trap \'manual_code=$?; if [ "${BASH_SOURCE[0]}" = "$manual_block" ]; then '
    'echo "manual: exit code $manual_code: $BASH_COMMAND" >&2; return $manual_code; fi\' ERR\n'
)
"""Shell commands before a block, which make it stop at the first failing command, except in sourced files."""


class TerminalError(Exception):
    """Error of a terminal that did not reach an expected state in time, with its output."""


class Terminal:
    """Terminal with one interactive shell.

    Args:
        folder: folder for files with the blocks that it runs.
        where: working directory at the start.
        environment: all environment variables at the start.
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
            # Enable SIGINT, which the parent process of the tests may ignore.
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
        """Process id of the shell."""
        return self._shell.pid

    @property
    def output(self) -> str:
        """Output since the start of the last commands, without colours and prompts."""
        text = CONTROL.sub("", self._printed[self._begun :].decode(errors="replace"))
        return re.sub(rf"\n?{self._prompt} \d+\n", "", text)

    @property
    def busy(self) -> bool:
        """True while commands are running."""
        return self._prompts() == self._prompts_before

    def start(self, commands: str) -> None:
        """Start commands without waiting for their end."""
        block = self._folder / f"block_{next(self._blocks)}.bash"
        block.write_text(f"manual_block={block}\n{STOP_AT_A_FAILURE}{commands}\ntrap - ERR\n")
        self._begun, self._prompts_before = len(self._printed), self._prompts()
        os.write(self._commands, f". {block}\n".encode())

    def wait(self, timeout: float) -> int:
        """Wait until the commands end; return 0, or the exit code of the first one that failed.

        Raises:
            TerminalError: the commands are still running after `timeout` [s], or the shell ended.
        """
        return self._wait_prompt(timeout)

    def wait_until(self, condition: Callable[[str], object], timeout: float, what: str) -> None:
        """Wait until the output fulfils a condition, while the commands are running.

        Raises:
            TerminalError: it does not within `timeout` [s], or the commands ended before.
        """
        ends = time.monotonic() + timeout
        while not condition(self.output):
            if not self.busy and not condition(self.output):
                raise TerminalError(f"the commands ended before: {what}\n{self.output}")
            if time.monotonic() > ends:
                raise TerminalError(f"after {timeout:g} s still not: {what}\n{self.output}")
            time.sleep(PERIOD)

    def type(self, line: str) -> None:
        """Send a line to the running program, and clear the output."""
        self._begun = len(self._printed)
        os.write(self._commands, f"{line}\n".encode())

    def interrupt(self) -> None:
        """Send Ctrl-C, and clear the output."""
        self._begun = len(self._printed)
        os.write(self._commands, b"\x03")

    def close(self) -> None:
        """End the shell."""
        self._shell.kill()
        self._shell.wait()
        self._reader.join(2.0)
        os.close(self._commands)

    def _read(self) -> None:
        with contextlib.suppress(OSError):  # the shell has closed its side
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
    """Return the expected lines that are missing in the output; `...` in a line matches anything."""
    seen = " ".join(output.split())
    return [line for line in words if not re.search(_pattern(line), seen)]


def _pattern(line: str) -> str:
    return ".*?".join(re.escape(" ".join(part.split())) for part in line.split("..."))


def marked(mark: str) -> dict[int, str]:
    """Return the command lines of the processes with this mark, by pid."""
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
    """End the processes with this mark, first by SIGTERM; return those that had to be killed."""
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
    """Disable echo and conversion of line ends."""
    settings = termios.tcgetattr(terminal)
    settings[1] &= ~termios.ONLCR
    settings[3] &= ~termios.ECHO
    termios.tcsetattr(terminal, termios.TCSANOW, settings)
    termios.tcsetwinsize(terminal, WINDOW)
