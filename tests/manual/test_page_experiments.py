"""Check that the experiments on pages of the manual are accepted with the overrides of their commands.

They are not run; experiments that a page presents as wrong must be refused.
"""

import re
from itertools import pairwise
from pathlib import Path

import pytest
from manual_page import steps
from manual_pages import ROOT, commands, names, write

from hric_core.errors import HricError
from hric_run.definition import experiment
from hric_sweep.study import definition as study

MADE = re.compile(r"[\w/]+\.(yaml|c3d)")
"""Pattern of files in an override that another command of the page makes, so that they do not exist here."""


def accept(name: str, given: list[str]) -> None:
    """Read an experiment or a study; raise HricError if it is refused."""
    if name.startswith("src/"):
        name = str(ROOT / name)  # commands of a page run in the workspace
    if Path(name).exists() and not Path(name).stat().st_size:
        return  # another command of the page prints into it
    if name in experiment.names("studies") or (Path(name).exists() and "\nforms:" in Path(name).read_text()):
        study.load(name)
    else:
        experiment.load(name, given)


def overrides(words: list[str]) -> list[str]:
    given = [word for word in words if ":=" in word]
    return [word for word in given if all(Path(found[0]).exists() for found in MADE.finditer(word))]


@pytest.mark.parametrize("name", names())
def test_the_experiments_of_a_page_are_accepted(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    taken = steps((ROOT / name).read_text())
    write(taken, tmp_path)
    monkeypatch.chdir(tmp_path)
    made = {name for command in commands(taken) for option, name in pairwise(command.words) if option == "-o"}
    for command in commands(taken):
        match command.words:
            case ["hric", "run", which, *_] if which in made:
                pass  # another command of the page writes it
            case ["hric", "run", which, *words] if not (command.fails and Path(which).exists()):
                accept(which, overrides(words))
            case ["hric", "run", which, *words]:
                with pytest.raises(HricError):
                    accept(which, overrides(words))
