"""Masses, centres of mass, inertias and lengths against the published table, computed here once more."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from bodies import NAMES, PARTS, Posed, body, subject
from numpy.testing import assert_allclose

from hric_core.geometry import judge
from hric_core.urdf import join_capsules, read
from hric_human.body.anthropometry import DE_LEVA, DENSITY, SHOULDER_DROP
from hric_human.body.segments import capsule_radius
from urdf_to_osim import convert, prove, write

HEIGHTS = {"female": 1.735, "male": 1.741}
TRUNK = ("upper_trunk", "middle_trunk", "lower_trunk")


def closed_form(name: str) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre of mass from the middle of the hips, and inertia about it, of a whole body at the zero pose."""
    person = subject(name)
    table, scale = DE_LEVA[person.sex], person.height / HEIGHTS[person.sex]
    length = {row: values.length * scale for row, values in table.items()}
    trunk = sum(length[row] for row in TRUNK)
    drop = SHOULDER_DROP[person.sex] * scale
    foot_radius = foot_radius_by_bisection(table["foot"].mass * person.mass / 1100.0, length["foot"])
    top = {"head": trunk + length["head"], "upper_trunk": trunk, "middle_trunk": trunk - length["upper_trunk"]}
    top |= {"lower_trunk": length["lower_trunk"], "upper_arm": trunk - drop, "thigh": 0.0}
    top["forearm"], top["shank"] = top["upper_arm"] - length["upper_arm"], -length["thigh"]
    top["hand"] = top["forearm"] - length["forearm"]
    points, masses, tensors = [], [], []
    for row, values in table.items():
        sagittal, transverse, longitudinal = (k * length[row] for k in values.radii)
        mass = values.mass * person.mass
        if row == "foot":
            x = -0.037 * person.height + values.com * length["foot"]
            z = -length["thigh"] - length["shank"] - 0.039 * person.height + foot_radius
            moments = (longitudinal, transverse, sagittal)
        else:
            x, z = 0.0, top[row] - values.com * length[row]
            turned = row in ("forearm", "hand")
            moments = (transverse, sagittal, longitudinal) if turned else (sagittal, transverse, longitudinal)
        width = {"upper_arm": 0.2, "forearm": 0.2, "hand": 0.2, "thigh": 0.1, "shank": 0.1, "foot": 0.1}.get(row, 0.0)
        for y in (-0.5 * width * person.height, 0.5 * width * person.height) if width else (0.0,):
            points.append([x, y, z])
            masses.append(mass)
            tensors.append(mass * np.diag(np.square(moments)))
    p, m = np.array(points), np.array(masses)
    com = m @ p / m.sum()
    inertia = np.zeros((3, 3))
    for q, mass, own in zip(p - com, m, tensors, strict=True):
        inertia += own + mass * (q @ q * np.eye(3) - np.outer(q, q))
    return float(m.sum()), com, inertia


def foot_radius_by_bisection(volume: float, length: float) -> float:
    low, high = 0.0, 0.5 * length
    for _ in range(80):
        middle = 0.5 * (low + high)
        inside = np.pi * middle**2 * (length - 2.0 * middle) + 4.0 / 3.0 * np.pi * middle**3 < volume
        low, high = (middle, high) if inside else (low, middle)
    return low


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_body_weighs_and_turns_as_the_table_says(name: str) -> None:
    mass, com, inertia = closed_form(name)
    posed = Posed(body(name))
    total = posed.data.Ig
    assert total.mass == pytest.approx(mass, rel=1e-12)
    assert body(name).total_mass == pytest.approx(mass, rel=1e-12)
    assert_allclose(posed.data.com[0], com, atol=1e-12)
    assert_allclose(total.inertia, inertia, rtol=0, atol=1e-11)
    print(f"{name}: {mass:.3f} kg, com {com.round(4)} m, inertia {np.diag(inertia).round(4)} kg m^2")


