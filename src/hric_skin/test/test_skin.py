"""The skin has the mass and the joints of its subject, keeps its volume in bends and its regions on their links."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from postures import POSTURES, SUBJECTS, person, transforms

from hric_core.errors import HricError
from hric_core.geometry import FloatArray
from hric_human.body import Body, describe
from hric_skin import REGION_KEYS, Skin, fitted, shade
from hric_skin.fit import DENSITY
from hric_skin.outlines import outlines
from hric_skin.template import REGIONS


def winding_number(triangles: FloatArray) -> float:
    """Return how often a closed surface, shape (m, 3, 3), goes around the origin: the sum of solid angles by 4 pi.

    Van Oosterom & Strackee, IEEE Trans. Biomed. Eng. 30(2):125-126, 1983.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    na, nb, nc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
    below = na * nb * nc + dots[0] * nc + dots[1] * na + dots[2] * nb
    return float(np.sum(2.0 * np.arctan2(above, below)) / (4.0 * np.pi))


def merged(skin: Skin) -> trimesh.Trimesh:
    """Return the surface in the bind pose without seams."""
    points, index = np.unique(np.round(skin.vertices, 9), axis=0, return_inverse=True)
    return trimesh.Trimesh(points, index.ravel()[skin.triangles], process=False)


@pytest.fixture(scope="module")
def man() -> Body:
    return person("male", 79.0, 1.75)


@pytest.fixture(scope="module")
def skin(man: Body) -> Skin:
    return fitted(man)


@pytest.mark.parametrize(("sex", "mass", "height"), SUBJECTS)
def test_volume_is_mass_by_density(sex: str, mass: float, height: float) -> None:
    skin = fitted(person(sex, mass, height))
    surface = merged(skin)
    assert surface.is_watertight and len(skin.triangles) <= 7500
    assert surface.volume == pytest.approx(mass / DENSITY, rel=0.01)


@pytest.mark.parametrize("posture", POSTURES)
def test_bends_keep_volume_and_do_not_tear(skin: Skin, man: Body, posture: str) -> None:
    vertices = skin.posed(transforms(man, POSTURES[posture]))
    surface = trimesh.Trimesh(vertices, skin.triangles, process=False)
    assert surface.volume > 0.88 * skin.volume(skin.vertices)
    edges = surface.edges_unique
    length, before = (
        np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1) for points in (vertices, skin.vertices)
    )
    assert np.max(length - before) < 0.15  # of skin that spans a bend; a vertex on a wrong limb is much farther away


@pytest.mark.parametrize("posture", POSTURES)
def test_segments_lie_inside_their_skin(skin: Skin, man: Body, posture: str) -> None:
    T = transforms(man, POSTURES[posture])
    vertices = skin.posed(T)
    com = {name: (T[segment.link] @ np.append(segment.mass.com, 1.0))[:3] for name, segment in man.segments.items()}
    winding = {name: winding_number(vertices[skin.triangles] - p) for name, p in com.items()}
    assert {name for name, turns in winding.items() if turns < 0.5} <= {"right_foot", "left_foot"}


def test_in_the_bind_pose_vertices_stay(skin: Skin) -> None:
    bind = dict(zip(skin.links, skin.T_base_link, strict=True))
    assert skin.posed(bind) == pytest.approx(skin.vertices, abs=1e-12)


def test_regions_are_those_of_the_links(skin: Skin, man: Body) -> None:
    for link, regions in man.regions.items():
        own = skin.weights[:, skin.links.index(link)] > 0.7
        assert own.any() and {REGIONS[index] for index in skin.regions[own]} <= {
            *(region.name for region in regions),
            "foot, toes, ankle",
        }
    assert {REGIONS[index] for index in skin.regions} == set(REGIONS)


@pytest.mark.parametrize("parts", ["right_arm", "both_arms", "upper_body"])
def test_a_part_of_a_body_has_its_part_of_the_skin(parts: str, skin: Skin) -> None:
    body = person("male", 79.0, 1.75, parts)
    part = fitted(body)
    assert set(part.links) <= set(transforms(body, {})) and 0 < len(part.triangles) < len(skin.triangles)
    assert part.weights.sum(axis=1) == pytest.approx(np.ones(len(part.vertices)))
    assert set(np.unique(part.triangles)) == set(range(len(part.vertices)))


