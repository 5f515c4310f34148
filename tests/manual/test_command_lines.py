"""Check that every command line of the manual is accepted, without executing it.

Current lines are parsed by `hric`, earlier ones, kept in rosrun_lines.txt, by the aliases.
"""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from manual_page import steps
from manual_pages import ENDS, ROOT, commands, names

from hric_core import plugins
from hric_core.command import Command

OLD = (ROOT / "tests/manual/rosrun_lines.txt").read_text().splitlines()
ALIAS = re.compile(r'alias\("(\w+)"\)')
INLINE = re.compile(r"`(hric [^`]+)`")
PLACEHOLDER = re.compile(r"[\[{]|\.\.\.|hric (COMMAND|--help|--version)")
"""Pattern of templates of command lines, which are not complete command lines."""


def refusal(words: list[str]) -> str:
    """Return the error of `hric` for a command line, or an empty text; a name alone is a valid command."""
    known = plugins.names(plugins.COMMAND)
    name = next((name for name in (" ".join(words[:2]), words[0]) if name in known), None)
    if name is None:
        return f"no command: {shlex.join(words)}"
    command = plugins.find(plugins.COMMAND, name)()
    assert isinstance(command, Command)
    others = words[len(name.split()) :]
    try:
        if others and "--help" not in others:
            command.parser(name).parse_intermixed_args(others)
    except SystemExit:
        return f"not understood: {shlex.join(words)}"
    return ""


def old(line: str) -> str:
    """Return the error for a line that starts with rosrun, or an empty text if it works."""
    _, package, program, *words = shlex.split(line)
    node = ROOT / "src" / package / "nodes" / program
    if not node.exists():
        return f"no program: {line}"
    alias = ALIAS.search(node.read_text())
    return refusal([alias[1], *words]) if alias else ""


def inline() -> Iterator[list[str]]:
    for page in sorted([*ROOT.glob("docs/**/*.md"), *ROOT.glob("*.md"), *ROOT.glob("src/*/INTERFACE.md")]):
        for text in INLINE.findall(page.read_text().replace("\\|", "|")):
            if not PLACEHOLDER.search(text):
                line = " ".join(text.split())
                ends = ENDS.search(line)
                yield shlex.split(line[: ends.start()] if ends else line)[1:]


@pytest.mark.parametrize("package", sorted({line.split()[1] for line in OLD}))
def test_command_lines_of_before_work(package: str) -> None:
    lines = [line for line in OLD if line.split()[1] == package]
    assert list(filter(None, map(old, lines))) == []


@pytest.mark.parametrize("page", names())
def test_command_lines_of_a_page_are_understood(page: str) -> None:
    found = [command.words[1:] for command in commands(steps((ROOT / page).read_text())) if command.words[0] == "hric"]
    assert list(filter(None, map(refusal, found))) == []


def test_command_lines_within_texts_are_understood() -> None:
    assert list(filter(None, map(refusal, inline()))) == []


def test_every_alias_names_a_command_that_is_there() -> None:
    nodes = {path: path.read_text(errors="replace") for path in Path(ROOT / "src").glob("*/nodes/*")}
    named = {alias[1] for text in nodes.values() if (alias := ALIAS.search(text))}
    assert named <= set(plugins.names(plugins.COMMAND))
