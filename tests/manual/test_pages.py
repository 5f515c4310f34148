"""What the pages of the manual name is there: links, scripts, nodes, launch files, arguments of the bring-up."""

import re
import sys
from pathlib import Path

import pytest
from manual_page import steps
from manual_pages import ROOT, commands, names, write

from hric_core import plugins

sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import check, choices, documented, split

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#[^)\s]*)?\)")
FENCE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
LINKED = sorted([*ROOT.glob("docs/**/*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def is_there(link: str, page: Path) -> bool:
    """A file, or a page that the site makes: of the interface of a package, or of CONTRIBUTING.md."""
    target = (page.parent / link).resolve()
    if target == ROOT / "docs/contributing.md":
        target = ROOT / "CONTRIBUTING.md"
    if target.parent == ROOT / "docs/reference":
        target = ROOT / "src" / target.stem / "INTERFACE.md"
    return target.exists()


@pytest.mark.parametrize("page", LINKED, ids=name_of)
def test_a_page_links_to_what_is_there(page: Path) -> None:
    text = FENCE.sub("", page.read_text())
    assert [link for link in LINK.findall(text) if link and not is_there(link, page)] == []


@pytest.mark.parametrize("name", names())
def test_the_commands_of_a_page_name_what_is_there(name: str) -> None:
    for command in commands(steps((ROOT / name).read_text())):
        match command.words:
            case ["rosrun", package, program, *_] if (ROOT / "src" / package).exists():
                assert (ROOT / "src" / package / "nodes" / program).exists(), command
            case ["hric", *words]:
                assert plugins.names(plugins.COMMAND).keys() & {words[0], " ".join(words[:2])}, command
            case ["roslaunch", package, launch, *_] if (ROOT / "src" / package).exists():
                assert (ROOT / "src" / package / "launch" / launch).exists(), command
            case [script, *_] if script.startswith("scripts/"):
                assert (ROOT / script).exists(), command


@pytest.mark.parametrize("name", names())
def test_the_bring_ups_of_a_page_are_accepted(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = steps((ROOT / name).read_text())
    write(taken, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(ROOT / "src/hric_controllers/templates"))  # copied by the reader
    for command in commands(taken):
        if command.words[0] == "scripts/bringup":
            check(split(command.words[1:]), documented(), choices())
