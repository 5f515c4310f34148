"""docs/architecture.md agrees with the code: picture of the packages, functions called in a cycle and for a contact."""

import ast
import contextlib
import re
import sys
import tempfile
from collections.abc import Iterator
from itertools import dropwhile
from pathlib import Path
from types import FrameType
from typing import Any

import headless_hashes
import package_picture
import pytest

from hric_assessment.verdict import assess, opened

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text()
ROW = re.compile(r"^\|[^|]*\| `(?P<file>[^`]+)` \| `(?P<name>[^`]+)` \|$", re.MULTILINE)
SETPOINT = ("pd_step", "duration:=0.05", "setpoints.0.time:=0.02")
TOUCH = ("contact", "duration:=1.4", "setpoints.0.time:=0.1")

Hop = tuple[str, str]
"""File in the workspace, and qualified name of a function in it."""


def hops(part: str) -> list[Hop]:
    """Return the functions in the table below the comment `<!-- hops: part -->` of the page."""
    _, _, rest = PAGE.partition(f"<!-- hops: {part} -->\n")
    table, _, _ = rest.partition("\n\n")
    return [(row["file"], row["name"]) for row in ROW.finditer(table)]


def names_in(tree: ast.AST, prefix: str = "") -> Iterator[str]:
    """Yield the qualified names of the functions of a module, as in `__qualname__`."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.ClassDef):
            yield from names_in(node, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            yield prefix + node.name
            yield from names_in(node, f"{prefix}{node.name}.<locals>.")


@contextlib.contextmanager
def noted() -> Iterator[list[Hop]]:
    """Record the calls of functions of the workspace, in order."""
    made: list[Hop] = []
    root = f"{ROOT}/"
    source = f"{root}src/"

    def note(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(source):
            made.append((code.co_filename[len(root) :], code.co_qualname))

    sys.setprofile(note)
    try:
        yield made
    finally:
        sys.setprofile(None)


def run(folder: str, *arguments: str) -> None:
    """Run an experiment headless."""
    code, output = headless_hashes.command("run", *arguments, "--runs", folder, "--quiet", "--no-figures")
    assert code == 0, output


@pytest.fixture(scope="module")
def calls() -> list[Hop]:
    """Calls in a headless run that sends one setpoint."""
    with tempfile.TemporaryDirectory() as folder, noted() as made:
        run(folder, *SETPOINT)
    return made


@pytest.mark.parametrize("hop", hops("arrival") + hops("cycle") + hops("finding"), ids=lambda hop: hop[1])
def test_each_hop_is_a_function_that_exists(hop: Hop) -> None:
    file, name = hop
    assert name in set(names_in(ast.parse((ROOT / file).read_text())))


def test_a_setpoint_arrives_by_the_hops_of_the_page(calls: list[Hop]) -> None:
    arrival = hops("arrival")[1:]  # a headless run does not use rospy
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


def test_a_contact_becomes_a_finding_by_the_hops_of_the_page(tmp_path: Path) -> None:
    with noted() as made:
        run(str(tmp_path), *TOUCH)
        assess(opened(str(tmp_path / "latest"))).to_dict()
    first = {hop: made.index(hop) for hop in hops("finding") if hop in made}
    assert sorted(first, key=first.__getitem__) == hops("finding")


def test_the_picture_of_packages_shows_the_imports_of_the_code() -> None:
    graph = package_picture.imported()
    assert package_picture.PICTURE.read_text() == package_picture.picture(graph), "tests/package_picture.py --write"
