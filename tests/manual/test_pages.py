"""What the pages of the manual name is there: links, scripts, nodes, launch files, arguments of the bring-up."""

import re
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from manual_page import Commands, Step, WrittenFile, steps
from manual_pages import ROOT, names

sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import check, choices, documented, split

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#[^)\s]*)?\)")
FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
LINKED = sorted([*ROOT.glob("docs/**/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
ENDS_A_COMMAND = re.compile(r"\s(?:\|\||&&|[|&;>])\s?")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def words_of(step: Commands) -> Iterator[list[str]]:
    """Each command of a step as words; those of no workspace program are of no interest."""
    for line in step.text.replace("\\\n", " ").splitlines():
        command = ENDS_A_COMMAND.split(line)[0].strip()
        if re.match(r"(\w+=\S+ )*(scripts/|rosrun |roslaunch )", command):
            yield [word for word in shlex.split(command, comments=True) if not re.match(r"[A-Z_]+=", word)]


def commands(taken: list[Step]) -> list[list[str]]:
    return [words for step in taken if isinstance(step, Commands) for words in words_of(step)]


def is_there(link: str, page: Path) -> bool:
    """A file, or a page that the site makes of the interface of a package."""
    target = (page.parent / link).resolve()
    if target.parent == ROOT / "docs/reference":
        return (ROOT / "src" / target.stem / "INTERFACE.md").exists()
    return target.exists()


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_a_page_links_to_what_is_there(page: Path) -> None:
    text = FENCE.sub("", page.read_text())
    assert [link for link in LINK.findall(text) if link and not is_there(link, page)] == []


@pytest.mark.parametrize("name", names())
def test_the_commands_of_a_page_name_what_is_there(name: str) -> None:
    for words in commands(steps((ROOT / name).read_text())):
        match words:
            case ["rosrun", package, program, *_] if (ROOT / "src" / package).exists():
                assert (ROOT / "src" / package / "nodes" / program).exists(), words
            case ["roslaunch", package, launch, *_] if (ROOT / "src" / package).exists():
                assert (ROOT / "src" / package / "launch" / launch).exists(), words
            case [script, *_] if script.startswith("scripts/"):
                assert (ROOT / script).exists(), words


@pytest.mark.parametrize("name", names())
def test_the_bring_ups_of_a_page_are_accepted(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = steps((ROOT / name).read_text())
    for step in taken:
        if isinstance(step, WrittenFile):
            path = tmp_path / step.path
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(step.text)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ROOT / "src/hric_controllers/templates"))  # copied by the reader
    for words in commands(taken):
        if words[0] == "scripts/bringup":
            check(split(words[1:]), documented(), choices())