@pytest.mark.parametrize(("sex", "share"), [("female", 0.9999), ("male", 1.0)])
def test_the_segments_of_the_table_add_up_to_a_body(sex: str, share: float) -> None:
    middle = ("head", *TRUNK)
    total = sum(row.mass * (1 if name in middle else 2) for name, row in DE_LEVA[sex].items())
    assert total == pytest.approx(share, abs=1e-12)


@pytest.mark.parametrize(
    ("sex", "row", "length", "radii"),
    [
        ("female", "head", 0.2002, (0.330, 0.359, 0.318)),
        ("female", "upper_trunk", 0.1425, (0.746, 0.502, 0.718)),
        ("female", "forearm", 0.2624, (0.263, 0.259, 0.095)),
        ("female", "hand", 0.0780, (0.531, 0.454, 0.335)),
        ("female", "shank", 0.4323, (0.271, 0.267, 0.093)),
        ("male", "head", 0.2033, (0.362, 0.376, 0.312)),
        ("male", "upper_trunk", 0.1707, (0.716, 0.454, 0.659)),
        ("male", "forearm", 0.2669, (0.278, 0.267, 0.122)),
        ("male", "hand", 0.0862, (0.628, 0.513, 0.401)),
        ("male", "shank", 0.4340, (0.255, 0.249, 0.103)),
    ],
)
def test_radii_of_gyration_agree_with_the_tables_other_description_of_the_segment(
    sex: str, row: str, length: float, radii: tuple[float, ...]
) -> None:
    values = DE_LEVA[sex][row]
    rounding = 0.0005 * (length + values.length)
    assert_allclose(np.multiply(values.radii, values.length), np.multiply(radii, length), rtol=0, atol=rounding)


@pytest.mark.parametrize(("sex", "trunk", "com"), [("female", 0.6148, 0.4964), ("male", 0.6033, 0.5138)])
def test_the_three_parts_of_the_trunk_are_the_trunk_of_the_table(sex: str, trunk: float, com: float) -> None:
    rows, top, moment = DE_LEVA[sex], 0.0, 0.0
    for name in TRUNK:
        moment += rows[name].mass * (top + rows[name].com * rows[name].length)
        top += rows[name].length
    assert top == pytest.approx(trunk, abs=1e-12)
    found = moment / sum(rows[name].mass for name in TRUNK)
    assert found == pytest.approx(com * trunk, abs=0.01), "by 1 cm: published values of parts and whole differ"


@pytest.mark.parametrize("name", NAMES)
def test_distances_between_joints_are_the_lengths_of_the_table(name: str) -> None:
    person, posed = subject(name), Posed(body(name), right_sh_flex=30, right_el_flex=70, left_knee_flex=50)
    scale = person.height / HEIGHTS[person.sex]
    for row, first, second in [
        ("upper_arm", "r_shoulder", "r_elbow"),
        ("forearm", "r_elbow", "r_wrist"),
        ("thigh", "l_hip", "l_knee"),
        ("shank", "l_knee", "l_ankle"),
        ("lower_trunk", "waist", "torso"),
    ]:
        distance = np.linalg.norm(posed.point(first) - posed.point(second))
        assert distance == pytest.approx(DE_LEVA[person.sex][row].length * scale, rel=1e-12), row
    assert np.linalg.norm(posed.point("r_shoulder") - posed.point("l_shoulder")) == pytest.approx(0.2 * person.height)


@pytest.mark.parametrize("name", NAMES)
def test_a_standing_body_is_as_tall_as_its_subject_within_three_percent(name: str) -> None:
    described = body(name)
    posed, head, foot = Posed(described), described.segments["head"], described.segments["right_foot"]
    sole = posed.point(foot.link, foot.start)[2] - foot.radius
    assert sole == pytest.approx(-described.base_height, abs=1e-12)
    height = posed.point(head.link, head.end)[2] - sole
    print(f"{name}: {height:.3f} m of {described.subject.height} m")
    assert height == pytest.approx(described.subject.height, rel=0.03)


