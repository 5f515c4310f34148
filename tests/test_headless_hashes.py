"""Headless experiments give the results in headless_hashes.json; a difference is reported with topic and field."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
import bag_digest
import headless_hashes
from bag_digest import BAG_TIME, Field, Topic

RUNS = [pytest.param(name, marks=[] if run.quick else [pytest.mark.slow]) for name, run in headless_hashes.RUNS.items()]


@pytest.mark.parametrize("name", RUNS)
def test_a_headless_run_gives_what_the_list_says(name: str) -> None:
    told = headless_hashes.differences(name)
    assert not told, "\n".join([f"{len(told)} differences, the earliest first:", *told[:20]])


def test_the_list_has_each_run_with_its_topics() -> None:
    runs = headless_hashes.listed()["runs"]
    assert list(runs) == list(headless_hashes.RUNS)
    assert all({"/control_log", "/joint_states", "/sim/contacts"} <= run["topics"].keys() for run in runs.values())


def topic(position: Any, **more: Any) -> Topic:
    """Return a topic of four messages, 10 ms apart, with two joints each."""
    all_values = {BAG_TIME: np.arange(4) * 10_000_000, "position": position, **more}
    arrays = {name: np.asarray(values) for name, values in all_values.items()}
    ends = np.arange(1, 5)
    return Topic("a/msg/B", {name: Field(values, ends * (len(values) // 4)) for name, values in arrays.items()})


POSITION = np.array([0.1, 1.0, 0.2, 1.0, 0.3, 1.0, 0.4, 1e3])


def told(before: dict[str, Topic], after: dict[str, Topic], *, exact: bool = True) -> list[str]:
    listed = {name: bag_digest.describe(values) for name, values in before.items()}
    return [mismatch.text for mismatch in bag_digest.compare(listed, after, exact=exact)]


def changed(index: int, by: float) -> Topic:
    position = POSITION.copy()
    position[index] += by
    return topic(position)


@pytest.mark.parametrize("exact", [True, False])
def test_equal_runs_have_no_difference(exact: bool) -> None:
    more = {"/a": topic(POSITION, effort=np.zeros(4)), "/b": topic(POSITION)}
    assert told({"/a": topic(POSITION)}, more, exact=exact) == []


@pytest.mark.parametrize("exact", [True, False])
def test_missing_topics_and_fields_are_differences(exact: bool) -> None:
    both = {"/a": topic(POSITION), "/b": topic(POSITION, effort=np.zeros(4))}
    assert told(both, {"/b": topic(POSITION)}, exact=exact) == [
        "topic /a is missing; listed: 4 messages of a/msg/B",
        "topic /b, field effort: is missing; listed: 4 values",
    ]


def test_the_last_bit_is_a_difference() -> None:
    (text,) = told({"/a": topic(POSITION)}, {"/a": changed(2, 2.0**-55)})
    assert text.startswith("topic /a, field position: first differs between values 2 and 2 of 8; ")
    assert text.endswith("value 2 was 0.2, is 0.20000000000000004")


def test_an_unlisted_difference_is_in_its_block() -> None:
    many = np.repeat(np.linspace(0.0, 1.0, 100), 4)
    other = many.copy()
    other[61] += 1e-9
    (text,) = told({"/a": topic(many)}, {"/a": topic(other)})
    assert text.startswith("topic /a, field position: first differs between values 50 and 99 of 400; ")


@pytest.mark.parametrize("index", [2, 7])
@pytest.mark.parametrize(("by", "alike"), [(0.9e-9, True), (1.1e-9, False), (-0.9e-9, True), (-1.1e-9, False)])
def test_another_processor_may_differ_by_1e12(index: int, by: float, alike: bool) -> None:
    assert (told({"/a": topic(POSITION)}, {"/a": changed(index, by)}, exact=False) == []) is alike


def test_integers_and_texts_are_always_equal() -> None:
    before = topic(POSITION, count=[1, 2, 3, 4], phase=["rest", "rest", "moving", "moving"])
    after = topic(POSITION, count=[1, 2, 4, 4], phase=["rest", "rest", "rest", "moving"])
    assert told({"/a": before}, {"/a": after}, exact=False) == [
        "topic /a, field count: first differs between values 2 and 2 of 4; value 2 was 3, is 4",
        "topic /a, field phase: first differs between values 2 and 2 of 4; value 2 was 'moving', is 'rest'",
    ]


def test_the_earliest_difference_comes_first() -> None:
    before = {"/a": topic(POSITION), "/b": topic(POSITION)}
    after = {"/a": changed(6, 1.0), "/b": changed(2, 1.0)}
    assert [text[:8] for text in told(before, after)] == ["topic /b", "topic /a"]


def test_moved_values_are_a_difference() -> None:
    before, after = topic(POSITION), topic(POSITION)
    after = Topic(after.type, {**after.fields, "position": Field(POSITION, np.array([1, 4, 6, 8]))})
    (text,) = told({"/a": before}, {"/a": after})
    assert text == "topic /a: its values are as listed, but its messages have other numbers of them"
