"""Markers of a person in motion capture frames."""

import numpy as np
import pytest
from geometry_msgs.msg import Point

from hric_msgs.msg import MocapData
from hric_perception.person.frames import PersonMarkers


@pytest.mark.parametrize(
    ("labels", "asset", "known"),
    [
        (["A/LASI", "A/RASI"], "", [True, True]),
        (["A/LASI", "B/LASI", "A/RASI"], "", [False, True]),
        (["A/LASI", "B/LASI", "A/RASI"], "A", [True, True]),
    ],
    ids=["one asset", "two assets", "one of two assets"],
)
def test_a_marker_that_several_people_wear_is_not_known(labels: list[str], asset: str, known: list[bool]) -> None:
    points = [Point(float(k), 0.0, 0.0) for k in range(len(labels))]
    frame = MocapData(labelled_marker_names=labels, labelled_markers=points)
    rows = PersonMarkers(["LASI", "RASI"], {}, asset).positions(frame)
    assert np.isfinite(rows).all(axis=1).tolist() == known