def test_links_between_joints_change_no_segment_in_any_pose() -> None:
    described, random = body(parts="right_arm"), np.random.default_rng(1)
    for _ in range(20):
        angles = {name: np.degrees(random.uniform(*joint.range)) for name, joint in described.joints.items()}
        posed = Posed(described, **angles)
        com = sum(
            segment.mass.mass * posed.point(segment.link, segment.mass.com) for segment in described.segments.values()
        )
        assert_allclose(posed.data.com[0], com / described.total_mass, atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_all_links_have_an_inertia_that_a_body_can_have(name: str) -> None:
    for link in read(body(name).urdf).links.values():
        if link.mass is not None:
            assert judge(link.mass.inertia).reasons() == [], link.name


@pytest.mark.parametrize("inside", [0, 1, 2])
@pytest.mark.parametrize("slim", [0.02, 0.2, 0.45])
def test_a_capsule_has_the_volume_of_its_segment(inside: int, slim: float) -> None:
    length = 0.4
    radius = slim * length
    volume = np.pi * radius**2 * (length - inside * radius) + 4.0 / 3.0 * np.pi * radius**3
    assert capsule_radius(volume, length, inside) == pytest.approx(radius, rel=1e-9)


def test_a_volume_that_no_capsule_of_the_length_has_gives_no_radius() -> None:
    sphere = 4.0 / 3.0 * np.pi * 0.2**3
    assert np.isnan(capsule_radius(1.01 * sphere, 0.4, 2)) and np.isnan(capsule_radius(9.0 * sphere, 0.4, 2))


@pytest.mark.parametrize("name", NAMES)
def test_each_segment_is_one_capsule_with_the_volume_of_its_mass(name: str) -> None:
    described = body(name)
    links = read(described.urdf).links
    for segment in described.segments.values():
        (capsule,) = join_capsules(links[segment.link].collisions)
        radius, straight = capsule.size
        volume = np.pi * radius**2 * straight + 4.0 / 3.0 * np.pi * radius**3
        row = {"torso": "upper_trunk", "pelvis": "lower_trunk"}.get(segment.kind, segment.kind)
        assert volume * DENSITY[row] == pytest.approx(segment.mass.mass, rel=1e-9), segment.name


@pytest.mark.parametrize("parts", PARTS)
def test_check_urdf_accepts_the_description(parts: str, tmp_path: Path) -> None:
    tool = shutil.which("check_urdf")
    assert tool, "check_urdf of Debian's liburdfdom-tools is missing"
    file = tmp_path / "human.urdf"
    file.write_text(body(parts=parts).urdf)
    result = subprocess.run([tool, str(file)], capture_output=True, text=True)
    assert result.returncode == 0 and "Successfully Parsed XML" in result.stdout, result.stdout + result.stderr


@pytest.mark.parametrize("parts", ["right_arm", "whole_body"])
def test_the_description_converts_to_opensim_with_proof(parts: str, tmp_path: Path) -> None:
    urdf_xml = body(parts=parts).urdf
    path = write(convert(urdf_xml), tmp_path / "human.osim").path
    proof = prove(path, urdf_xml, states=10)
    print(parts, proof.errors)
    assert proof.passed and max(proof.errors.values()) < 1e-11, proof.table()


def test_measured_lengths_and_masses_take_the_place_of_the_table() -> None:
    plain, measured = body(), body(lengths={"forearm": 0.25, "shoulder_width": 0.36}, masses={"forearm": 1.5})
    assert measured.segments["left_forearm"].length == pytest.approx(0.25)
    assert measured.segments["left_upper_arm"].p_parent_link[1] == pytest.approx(0.18)
    assert measured.total_mass - plain.total_mass == pytest.approx(2 * (1.5 - 0.0162 * plain.subject.mass))
