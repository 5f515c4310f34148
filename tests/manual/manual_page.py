"""Parser of a page of the manual into the steps that its reader takes; it runs nothing.

The fenced blocks of a page are steps. A comment on the line before a block, invisible on the page, has instructions:

    ```bash                            runs in terminal 1, the same shell through the page
    <!-- terminal 2 -->                ... in another shell
    <!-- stays -->                     its last command keeps running; <!-- terminal 2, stays --> in another shell
    <!-- not run: REASON -->           the block and the output below it are not tested
    <!-- Ctrl-C in terminal 1 -->      alone on a line: ends the running command there
    ```yaml title="my_step.yaml"       a file that the reader writes, of any language
    ```python                          runs in one interpreter through the page
    ```text                            lines of the output of the previous step; `...` matches anything
    <!-- terminal 1 -->                before ```text: words of the output of that terminal
    <!-- check: NOTE -->               alone on a line: a note of the authors
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

OPENS = re.compile(r'^(?P<indent> *)```(?P<language>[\w+-]*)(?: +title="(?P<title>[^"]+)")?')
COMMENT = re.compile(r"^ *<!-- *(?P<text>.*?) *-->$")
WHERE = re.compile(r"^(?:terminal (?P<terminal>\d+))?(?:, )?(?P<stays>stays)?$")
CTRL_C = re.compile(r"^Ctrl-C in terminal (?P<terminal>\d+)$")
NOT_RUN, NOTE = "not run: ", "check: "


class PageError(Exception):
    """Error of a block or comment that cannot be interpreted, with its line."""


@dataclass(frozen=True)
class Commands:
    """Step with commands in one terminal.

    Attributes:
        line: line of the block in the page.
        text: commands as the reader types them.
        terminal: number of the terminal.
        stays: True if the last command keeps running.
        expected: lines that the output must contain.
    """

    line: int
    text: str
    terminal: int = 1
    stays: bool = False
    expected: tuple[str, ...] = ()


@dataclass(frozen=True)
class CtrlC:
    """Step that ends the running command in a terminal by Ctrl-C."""

    line: int
    terminal: int
    expected: tuple[str, ...] = ()


@dataclass(frozen=True)
class Python:
    """Step with statements in the Python interpreter of the page."""

    line: int
    text: str
    expected: tuple[str, ...] = ()


@dataclass(frozen=True)
class WrittenFile:
    """Step in which the reader writes a file.

    Attributes:
        line: line of the block in the page.
        path: path relative to the workspace.
        text: content of the file.
    """

    line: int
    path: str
    text: str


@dataclass(frozen=True)
class Printed:
    """Step with expected output of the running command in a terminal."""

    line: int
    terminal: int
    expected: tuple[str, ...]


Step = Commands | CtrlC | Python | WrittenFile | Printed


@dataclass(frozen=True)
class _Fence:
    line: int
    language: str
    title: str | None
    said: str
    """Comment on the line before; empty if there is none."""
    text: str


@dataclass(frozen=True)
class _Comment:
    line: int
    text: str


def steps(page: str) -> list[Step]:
    """Return the steps of a page.

    Raises:
        PageError: a block is not closed, a comment is unknown, or a terminal is busy.
    """
    found: list[Step] = []
    runs = True  # the last block was run, so the output below it is expected
    for part in _parts(page):
        if isinstance(part, _Comment):
            found.append(_ended(part))
        elif part.said.startswith(NOT_RUN):
            runs = False
        elif part.language == "text":
            if runs:
                _expect(found, part)
        elif step := _step(part):
            found.append(step)
            runs = True
    _check_terminals(found)
    return found


def _parts(page: str) -> Iterator[_Fence | _Comment]:
    """Yield the blocks, each with the comment before it, and separate comments."""
    lines = page.splitlines()
    said: _Comment | None = None
    at = 0
    while at < len(lines):
        opened, comment = OPENS.match(lines[at]), COMMENT.match(lines[at])
        if opened:
            end = _end(lines, at, opened["indent"])
            text = "\n".join(line.removeprefix(opened["indent"]) for line in lines[at + 1 : end])
            yield _Fence(at + 1, opened["language"], opened["title"], said.text if said else "", text + "\n")
            said, at = None, end
        elif said:
            raise PageError(f"line {said.line}: no fence follows the comment: {said.text}")
        elif comment and CTRL_C.match(comment["text"]):
            yield _Comment(at + 1, comment["text"])
        elif comment and not comment["text"].startswith(NOTE):
            said = _Comment(at + 1, comment["text"])
        at += 1
    if said:
        raise PageError(f"line {said.line}: no fence follows the comment: {said.text}")


def _end(lines: list[str], at: int, indent: str) -> int:
    for end in range(at + 1, len(lines)):
        if lines[end].rstrip() == f"{indent}```":
            return end
    raise PageError(f"line {at + 1}: this fence is not closed")


def _step(fence: _Fence) -> Step | None:
    terminal, stays = _where(fence)
    if fence.title:
        return WrittenFile(fence.line, fence.title, fence.text)
    if fence.language == "bash":
        return Commands(fence.line, fence.text, terminal or 1, stays)
    if fence.language == "python":
        return Python(fence.line, fence.text)
    return None  # something to look at


def _where(fence: _Fence) -> tuple[int | None, bool]:
    """Return the terminal (None if none is given), and True if the commands of the block keep running."""
    found = WHERE.match(fence.said)
    if not found:
        raise PageError(
            f"line {fence.line - 1}: not understood: {fence.said}; valid: terminal N, stays, not run: REASON, "
            "Ctrl-C in terminal N, check: NOTE"
        )
    return int(found["terminal"]) if found["terminal"] else None, bool(found["stays"])


def _ended(comment: _Comment) -> CtrlC:
    found = CTRL_C.match(comment.text)
    assert found
    return CtrlC(comment.line, int(found["terminal"]))


def _expect(found: list[Step], fence: _Fence) -> None:
    """Add expected output to the previous step, or to the running command in the named terminal."""
    terminal, _ = _where(fence)
    words = tuple(line.strip() for line in fence.text.splitlines() if line.strip())
    if terminal:
        found.append(Printed(fence.line, terminal, words))
    elif not found or isinstance(found[-1], WrittenFile | Printed):
        raise PageError(f"line {fence.line}: no command whose output this is")
    else:
        found[-1] = replace(found[-1], expected=found[-1].expected + words)


def _check_terminals(found: list[Step]) -> None:
    """Raise PageError for commands in a terminal whose previous command was not ended by Ctrl-C."""
    staying: dict[int, int] = {}
    for step in found:
        if isinstance(step, Commands):
            if step.terminal in staying:
                begun = staying[step.terminal]
                raise PageError(f"line {step.line}: terminal {step.terminal} is busy since line {begun}")
            if step.stays:
                staying[step.terminal] = step.line
        elif isinstance(step, CtrlC | Printed) and step.terminal not in staying:
            raise PageError(f"line {step.line}: nothing stays in terminal {step.terminal}")
        elif isinstance(step, CtrlC):
            del staying[step.terminal]
