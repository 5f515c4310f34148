"""Contacts of a body by regions, of contacts that are written here; those of engines are in tests/plants."""

from dataclasses import replace

import pytest
from bodies import body

from hric_control.plant import Contact
from hric_human.body import surfaces
from hric_human.body.regions import REGION_MODELS, REGIONS, TISSUE_LAWS
from hric_human.contact import RegionContacts

BODY = body(parts="upper_body")
HAND, WRIST, TORSO = "panda::panda_hand", "human::r_wrist", "human::torso"


def touch(a: str, b: str, force: float = 0.0, kind: str = "penalty") -> Contact:
    return Contact(a, b, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1e-3, force, kind, 1e-3 * force)


@pytest.fixture
def touches() -> RegionContacts:
    return RegionContacts(BODY, "human")


def test_every_region_of_a_body_has_a_row_of_the_body_model() -> None:
    assert {name for names in REGIONS.values() for name in names} == set(REGION_MODELS)


def test_each_link_has_the_spring_of_its_region_but_for_the_foot() -> None:
    whole = body()
    stiffness = {link: surface.stiffness for link, surface in surfaces(whole).items()}
    assert set(whole.regions) - set(stiffness) == {"r_ankle", "l_ankle"}
    assert (stiffness["r_wrist"], stiffness["r_elbow"], stiffness["l_shoulder"]) == (75e3, 40e3, 30e3)
    assert (stiffness["torso"], stiffness["head"]) == (25e3, 150e3), "chest, and skull"


@pytest.mark.parametrize("law", TISSUE_LAWS)
def test_each_law_keeps_the_stiffness_of_a_region(law: str) -> None:
    surface = surfaces(BODY, law)["r_wrist"]
    assert surface.stiffness == 75e3
    assert (surface.dissipation > 0.0, surface.relaxing > 0.0) == (law == "hunt_crossley", law == "viscoelastic")


def test_the_largest_energy_of_a_contact_is_kept(touches: RegionContacts) -> None:
    for k, energy in enumerate((0.1, 0.3, 0.2)):
        touches.update(0.001 * k, [replace(touch(HAND, WRIST, 10.0), energy=energy)])
    assert touches.present[WRIST, HAND].energy == 0.3
    touches.update(0.01, [touch(HAND, TORSO, 10.0)])
    assert touches.present[TORSO, HAND].energy is None, "of a source that does not state it"


def test_nothing_touches_before_something_does(touches: RegionContacts) -> None:
    assert touches.update(0.0, []) == []
    assert touches.present == {}


def test_a_contact_has_its_peak_impulse_and_times_and_ends_once(touches: RegionContacts) -> None:
    for k, force in enumerate((10.0, 30.0, 20.0)):
        assert touches.update(0.001 * k, [touch(HAND, WRIST, force)]) == []
    present = touches.present[WRIST, HAND]
    assert (present.force, present.peak, present.peak_time) == (20.0, 30.0, 0.001)
    assert present.impulse == pytest.approx(0.06)
    assert touches.update(0.003, []) == [present]
    assert present.dominant
    assert (present.begin, present.end, present.duration) == (0.0, 0.002, 0.002)
    assert (present.link, present.other, present.regions) == ("r_wrist", HAND, ("hand, fingers",))
    assert touches.update(0.004, []) == []


def test_a_contact_is_where_it_was_last_and_remembers_where_how_and_how_fast_both_met(touches: RegionContacts) -> None:
    met, later = (Contact(HAND, WRIST, (x, 0.0, 0.0), (0.0, x, 1.0), 1e-3, 5.0, closing=x) for x in (0.5, 0.25))
    for k, contact in enumerate((met, later)):
        touches.update(0.001 * k, [replace(contact, kind="penalty")])
    found = touches.present[WRIST, HAND]
    assert (found.begin_point, found.begin_normal, found.begin_speed) == ((0.5, 0.0, 0.0), (0.0, -0.5, -1.0), 0.5)
    assert (found.point, found.normal) == ((0.25, 0.0, 0.0), (0.0, -0.25, -1.0))


