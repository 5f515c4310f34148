"""Labels of laboratories find their markers, and what is no marker is told apart."""

from pathlib import Path
from typing import Any

import pytest

from hric_core.errors import ParameterError
from hric_core.parameters import read_yaml
from hric_human.body import Subject, describe
from hric_motion.marker_sets import FOLDER, best_set, mapped_set, mapping_text, marker_sets

BODY = describe(Subject(code="S07", mass=78.2, height=1.759, sex="male", parts="whole_body"))
SETS = sorted(path.stem for path in FOLDER.glob("*.yaml"))


def tree(key: str) -> dict[str, Any]:
    content: dict[str, Any] = read_yaml(FOLDER / f"{key}.yaml")
    return content


def labels(key: str) -> list[str]:
    sides = tree(key).get("sides", "LR")
    return [label.format(side) for label in tree(key)["labels"] for side in (sides if "{}" in label else "-")]


@pytest.mark.parametrize("key", SETS)
def test_each_label_is_a_marker_with_a_place(key: str) -> None:
    one = marker_sets()[key]
    assert all(name in one.extra or name in BODY.markers for name in one.known.values())
    assert {marker.row.segment for marker in one.extra.values()} <= {
        "shoulder",
        "hips",
        *(segment.kind for segment in BODY.segments.values()),
    }


@pytest.mark.parametrize("key", SETS)
def test_unconfirmed_labels_are_labels_of_the_set(key: str) -> None:
    assert set(tree(key).get("unconfirmed", ())) <= set(tree(key)["labels"])


@pytest.mark.parametrize("key", SETS)
def test_labels_of_a_set_choose_it(key: str) -> None:
    assert best_set([f"S01:{label}" for label in labels(key)]) is marker_sets()[key]


def test_plug_in_gait_has_all_markers_of_the_body() -> None:
    assert set(BODY.markers) <= set(marker_sets()["plug_in_gait"].known.values())


@pytest.mark.parametrize("label", ["R.ASIS", "R_ASIS", "r asis", "Ann:R.ASIS", "Ann_rasis", "take 1/R.Asis"])
def test_case_separators_and_prefix_do_not_count(label: str) -> None:
    ((_, found),) = marker_sets()["opensim_gait"].people([label]).items()
    assert found == {"RASI": label}


def test_two_prefixes_are_two_people() -> None:
    people = best_set(["A:LASI", "A:RASI", "B:LASI"]).people(["A:LASI", "A:RASI", "B:LASI"])
    assert {prefix: len(found) for prefix, found in people.items()} == {"A:": 2, "B:": 1}


def test_points_that_are_no_markers_are_told_apart() -> None:
    left_out = marker_sets()["motive_baseline"].left_out(["LHJC", "PELO", "RKneeAngles", "*41", "HeadSide", "Ball"])
    assert left_out == [
        "3 computed points: LHJC, PELO, RKneeAngles",
        "1 unlabelled: *41",
        "1 not used, since no source says on which side of the head it is: HeadSide",
        "1 not markers of Motive Baseline: Ball",
    ]


def test_a_written_mapping_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(mapping_text(["LASI", "RASI1", 'x "1"', "*12"]))
    assert mapped_set(tmp_path / "map.yaml")[1] == {"LASI": "LASI", "RASI": "RASI1"}


@pytest.mark.parametrize("label", ["RASI1", "mk RASI 1"])
def test_a_guess_is_marked_in_the_mapping(label: str) -> None:
    assert f'"{label}": RASI  # guess' in mapping_text(["LASI", label])


def test_no_marker_is_guessed_twice() -> None:
    assert mapping_text(["RASI", "RASI1", "RHipAngles"]).count("guess\n") == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: RASX\n", "unknown markers: RASX"),
        ("a: RASI\nb: r.asi\n", "names RASI twice: for a and for b"),
        ("- RASI\n", "has no mapping of labels"),
    ],
)
def test_mistakes_in_a_mapping_are_refused(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(ParameterError, match=message):
        mapped_set(tmp_path / "map.yaml")
