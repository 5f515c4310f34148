"""Execution of the steps of a page in terminals, as a reader does, and comparison of the output with the page."""

import os
import re
import time
import uuid
from collections.abc import Iterable, Mapping
from pathlib import Path

from manual_page import Commands, CtrlC, Printed, Python, Step, WrittenFile
from manual_terminals import MARK, Terminal, TerminalError, end_marked, has_words, marked

STEP, READY, PRINTED, END = 300.0, 90.0, 20.0, 150.0
"""Timeouts for commands, for a start, for expected output caused by another terminal, and for the end after Ctrl-C [s];
project defaults, unconfirmed."""
PAGE = 1500.0
"""Timeout for a whole page [s]; project default, unconfirmed."""
QUIET = 3.0
"""Time without output after which a program counts as ready, if the page does not show a line for it [s]; project
default, unconfirmed."""
READY_LINE = re.compile(r"^ +ready  ", re.MULTILINE)
"""Pattern of the line that scripts/bringup prints when it is ready."""
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
    """Error of a step whose result differs from the page, with line, missing output, and output of all terminals."""


def shell_environment(folder: Path, port: int) -> dict[str, str]:
    """Return the environment of a new terminal without a display, with the address of a separate ROS master."""
    taken = {name: os.environ[name] for name in ("HOME", "USER", "LANG", "LC_ALL") if name in os.environ}
    return {
        **taken,
        "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "ROS_MASTER_URI": f"http://localhost:{port}",
        "ROS_HOME": str(folder / "ros"),
        "HRIC_TEST_RESULTS": str(folder / "test_results"),
    }


class PageRun:
    """Execution of one page.

    Args:
        workspace: folder in which the commands run.
        folder: folder for files of the test itself.
        environment: environment of the terminals.
        set_up: commands before the Python interpreter of the page is started.
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
        """Execute all steps, and end all remaining processes.

        Raises:
            StepError: the result of a step differs from the page, or processes remain after the last Ctrl-C.
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
        """End all processes; return those that should have ended by themselves."""
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