def test_a_gripping_hand_is_closed_and_the_other_is_not(skin: Skin, man: Body) -> None:
    closed = fitted(man, gripping=("right",))
    moved = np.linalg.norm(closed.vertices - skin.vertices, axis=1) > 1e-4
    assert moved.any() and np.all(skin.weights[moved, skin.links.index("r_wrist")] > 0.5)
    hand, T = man.segments["right_hand"], transforms(man, {})
    reach = [np.max(np.linalg.norm(one.posed(T)[moved] - T[hand.link][:3, 3], axis=1)) for one in (skin, closed)]
    assert reach[1] < 0.8 * reach[0]


def test_a_heavier_person_is_wider_and_a_taller_one_longer() -> None:
    size = {
        (mass, height): np.ptp(
            fitted(person("female", mass, height)).posed(transforms(person("female", mass, height), {})), axis=0
        )
        for mass, height in ((60.0, 1.60), (80.0, 1.60), (60.0, 1.80))
    }
    assert np.all(size[80.0, 1.60][:2] > size[60.0, 1.60][:2])
    assert size[60.0, 1.80][2] / size[60.0, 1.60][2] == pytest.approx(1.80 / 1.60, rel=0.01)


def test_colours_are_those_of_the_zones(skin: Skin) -> None:
    assert skin.colours.shape == skin.vertices.shape
    assert len(np.unique(skin.colours, axis=0)) == 5


def test_a_subject_of_other_parts_has_the_same_skin_on_them(man: Body, skin: Skin) -> None:
    arm = fitted(describe(replace(man.subject, parts="right_arm")))
    assert arm.T_base_link[arm.links.index("r_elbow")] == pytest.approx(skin.T_base_link[skin.links.index("r_elbow")])


def test_the_sides_of_a_pair_have_regions_of_their_own(skin: Skin) -> None:
    assert {REGION_KEYS[index] for index in skin.region_keys} == set(REGION_KEYS)
    for side, sign in (("right", -1.0), ("left", 1.0)):
        own = skin.region_keys == REGION_KEYS.index(f"{side} lower arm, wrist")
        assert np.all(sign * skin.vertices[own, 1] > 0.0)


def test_a_region_has_the_colour_of_its_share(skin: Skin) -> None:
    colours = skin.region_colours({"chest": 1.0, "left lower leg": None})
    chest, shank = skin.region("chest"), skin.region_keys == REGION_KEYS.index("left lower leg")
    assert np.all(colours[chest] == shade(1.0)) and np.all(colours[shank] == shade(None))
    assert np.all(colours[~(chest | shank)] == skin.colours[~(chest | shank)])


def test_an_unknown_region_is_refused_with_the_known_ones(skin: Skin) -> None:
    with pytest.raises(HricError, match=r"lower arm, wrist.*right lower arm, wrist"):
        skin.region_colours({"lower arm, wrist": 0.5})


def test_a_part_is_closed_by_flat_faces(man: Body) -> None:
    part = fitted(person("male", 79.0, 1.75, "upper_body"))
    assert merged(part).is_watertight
    arms = part.weights[:, [name[:1] in "rl" for name in part.links]].sum(axis=1)
    assert part.vertices[arms == 0.0, 2].min() == pytest.approx(0.0, abs=1e-9)  # the height of the hips


def test_outlines_enclose_the_projected_surface(skin: Skin) -> None:
    front = outlines(skin, skin.vertices, back=False)
    back = outlines(skin, skin.vertices, back=True)
    x, y = np.concatenate([np.concatenate(loops) for loops in front.values()]).T
    low, high = skin.vertices.min(axis=0), skin.vertices.max(axis=0)
    assert [x.min(), x.max(), y.min(), y.max()] == pytest.approx([low[1], high[1], low[2], high[2]], abs=6e-3)
    assert np.mean(np.concatenate(front["left hand, fingers"]), axis=0)[0] > 0.0
    assert np.mean(np.concatenate(back["left hand, fingers"]), axis=0)[0] < 0.0
