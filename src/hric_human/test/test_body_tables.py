"""Regions and markers of a body, and wrong subject files."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bodies import NAMES, PARTS, SUBJECTS, Posed, body, subject

from hric_core.errors import ParameterError
from hric_core.urdf import read
from hric_human.body import Region, Subject, describe, load

NODE = Path(__file__).parents[1] / "nodes" / "body"
GOOD = {"code": "S07", "mass": 70, "height": 1.75, "sex": "male"}


@pytest.mark.parametrize("parts", PARTS)
def test_each_link_with_a_shape_has_regions_and_each_marker_a_link(parts: str) -> None:
    made = body(parts=parts)
    links = read(made.urdf).links
    assert set(made.regions) == {name for name, link in links.items() if link.collisions}
    assert {marker.link for marker in made.markers.values()} <= set(links)


def test_regions_know_the_dominant_side() -> None:
    made = body(dominant_hand="left")
    assert made.regions["r_wrist"] == (Region("hand, fingers", False),)
    assert made.regions["l_wrist"] == (Region("hand, fingers", True),)
    assert made.regions["torso"][1] == Region("chest", None)
    assert made.regions["r_ankle"] == (), "the standard has no limit for a foot"


def test_links_of_different_regions_have_different_colours_and_those_of_both_sides_the_same() -> None:
    made = body()
    colours = {
        name: {shape.colour for shape in link.visuals} for name, link in read(made.urdf).links.items() if link.visuals
    }
    by_regions: dict[tuple[str, ...], set[object]] = {}
    for link, regions in made.regions.items():
        by_regions.setdefault(tuple(region.name for region in regions), set()).update(colours[link])
    assert len(by_regions) == 9 and all(len(found) == 1 for found in by_regions.values())
    assert len(set().union(*by_regions.values())) == 9


def test_a_whole_body_has_the_39_markers_and_an_arm_its_own() -> None:
    assert len(body().markers) == 39
    assert list(body(parts="left_arm").markers) == ["LSHO", "LUPA", "LELB", "LFRM", "LWRA", "LWRB", "LFIN"]


def test_markers_are_where_their_names_say() -> None:
    made = body()
    posed = Posed(made)
    at = {name: posed.point(marker.link, marker.p_link_marker) for name, marker in made.markers.items()}
    assert at["RSHO"][1] < 0 < at["LSHO"][1] and at["CLAV"][0] > 0 > at["C7"][0]
    assert at["RWRA"][0] > at["RWRB"][0], "thumb forward"
    assert at["RFIN"][1] < posed.point("r_wrist")[1], "on the back of the hand, outward"
    assert at["RTOE"][0] > at["RANK"][0] > at["RHEE"][0]
    order = ("LFHD", "C7", "T10", "LASI", "LKNE", "LANK")
    assert [at[name][2] for name in order] == sorted((at[name][2] for name in order), reverse=True)
    assert at["LASI"][1] - at["RASI"][1] == pytest.approx(0.25, abs=0.03)


def test_markers_scale_with_the_body() -> None:
    small, large = body("P05_female"), body("P05_female", height=1.1 * 1.518, mass=1.331 * 49.0)
    for name, marker in small.markers.items():
        assert np.allclose(1.1 * marker.p_link_marker, large.markers[name].p_link_marker, atol=1e-12), name


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_subject_is_valid_and_has_its_code(name: str) -> None:
    assert load(SUBJECTS / f"{name}.yaml").code == name[:3] + name.partition("_")[2][0].upper()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"code": "Anna"}, "pseudonym of up to 12 letters and digits"),
        ({"mass": "heavy"}, "number from 30 to 200 [kg]"),
        ({"height": 175}, "number from 1.2 to 2.2 [m]"),
        ({"sex": "f"}, "valid: female, male"),
        ({"dominant_hand": "both"}, "valid: right, left"),
        ({"parts": "arm"}, "valid: right_arm, left_arm, both_arms, upper_body, whole_body"),
        ({"posture": "lying"}, "valid: standing, seated"),
        ({"weight": 70}, "no parameter 'weight'"),
        ({"lengths": {"forarm": 0.25}}, "did you mean forearm?"),
        ({"lengths": {"forearm": -1}}, "lengths.forearm is -1; valid: a finite number above 0 [m]"),
        ({"masses": {"shoulder_width": 1}}, "no mass 'shoulder_width'"),
        ({"lengths": {"hand": 1.9}}, "lengths.hand is 1.9; valid: 0.0"),
        ({"lengths": {"hand": 190.0}}, "at most 30 in size [m]; 190 mm would be 0.19 m"),
        ({"masses": {"hand": 30.0, "thigh": 0.1}}, "masses.hand is 30.0; valid: 0.1"),
    ],
)
def test_a_wrong_subject_is_refused_with_what_is_valid(changes: dict[str, object], said: str) -> None:
    with pytest.raises(ParameterError) as error:
        Subject.of(GOOD | changes, "S07.yaml:")
    assert said in str(error.value) and "S07.yaml" in str(error.value)


def test_a_mass_that_is_no_capsule_of_its_length_is_refused() -> None:
    with pytest.raises(ParameterError, match="upper_trunk and middle_trunk do not fit a capsule"):
        describe(subject(mass=200.0, height=1.3, parts="upper_body"))


def run(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, str(NODE), *words], capture_output=True, text=True)


def test_the_command_prints_the_description() -> None:
    result = run(str(SUBJECTS / "P50_male.yaml"))
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == describe(subject()).urdf.strip()


def test_the_command_ends_with_one_block_for_all_mistakes(tmp_path: Path) -> None:
    file = tmp_path / "S07.yaml"
    file.write_text("code: S07\nmass: 7\nheight: 1.7\nsex: man\n")
    result = run(str(file))
    assert result.returncode == 2 and result.stdout == ""
    first, second = result.stderr.splitlines()
    assert first.startswith("hric body: S07.yaml: mass is 7") and second.endswith("valid: female, male")
    missing = run(str(tmp_path / "none.yaml"))
    assert missing.returncode == 2 and "cannot be read" in missing.stderr
