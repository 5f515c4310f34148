"""Parts of a recording: which belong together, and where two of them overlap."""

from pathlib import Path

import pytest

from hric_bags.parts import PartsError, overlap, parts


def test_the_overlap_of_two_parts_is_found_where_a_stream_says_the_same_again_and_again() -> None:
    same = [(time * 10, b"0") for time in range(10)]
    later = [(time * 10 + 1, b"0") for time in range(7, 20)]
    assert overlap(same, later) in (2, 3)  # by the times alone, one message fine
    counted = [(time, bytes([time])) for time in range(10)]
    assert overlap(counted[:7], counted[4:]) == 3
    assert overlap(counted[:4], counted[4:]) == 0
    assert overlap(counted[:3], [(90, bytes([2]))], latched=True) == 1


def test_a_part_that_is_missing_or_was_not_closed_is_reported(tmp_path: Path) -> None:
    for name in ("a_0.bag", "a_2.bag", "b_0.bag", "b_1.bag.active", "c.bag"):
        (tmp_path / name).touch()
    with pytest.raises(PartsError, match=r"a_1\.bag .* is missing"):
        parts(tmp_path / "a_0.bag")
    with pytest.raises(PartsError, match=r"b_1\.bag .* was not closed, try: .*--salvage"):
        parts(tmp_path / "b_0.bag")
    assert parts(tmp_path / "c.bag") == [tmp_path / "c.bag"]
    assert parts(tmp_path / "a_2.bag") == [tmp_path / "a_2.bag"]
