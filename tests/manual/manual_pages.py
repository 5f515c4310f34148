"""Pages of the manual whose commands are tested, and the commands of the workspace in them."""

import re
import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from manual_page import Commands, Step, WrittenFile

ROOT = Path(__file__).resolve().parents[2]
TRIED = ("README.md", "docs/tutorials/*.md", "docs/howto/*.md")
SHORT = ("docs/howto/salvage_a_bag.md",)
"""Pages that are tested in the default run, since they take only a few seconds without a ROS master."""
ENDS = re.compile(r"\s(?P<by>\|\||&&|[|&;>])\s?")
OF_THE_WORKSPACE = re.compile(r"(\w+=\S+ )*(scripts/|hric |rosrun |roslaunch )")
VARIABLE = re.compile(r"[A-Z_]+=")
PRINTED_INTO = re.compile(r">>? *([\w./-]+)(?=\s)")


@dataclass(frozen=True)
class Command:
    """Command of a page.

    Attributes:
        words: words of the command, without assignments before and comments after it.
        fails: True if the page expects the command to fail.
    """

    words: list[str]
    fails: bool


def names() -> list[str]:
    """Return the paths of all pages with steps, relative to the workspace."""
    return sorted(str(path.relative_to(ROOT)) for pattern in TRIED for path in ROOT.glob(pattern))


def commands(taken: Iterable[Step]) -> Iterator[Command]:
    """Yield the commands of the workspace (scripts, hric, nodes, launch files) that start a line of a page."""
    for step in taken:
        if isinstance(step, Commands):
            for line in filter(OF_THE_WORKSPACE.match, step.text.splitlines()):
                ends = ENDS.search(line)
                words = shlex.split(line[: ends.start()] if ends else line, comments=True)
                fails = ends is not None and ends["by"] == "||"
                yield Command([word for word in words if not VARIABLE.match(word)], fails)


def write(taken: Iterable[Step], folder: Path) -> None:
    """Write the files that the reader of a page writes; files for redirected output are empty."""
    for step in taken:
        if isinstance(step, WrittenFile):
            path = folder / step.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(step.text)
        elif isinstance(step, Commands):
            for name in PRINTED_INTO.findall(step.text):
                path = folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch()
