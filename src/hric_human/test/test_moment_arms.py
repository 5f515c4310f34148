"""Moment arms of the built-in anatomy beside published ones, and the figure and the table that show them."""

import moment_arms
import numpy as np
import pytest

ROWS = moment_arms.compared()


@pytest.mark.parametrize("one", ROWS, ids=[one.row["name"] for one in ROWS])
def test_a_moment_arm_is_within_its_stated_distance_of_the_published_one(one: moment_arms.Compared):
    missed = np.abs(np.subtract(one.model, one.published)).max()
    print(f"{one.row['name']}: {missed:.1f} mm of {one.row['within']}")
    assert missed <= one.row["within"]
    assert missed > one.row["within"] - 5.0, "a stated distance far above the real one hides what is wrong"


def test_every_published_value_has_a_source_with_its_status():
    sources = moment_arms.read()["sources"]
    assert {one.row["source"] for one in ROWS} == set(sources)
    assert {source["status"] for source in sources.values()} <= {"confirmed", "read", "unconfirmed"}


def test_the_committed_figure_and_table_are_those_of_the_anatomy():
    assert moment_arms.FIGURE.read_text() == moment_arms.figure(ROWS), "moment_arms.py --write"
    text = moment_arms.PAGE.read_text()
    assert text == moment_arms.page(text, ROWS), "moment_arms.py --write"


def test_the_curves_of_the_figure_are_moment_arms_of_the_muscles():
    from test_muscles import arm, pose

    (triceps,) = [one for one in ROWS if one.row["name"] == "triceps"]
    k = list(triceps.angles).index(60.0)
    names = triceps.row["lines"]
    expected = [arm(pose(el_flex=60.0), name, "el_flex") for name in names]
    assert triceps.lines[:, k] == pytest.approx(expected, abs=1e-6)
