"""The path of one millisecond in docs/architecture.md, held against the code that runs."""

import ast
import re
import sys
import tempfile
from collections.abc import Iterator
from itertools import dropwhile
from pathlib import Path
from types import FrameType
from typing import Any

import headless_hashes
import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text()
ROW = re.compile(r"^\|[^|]*\| `(?P<file>[^`]+)` \| `(?P<name>[^`]+)` \|$", re.MULTILINE)
SETPOINT = ("pd_step", "duration:=0.05", "setpoints.0.time:=0.02")

Hop = tuple[str, str]
"""File in the workspace, qualified name."""


def hops(part: str) -> list[Hop]:
    """The rows of a table of the page, which stands below `<!-- hops: part -->`."""
    _, _, rest = PAGE.partition(f"<!-- hops: {part} -->\n")
    table, _, _ = rest.partition("\n\n")
    return [(row["file"], row["name"]) for row in ROW.finditer(table)]


def names_in(tree: ast.AST, prefix: str = "") -> Iterator[str]:
    """Qualified names of the functions of a module, as `__qualname__` has them."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield from names_in(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield prefix + node.name
            yield from names_in(node, f"{prefix}{node.name}.<locals>.")


@pytest.fixture(scope="module")
def calls() -> list[Hop]:
    """Calls within the workspace, in order, of a headless run that sends one setpoint."""
    made: list[Hop] = []
    root = f"{ROOT}/"
    source = f"{root}src/"

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(source):
            made.append((code.co_filename[len(root) :], code.co_qualname))

    with tempfile.TemporaryDirectory() as folder:
        sys.setprofile(note)
        try:
            code, output = headless_hashes.command("run", *SETPOINT, "--runs", folder, "--quiet", "--no-figures")
        finally:
            sys.setprofile(None)
    assert code == 0, output
    return made


@pytest.mark.parametrize("hop", hops("arrival") + hops("cycle") + hops("finding"), ids=lambda hop: hop[1])
def test_each_hop_is_a_function_that_exists(hop: Hop) -> None:
    file, name = hop
    assert name in set(names_in(ast.parse((ROOT / file).read_text())))


def test_a_setpoint_arrives_by_the_hops_of_the_page(calls: list[Hop]) -> None:
    arrival = hops("arrival")[1:]  # without a master there is no rospy
    begin = calls.index(arrival[0])
    assert [call for call in calls[begin:] if call in arrival][: len(arrival)] == arrival


def test_the_cycle_after_a_setpoint_takes_the_hops_of_the_page_in_order(calls: list[Hop]) -> None:
    cycle = hops("cycle")
    arrived = hops("arrival")[-1]
    after = list(dropwhile(lambda call: call != cycle[0], calls[calls.index(arrived) :]))
    end = after.index(cycle[0], 1)
    position = -1
    for hop in cycle:
        assert hop in after[position + 1 : end], f"after {after[position]}, {hop} is not called in the same cycle"
        position = after.index(hop, position + 1)
