"""Execution of all commands of the manual, page by page in this workspace, and comparison with the stated results."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from manual_page import Step, WrittenFile, steps
from manual_pages import ROOT, SHORT, names
from manual_run import PageRun, shell_environment
from manual_tree import kept_clean

sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_master import free_port

pytestmark = pytest.mark.alone
PAGES = [
    pytest.param(name, id=name, marks=() if name in SHORT else pytest.mark.slow)
    for name in names()
    if steps((ROOT / name).read_text())
]


@pytest.fixture(scope="module", autouse=True)
def _a_clone_that_is_built() -> None:
    if not shutil.which("git") or subprocess.run(["git", "rev-parse"], cwd=ROOT, capture_output=True).returncode:
        pytest.skip("without git nobody knows what a page made")
    if not (ROOT / "devel/setup.bash").exists():
        pytest.skip("the workspace is not built")


def written(taken: list[Step]) -> list[str]:
    return [step.path for step in taken if isinstance(step, WrittenFile)]


@pytest.mark.parametrize("name", PAGES)
def test_the_commands_of_a_page_do_what_it_says(name: str, tmp_path: Path) -> None:
    taken = steps((ROOT / name).read_text())
    with kept_clean(ROOT, tmp_path / "made", written(taken)):
        PageRun(ROOT, tmp_path, shell_environment(tmp_path, free_port())).run(taken)
