"""Labels of recordings as laboratories write them, matched with the markers of a body."""

import numpy as np
import pytest

from hric_core.errors import ParameterError
from hric_human.body.markers import check_upright, marker_labels

NAMES = ("LFHD", "RFHD", "C7", "LASI", "RASI", "LANK", "RANK")


@pytest.mark.parametrize("spelling", ["{}", "S07:{}", "body_{}", "lab/S07:{}"])
@pytest.mark.parametrize("case", [str.upper, str.lower])
def test_labels_match_in_any_case_and_with_a_prefix(spelling: str, case: type) -> None:
    labels = [spelling.format(case(name)) for name in NAMES]
    assert marker_labels("a.c3d", labels, NAMES) == dict(zip(NAMES, labels, strict=True))


def test_virtual_markers_and_model_outputs_are_ignored() -> None:
    labels = [*(f"S07:{name}" for name in NAMES), "*:PELO", "S07:LElbowAngles", "S07:RHipMoment", "*12"]
    assert list(marker_labels("a.c3d", labels, NAMES)) == list(NAMES)


def test_a_prefix_with_few_markers_is_nobody() -> None:
    labels = [*NAMES, "virtual:LASI", "virtual:RASI", "virtual:C7"]
    assert marker_labels("a.c3d", labels, NAMES)["C7"] == "C7"


TWO = [f"{person}:{name}" for person in ("Anna", "Ben") for name in NAMES]


def test_two_people_need_the_prefix_of_one() -> None:
    message = r"a.c3d has markers of 2 bodies; give the prefix of one person; valid: 'Anna:' \(7 markers\), 'Ben:' \(7 "
    with pytest.raises(ParameterError, match=message):
        marker_labels("a.c3d", TWO, NAMES)


@pytest.mark.parametrize("prefix", ["Ben", "Ben:"])
def test_a_prefix_chooses_one_of_two_people(prefix: str) -> None:
    assert marker_labels("a.c3d", TWO, NAMES, prefix)["LFHD"] == "Ben:LFHD"


def test_an_unknown_prefix_names_the_valid_ones() -> None:
    with pytest.raises(ParameterError, match=r"no markers with the prefix 'Eve'; give .*; valid: 'Anna:'"):
        marker_labels("a.c3d", TWO, NAMES, "Eve")


def standing() -> dict[str, np.ndarray]:
    """Return the markers of a person who walks 3 m along y, z up."""
    heights = {"LFHD": 1.7, "RFHD": 1.7, "LASI": 1.0, "RASI": 1.0, "LANK": 0.1, "RANK": 0.1}
    walk = np.linspace(0.0, 3.0, 50)
    return {name: np.column_stack([0.0 * walk, walk, 0.0 * walk + z]) for name, z in heights.items()}


def y_up(markers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the markers in axes with y up."""
    return {name: p[:, [1, 2, 0]] for name, p in markers.items()}


def test_a_person_upright_along_z_is_accepted() -> None:
    check_upright("a.c3d", standing())


@pytest.mark.parametrize("lower", ["ANK", "ASI"])
def test_a_person_upright_along_y_is_refused(lower: str) -> None:
    markers = {name: p for name, p in y_up(standing()).items() if name.endswith(("FHD", lower))}
    with pytest.raises(ParameterError, match=r"a.c3d does not state which axis points up; .* state up: y, or up: z if"):
        check_upright("a.c3d", markers)


def test_markers_seen_at_different_times_prove_nothing() -> None:
    markers = y_up(standing())
    for name, p in markers.items():
        p[:25] = np.nan if name.endswith("FHD") else p[:25]
        p[25:] = p[25:] if name.endswith("FHD") else np.nan
    check_upright("a.c3d", markers)


def test_a_hand_alone_proves_nothing() -> None:
    check_upright("a.c3d", {"RFIN": np.zeros((5, 3)), "RELB": np.ones((5, 3))})
