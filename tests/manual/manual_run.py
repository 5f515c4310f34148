"""Takes the steps of a page as its reader does, in terminals of its own, and holds the output against the page."""

import os
import re
import time
import uuid
from collections.abc import Iterable, Mapping
from pathlib import Path

from manual_page import Commands, CtrlC, Printed, Python, Step, WrittenFile
from manual_terminals import MARK, Terminal, TerminalError, end_marked, has_words, marked

STEP, READY, PRINTED, END = 300.0, 90.0, 20.0, 150.0
"""How long commands may take, a start, a line that follows from another terminal, and the end after Ctrl-C [s]; project
defaults, unconfirmed."""
PAGE = 1500.0
"""How long a whole page may take [s]; project default, unconfirmed."""
QUIET = 3.0
"""A program whose words of readiness are not on the page is ready when it printed something and then nothing for [s];
project default, unconfirmed."""
READY_LINE = re.compile(r"^ +ready  ", re.MULTILINE)
"""Of the block that scripts/bringup prints."""
DONE = re.compile(r"^manual-python (\d)$", re.MULTILINE)
INTERPRETER = """\
import sys, traceback
names, code = {"__name__": "__main__"}, 0
for path in map(str.strip, sys.stdin):
    try:
        exec(compile(open(path).read(), path, "exec"), names)
        code = 0
    except Exception:
        traceback.print_exc()
        code = 1
    print(f"manual-python {code}", flush=True)
"""


class StepError(Exception):
    """A step that did not do what the page says: its line, what it lacks, and the output of every terminal."""


def shell_environment(folder: Path, port: int) -> dict[str, str]:
    """What a fresh terminal of a reader without a display has, and a ROS master of its own."""
    taken = {name: os.environ[name] for name in ("HOME", "USER", "LANG", "LC_ALL") if name in os.environ}
    return {
        **taken,
        "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "ROS_MASTER_URI": f"http://localhost:{port}",
        "ROS_HOME": str(folder / "ros"),
        "HRIC_TEST_RESULTS": str(folder / "test_results"),
    }


class PageRun:
    """One page.

    Args:
        workspace: folder where the commands run.
        folder: for what the run itself writes.
        environment: of the terminals.
        set_up: what the interpreter of the page needs in its terminal.
    """

    def __init__(
        self, workspace: Path, folder: Path, environment: Mapping[str, str], set_up: str = "source scripts/env"
    ) -> None:
        self._workspace, self._folder, self._set_up = workspace, folder, set_up
        self._mark = uuid.uuid4().hex
        self._environment = {**environment, MARK: self._mark}
        self._terminals: dict[int, Terminal] = {}
        self._ends = 0.0

    def run(self, steps: Iterable[Step]) -> None:
        """Take all steps, and end what is left.

        Raises:
            StepError: a step did not do what the page says, or processes stayed after the page's last Ctrl-C.
        """
        self._ends = time.monotonic() + PAGE
        try:
            for step in steps:
                try:
                    self._take(step)
                except TerminalError as error:
                    raise StepError(f"line {step.line}: {error}\n{self._outputs()}") from error
        finally:
            left = self._close()
        if left:
            raise StepError(f"these did not end by themselves: {', '.join(left.values())}")

    def _take(self, step: Step) -> None:
        match step:
            case WrittenFile():
                self._write(step)
            case Commands():
                self._commands(step)
            case Python():
                self._python(step)
            case CtrlC():
                self._interrupt(step)
            case Printed():
                self._until(self._terminals[step.terminal], step.expected, PRINTED)

    def _write(self, step: WrittenFile) -> None:
        path = (self._workspace / step.path).resolve()
        if not path.is_relative_to(self._workspace.resolve()):
            raise TerminalError(f"a page writes below the workspace only, not {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(step.text)

    def _commands(self, step: Commands) -> None:
        terminal = self._terminal(step.terminal)
        terminal.start(step.text)
        if step.stays:
            self._wait_ready(terminal, step)
            return
        if code := terminal.wait(self._time(STEP)):
            raise TerminalError(f"exit code {code}")
        _check_words(terminal.output, step.expected)

    def _wait_ready(self, terminal: Terminal, step: Commands) -> None:
        last = step.text.strip().splitlines()[-1]
        if "scripts/bringup" in last:
            terminal.wait_until(READY_LINE.search, self._time(READY), "the block that says that all is ready")
        elif not step.expected:
            self._wait_quiet(terminal)
        self._until(terminal, step.expected, READY)

    def _wait_quiet(self, terminal: Terminal) -> None:
        seen, since = "", time.monotonic()

        def quiet(output: str) -> bool:
            nonlocal seen, since
            if output != seen:
                seen, since = output, time.monotonic()
            return bool(output) and time.monotonic() - since > QUIET

        terminal.wait_until(quiet, self._time(READY), f"output, and then none for {QUIET:g} s")

    def _python(self, step: Python) -> None:
        if new := 0 not in self._terminals:
            program = self._folder / "interpreter.py"
            program.write_text(INTERPRETER)
        terminal = self._terminal(0)
        if new:
            terminal.start(f"{self._set_up}\npython3 -u {program}")
        block = self._folder / f"line_{step.line}.py"
        block.write_text(step.text)
        terminal.type(str(block))
        terminal.wait_until(DONE.search, self._time(STEP), "the end of the statements")
        if DONE.findall(terminal.output)[-1] != "0":
            raise TerminalError("the statements failed")
        _check_words(terminal.output, step.expected)

    def _interrupt(self, step: CtrlC) -> None:
        terminal = self._terminals[step.terminal]
        if not terminal.busy:
            raise TerminalError(f"what should stay in terminal {step.terminal} has ended by itself")
        terminal.interrupt()
        terminal.wait(self._time(END))
        _check_words(terminal.output, step.expected)

    def _until(self, terminal: Terminal, words: Iterable[str], timeout: float) -> None:
        lines = tuple(words)
        terminal.wait_until(lambda output: not has_words(output, lines), self._time(timeout), "; ".join(lines))

    def _terminal(self, number: int) -> Terminal:
        if number not in self._terminals:
            folder = self._folder / f"terminal_{number}"
            self._terminals[number] = Terminal(folder, self._workspace, self._environment)
        return self._terminals[number]

    def _time(self, at_most: float) -> float:
        return max(0.0, min(at_most, self._ends - time.monotonic()))

    def _outputs(self) -> str:
        return "\n".join(f"--- terminal {number}\n{shell.output}" for number, shell in sorted(self._terminals.items()))

    def _close(self) -> dict[int, str]:
        """End everything; answers what had not ended by itself although nothing stays."""
        for terminal in self._terminals.values():
            if terminal.busy:
                terminal.interrupt()
        for terminal in self._terminals.values():
            if terminal.busy:
                _try_to_wait(terminal)
            terminal.close()
        ends = time.monotonic() + PRINTED
        while marked(self._mark) and time.monotonic() < ends:
            time.sleep(0.1)
        left = marked(self._mark)
        end_marked(self._mark)
        return left


def _check_words(output: str, words: Iterable[str]) -> None:
    if lacking := has_words(output, words):
        raise TerminalError(f"the output lacks: {'; '.join(lacking)}")


def _try_to_wait(terminal: Terminal) -> None:
    try:
        terminal.wait(END)
    except TerminalError as error:
        print(f"did not end after Ctrl-C: {error}")
