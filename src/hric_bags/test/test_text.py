"""Tables that fit the terminal."""

import pytest

from hric_bags import text

TITLE = "of the arm in the run"
CELLS = [
    ["joint", "peak error", "root", "within", "of all"],
    ["", "[rad]", "[rad]", "", ""],
    ["panda_joint1", "0.123", "0.25", "yes", "12345.6"],
    ["panda_joint2", "0.178", "0.02", "", "7.8"],
]


@pytest.mark.parametrize("head", [1, 2])
@pytest.mark.parametrize("before", [[], [TITLE]])
def test_a_table_wider_than_the_terminal_is_folded_with_its_first_column_in_each_part(head, before) -> None:
    cells = CELLS if head == 2 else [CELLS[0], *CELLS[2:]]
    shown = text.fitted("\n".join(["intro", "", *before, *text.rows(cells, head=head), "", "end"]), 36)
    assert max(map(len, shown.splitlines())) <= 36
    assert shown.count("panda_joint2") == 2 and shown.count(TITLE) == len(before)
    assert all(shown.count(word) == 1 for row in cells for word in row[1:] if word and word != "[rad]")
    assert shown.startswith("intro\n\n") and shown.endswith("\n\nend")


def test_a_table_that_fits_and_other_long_lines_stay_as_they_are() -> None:
    report = "\n".join(["x" * 200, "", *text.rows(CELLS, head=2)])
    assert text.fitted(report, 60) == report
