"""Parsing of a page of the manual into the steps that its reader takes."""

import pytest
from manual_page import Commands, CtrlC, PageError, Printed, Python, WrittenFile, steps


def fence(language: str, text: str, *, said: str = "", title: str = "") -> str:
    comment = f"<!-- {said} -->\n" if said else ""
    heading = f'{language} title="{title}"' if title else language
    return f"Words.\n\n{comment}```{heading}\n{text}\n```\n\n"


def test_commands_run_in_terminal_1_unless_the_page_names_another() -> None:
    page = fence("bash", "ls") + fence("bash", "pwd", said="terminal 2")
    assert steps(page) == [Commands(3, "ls\n", 1), Commands(10, "pwd\n", 2)]


def test_what_stays_is_marked_in_whatever_terminal() -> None:
    page = fence("bash", "roscore", said="stays") + fence("bash", "rosrun a b", said="terminal 3, stays")
    assert [(step.terminal, step.stays) for step in steps(page) if isinstance(step, Commands)] == [(1, True), (3, True)]


def test_a_fence_that_is_not_run_is_no_step_nor_is_the_output_below_it() -> None:
    page = fence("bash", "ls", said="not run: needs an arm") + fence("text", "an arm") + fence("bash", "pwd")
    assert steps(page) == [Commands(16, "pwd\n")]


def test_output_is_expected_of_the_step_before_it_line_by_line() -> None:
    page = fence("bash", "ls") + fence("text", "runs\n\n  src ...") + fence("text", "tests")
    assert steps(page) == [Commands(3, "ls\n", expected=("runs", "src ...", "tests"))]


def test_output_of_a_named_terminal_is_that_of_what_stays_there() -> None:
    page = fence("bash", "roscore", said="stays") + fence("text", "refused", said="terminal 1")
    assert steps(page)[-1] == Printed(11, 1, ("refused",))


def test_ctrl_c_frees_its_terminal() -> None:
    page = fence("bash", "roscore", said="stays") + "<!-- Ctrl-C in terminal 1 -->\n\n" + fence("bash", "ls")
    assert steps(page) == [Commands(4, "roscore\n", stays=True), CtrlC(8, 1), Commands(12, "ls\n")]


def test_a_fence_with_a_title_is_a_file_of_whatever_language() -> None:
    page = fence("yaml", "a: 1", title="my_study/a.yaml") + fence("python", "x = 1", title="src/a.py")
    assert steps(page) == [WrittenFile(3, "my_study/a.yaml", "a: 1\n"), WrittenFile(9, "src/a.py", "x = 1\n")]


def test_python_without_a_title_is_run_and_other_languages_are_to_look_at() -> None:
    assert steps(fence("yaml", "a: 1") + fence("python", "print(1)")) == [Python(9, "print(1)\n")]


def test_a_fence_within_a_list_loses_the_indentation_of_the_list() -> None:
    page = "1. First:\n\n   <!-- terminal 2 -->\n   ```bash\n   for a in b; do\n     ls\n   done\n   ```\n"
    assert steps(page) == [Commands(4, "for a in b; do\n  ls\ndone\n", 2)]


def test_a_note_of_the_authors_is_no_step() -> None:
    assert steps("<!-- check: time -->\n\n" + fence("bash", "ls")) == [Commands(5, "ls\n")]


@pytest.mark.parametrize(
    ("page", "reason"),
    [
        ("```bash\nls\n", "line 1: this fence is not closed"),
        (fence("bash", "ls", said="terminal two"), "line 3: not understood: terminal two; valid: terminal N"),
        ("<!-- stays -->\n\n```bash\nls\n```\n", "line 1: no fence follows"),
        ("<!-- terminal 2 -->", "line 1: no fence follows"),
        (fence("text", "words"), "line 3: no command whose output this is"),
        (fence("bash", "roscore", said="stays") + fence("bash", "ls"), "line 10: terminal 1 is busy since line 4"),
        ("<!-- Ctrl-C in terminal 2 -->\n", "line 1: nothing stays in terminal 2"),
    ],
)
def test_a_page_that_cannot_be_run_as_it_stands_is_refused_with_the_line(page: str, reason: str) -> None:
    with pytest.raises(PageError, match=reason):
        steps(page)
