"""Where muscles are drawn: on the body, and on the side where they are."""

import itertools
import math

import numpy as np
import pytest
from bodies import Posed, body

from hric_core.errors import HricError
from hric_human.body.segments import ROOT
from hric_human.muscles import BUILT_IN, load
from hric_human.muscles.lines import ACTIVATION_COLOURS, colour, muscle_lines

REST = {"right_sh_flex": 20.0, "right_sh_abd": 15.0, "right_el_flex": 80.0}
"""Posture in which the courses are those of the model's paths [deg]."""
SINGLE = ("delt_clav_a", "bic_l", "pron_teres_a", "pron_teres_b")
"""Muscles of one element."""


def test_colours_of_activation_are_straight_between_stops_and_stay_beyond_the_last():
    values, texts = zip(*ACTIVATION_COLOURS, strict=True)
    found = ["#" + "".join(f"{round(255 * part):02x}" for part in rgb) for rgb in colour([*values, 1.0]).tolist()]
    assert found == [*texts, texts[-1]]
    assert colour([0.05])[0] == pytest.approx(colour([0.0, 0.1]).mean(axis=0))


def test_every_muscle_of_both_arms_has_a_line_on_its_own_side():
    one = body(parts="both_arms")
    lines = muscle_lines(one, load(BUILT_IN))
    assert list(lines) == [f"{side}_{name}" for side in ("right", "left") for name in load(BUILT_IN).muscles]
    for name, points in lines.items():
        own = name[0] + "_"
        assert len(points) >= 2 and {link for link, _ in points} <= {f"{own}shoulder", f"{own}elbow", ROOT}
        of_right = lines["right_" + name.partition("_")[2]]
        for (_, (x, y, z)), (_, (a, b, c)) in zip(points, of_right, strict=True):
            assert (x, abs(y), z) == pytest.approx((a, abs(b), c))


@pytest.mark.parametrize("name", ["P05_female", "P95_male"])
def test_lines_in_the_resting_posture_are_as_long_as_the_muscles_of_the_body(name: str):
    """Of a line of several elements the course is that of the strongest, the length the mean of all."""
    one, anatomy = body(name, parts="right_arm"), load(BUILT_IN)
    posed, lines = Posed(one, **REST), muscle_lines(one, anatomy)
    angles = {joint: math.radians(REST.get(f"right_{joint}", 0.0)) for joint in anatomy.joints}
    scale = one.segments["right_upper_arm"].length / anatomy.reference["upper_arm"]
    for muscle in anatomy.muscles.values():
        if len(muscle.pulls) == 0:
            continue
        at = [posed.point(link, place) for link, place in lines[f"right_{muscle.name}"]]
        drawn = sum(float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(at))
        length = scale * float(muscle.length.values(np.array([[angles[j] for j in muscle.length.joints]]))[0])
        assert drawn == pytest.approx(length, rel=0.1 if muscle.name in SINGLE else 0.35), muscle.name


def test_a_file_whose_muscles_go_nowhere_is_refused(tmp_path):
    path = tmp_path / "one.json"
    path.write_text(BUILT_IN.read_text().replace('["torso", [', '["tail", [', 1))
    with pytest.raises(HricError, match="is not a file of"):
        load(path)