def test_the_normal_is_that_of_the_force_on_the_body_however_the_engine_names_the_two(touches: RegionContacts) -> None:
    touches.update(0.0, [touch(WRIST, HAND, 1.0), touch("ball::link", WRIST, 1.0)])
    found = [touches.present[WRIST, other].normal for other in (HAND, "ball::link")]
    assert found == [(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)]


@pytest.mark.parametrize(("forces", "depths", "strongest"), [((3.0, 9.0), (2.0, 1.0), 1), ((0.0, 0.0), (2.0, 1.0), 0)])
def test_of_several_points_the_one_with_the_largest_force_counts_else_the_deepest(
    touches: RegionContacts, forces: tuple[float, float], depths: tuple[float, float], strongest: int
) -> None:
    points = [
        replace(touch(HAND, WRIST, force, "rigid"), position=(float(k), 0.0, 0.0), depth=depth)
        for k, (force, depth) in enumerate(zip(forces, depths, strict=True))
    ]
    touches.update(0.0, points)
    assert touches.present[WRIST, HAND].point == (float(strongest), 0.0, 0.0)


def test_who_meets_again_begins_a_new_contact(touches: RegionContacts) -> None:
    touches.update(0.0, [touch(HAND, WRIST, 10.0)])
    touches.update(0.001, [])
    touches.update(0.002, [touch(HAND, WRIST, 5.0)])
    assert (touches.present[WRIST, HAND].begin, touches.present[WRIST, HAND].peak) == (0.002, 5.0)


@pytest.mark.parametrize("bodies", [(HAND, WRIST), (WRIST, HAND)])
def test_the_order_in_which_an_engine_names_two_bodies_does_not_matter(
    touches: RegionContacts, bodies: tuple[str, str]
) -> None:
    touches.update(0.0, [touch(*bodies, 10.0)], {bodies: 12.0})
    assert touches.present[WRIST, HAND].peak == 12.0


def test_links_and_what_touches_them_are_kept_apart(touches: RegionContacts) -> None:
    touches.update(0.0, [touch(HAND, WRIST, 1.0), touch("ball::link", WRIST, 2.0), touch(HAND, TORSO, 3.0)])
    assert {pair: contact.force for pair, contact in touches.present.items()} == {
        (WRIST, HAND): 1.0,
        (WRIST, "ball::link"): 2.0,
        (TORSO, HAND): 3.0,
    }


def test_what_is_not_the_body_and_the_body_with_itself_are_left_out(touches: RegionContacts) -> None:
    touches.update(0.0, [touch(HAND, "table::link", 1.0), touch(TORSO, WRIST, 1.0), touch(HAND, "human2::r_wrist")])
    assert touches.present == {}


def test_a_rigid_pair_touches_without_a_force(touches: RegionContacts) -> None:
    points = [touch(HAND, WRIST, 900.0, "rigid"), touch(HAND, WRIST, 800.0, "rigid")]
    touches.update(0.0, points)
    touches.update(0.001, points)
    (ended,) = touches.update(0.002, [])
    assert (ended.kind, ended.duration) == ("rigid", 0.001)
    assert (ended.force, ended.peak, ended.peak_time, ended.impulse) == (None,) * 4


def test_a_peak_between_two_calls_counts_also_for_a_contact_that_has_parted(touches: RegionContacts) -> None:
    touches.update(0.0, [touch(HAND, WRIST, 10.0)])
    (ended,) = touches.update(0.01, [], {(HAND, WRIST): 25.0}, steps=10)
    assert (ended.peak, ended.peak_time, ended.end) == (25.0, 0.01, 0.0)


def test_what_met_and_parted_between_two_calls_ends_with_its_peak_alone(touches: RegionContacts) -> None:
    (ended,) = touches.update(0.01, [], {(HAND, WRIST): 25.0, (HAND, "table::link"): 3.0}, steps=10)
    assert (ended.link, ended.kind, ended.peak, ended.duration) == ("r_wrist", "penalty", 25.0, 0.0)
    assert ended.force is None and ended.impulse is None and ended.point is None
    assert touches.present == {}


def test_the_impulse_of_every_tenth_step_stands_for_ten(touches: RegionContacts) -> None:
    for k in range(5):
        touches.update(0.01 * k, [touch(HAND, WRIST, 10.0)], steps=10)
    assert touches.present[WRIST, HAND].impulse == pytest.approx(0.5)
