"""The command `hric urdf`."""

from pathlib import Path

import pytest

import panda_description
from hric_core.command import perform
from hric_core.errors import ParameterError, UnknownNameError
from panda_description import description

NODE = Path(__file__).parents[1] / "nodes" / "urdf"


def test_words_become_arguments_of_the_right_type() -> None:
    words = ["hand:=False", "damping:=1", "xyz:=0 0 1", "arm_id:=left", "collision:=1"]
    assert description.parse(words) == {
        "hand": False,
        "damping": 1.0,
        "xyz": "0 0 1",
        "arm_id": "left",
        "collision": True,
    }


def test_the_command_prints_what_load_returns(capsys: pytest.CaptureFixture[str]) -> None:
    perform(["urdf", "hand:=false", "damping:=0.5"])
    assert capsys.readouterr().out == panda_description.load(hand=False, damping=0.5) + "\n"


def test_help_names_every_argument_with_default_and_valid_values() -> None:
    text = description.UrdfCommand().parser().format_help()
    for name, argument in panda_description.arguments().items():
        assert f"  {name}:=" in text
        assert argument.valid in text


@pytest.mark.parametrize("word", ["hnad:=true", "unknown:=1"])
def test_an_unknown_argument_is_refused_with_all_valid_names(word: str) -> None:
    with pytest.raises(UnknownNameError) as error:
        description.parse([word])
    assert all(name in str(error.value) for name in panda_description.arguments())


@pytest.mark.parametrize(
    ("word", "said"),
    [("hand:=maybe", "true or false"), ("damping:=much", "number of 0 or more"), ("hand", "ARG:=VALUE")],
)
def test_a_word_that_cannot_be_read_is_refused(word: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        description.parse([word])
