"""Contacts of a gantry with a person beside their closed forms: a gantry's masses and forces are sums, axis by axis."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hric_assessment.contact.impact import Clamping, ClosedFormImpact, ExpectedContact, expected_contacts
from hric_bags.reader import ControlRecord, RunRecord
from hric_bags.records.human_record import HumanRecord
from hric_bags.records.root_record import RootRecord
from hric_human.body import describe
from hric_human.contact import ContactSeries, RegionContact
from hric_human.participant.settings import HumanSettings

MASSES, ROTORS = (3.0, 2.0, 4.0), (1.0, 0.5, 0.25)
"""Masses of the three carriages, each carried by the one before, and of the drives of their rails [kg]."""
MOVED = (9.0 + 1.0, 6.0 + 0.5, 4.0 + 0.25)
"""Mass that a push along x, y or z moves [kg]."""
PELVIS = 25e3
"""Spring of the standard's body model [N/m]."""
BEGIN = 1.0
RAILS = ("rail_x", "rail_y", "rail_z")
GANTRY = '<robot name="panda"><link name="base"/>' + "".join(
    f"""<link name="{child}"><inertial><mass value="{mass}"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="{rail}" type="prismatic"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>
      <limit lower="-9" upper="9" effort="999" velocity="9"/></joint>"""
    for rail, parent, child, axis, mass in zip(
        RAILS, ("base", "along", "across"), ("along", "across", "panda_hand"), ("1 0 0", "0 1 0", "0 0 1"), MASSES,
        strict=True,
    )
) + "</robot>"  # fmt: skip
RUN: dict[str, Any] = {
    "definition": {"human": {"parts": "upper_body"}, "robot": {"hw": "franka_sim/FrankaHWSim"}},
    "parameters": {"robot": {"plant": {"rotor_inertia": dict(zip(RAILS, ROTORS, strict=True)), "seed": 3}}},
}
BODY = describe(HumanSettings.of({"parts": "upper_body"}, "human").person)


def log(until: float = 6.0, **changes: Any) -> ControlRecord:
    """The gantry is pressed along by 30 N and 2 N/s, across by -10 N, and stands."""
    time = np.arange(0.0, until, 0.01)
    zeros = np.zeros((len(time), 3))
    command = np.column_stack([30.0 + 2.0 * time, -10.0 + 0.0 * time, 0.0 * time])
    made = ControlRecord(RAILS, ("effort",) * 3, time, zeros, zeros, zeros, command, command, 0, (), ())
    return replace(made, **changes)


def person(**changes: Any) -> HumanRecord:
    time, joints = np.arange(0.0, 6.0, 0.02), tuple(BODY.joints)
    none = np.zeros((1, len(joints)))
    made = HumanRecord(joints, time, np.zeros((len(time), len(joints))), time[:1], none, none, {}, name="/hric/human")
    return replace(made, **changes)


def met(duration: float = 0.01, count: int = 11, force: float = 40.0, **changes: Any) -> RegionContact:
    """A contact with the pelvis along (0.6, 0.8, 0)."""
    time = BEGIN + np.linspace(0.0, duration, count)
    level, normal = np.full(count, force), np.tile([0.6, 0.8, 0.0], (count, 1))
    series = ContactSeries(time, level, np.maximum.accumulate(level), time, time - BEGIN, np.zeros((count, 3)), normal)
    about: dict[str, Any] = {
        "begin_point": (0.0, 0.0, 0.0),
        "begin_normal": (0.6, 0.8, 0.0),
        "begin_speed": 0.5,
        "series": series,
    }
    about |= {"peak": force, "peak_time": BEGIN, "impulse": force * duration, "duration": duration}
    about |= {"regions": ("pelvis",), "link": "waist", "other": "panda::panda_hand", "kind": "penalty", "begin": BEGIN}
    return RegionContact(**about | changes)


def beside(
    contact: RegionContact, run: dict[str, Any] = RUN, robot: ControlRecord | None = None, **known: Any
) -> ExpectedContact:
    (found,) = expected_contacts(run, GANTRY, RunRecord(robot or log()), person(region_contacts=[contact], **known))
    assert found.contact is contact
    return found


@pytest.mark.parametrize("normal", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.6, 0.8, 0.0)])
def test_a_blow_on_a_pelvis_that_is_fixed_has_the_mass_that_the_gantry_has_along_it(normal: tuple[float, ...]) -> None:
    form = beside(met(begin_normal=normal)).impact
    mass = 1.0 / sum(n * n / m for n, m in zip(normal, MOVED, strict=True))
    assert form is not None and (form.speed, form.human_mass) == (0.5, math.inf)
    assert form.stiffness == pytest.approx(PELVIS)
    assert form.robot_mass == pytest.approx(mass)
    assert form.peak == pytest.approx(0.5 * math.sqrt(mass * PELVIS))
    assert form.duration == pytest.approx(math.pi * math.sqrt(mass / PELVIS))
    assert form.impulse == pytest.approx(2.0 * mass * 0.5)


def walking() -> tuple[dict[str, Any], RootRecord]:
    """Figures of a run with a person who walks, and where they were."""
    human = {"parts": "upper_body", "walk": {"points": [[0, 0, 0]]}}
    pose = np.tile([1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], (2, 1))
    return RUN | {"definition": RUN["definition"] | {"human": human}}, RootRecord(np.array([0.0, 6.0]), pose)


def test_a_person_who_walks_gives_way_but_not_with_more_than_all_of_them() -> None:
    run, root = walking()
    form = beside(met(), run, root=root).impact
    assert form is not None and BODY.segments["pelvis"].mass.mass < form.human_mass < 1.02 * BODY.total_mass


def wrist(turn: float, shift: tuple[float, float], q: np.ndarray, **known: Any) -> float:
    """Mass of the right wrist [kg] of a person who is turned about z by an angle [rad] and stands elsewhere [m]."""
    at, along = np.array([0.25, -0.2]), np.array([0.6, 0.8])
    R = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    human = {"parts": "upper_body", "heading": turn, "position": list(shift)}
    run = RUN | {"definition": RUN["definition"] | {"human": human | known.pop("settings", {})}}
    contact = met(link="r_wrist", begin_point=(*(R @ at + shift), 0.1), begin_normal=(*(R @ along), 0.0))
    form = beside(contact, run, position=q, **known).impact
    assert form is not None
    return form.human_mass


def angles(value: float) -> np.ndarray:
    return np.full((300, len(BODY.joints)), value)


def test_the_mass_of_a_wrist_does_not_depend_on_where_the_person_stands_and_looks() -> None:
    arm = sum(BODY.segments[f"right_{name}"].mass.mass for name in ("upper_arm", "forearm", "hand"))
    mass = wrist(0.0, (0.0, 0.0), angles(0.3))
    assert 0.0 < mass < arm
    assert wrist(1.1, (2.0, -1.0), angles(0.3)) == pytest.approx(mass)
    assert wrist(0.0, (0.0, 0.0), angles(0.5)) != pytest.approx(mass, rel=0.01)


def test_the_mass_is_that_of_the_joints_when_they_met() -> None:
    rising = np.outer(np.arange(300) * 0.02, np.full(len(BODY.joints), 0.3))  # 0.3 rad at 1 s
    assert wrist(0.0, (0.0, 0.0), rising) == pytest.approx(wrist(0.0, (0.0, 0.0), angles(0.3)))


def walker(start: list[float], here: list[float]) -> float:
    """Mass of the right wrist [kg] of a person who was spawned at a place [m], is at another now, and is met there."""
    human = {"parts": "upper_body", "heading": 0.0, "position": start}
    height = HumanSettings.of(human, "human").root(BODY).position[2]
    root = RootRecord(np.array([0.0, 6.0]), np.tile([*here, height, 0.0, 0.0, 0.0, 1.0], (2, 1)))
    run = RUN | {"definition": RUN["definition"] | {"human": human | {"walk": {"points": [[0, 0, 0]]}}}}
    contact = met(link="r_wrist", begin_point=(*np.add((0.25, -0.2), here), 0.1))
    form = beside(contact, run, position=angles(0.3), root=root).impact
    assert form is not None
    return form.human_mass


def test_who_walked_gives_way_alike_wherever_they_came_from_and_are() -> None:
    mass = walker([0.0, 0.0], [0.0, 0.0])
    assert walker([0.0, 0.0], [1.0, -0.5]) == pytest.approx(mass)
    assert walker([0.4, 0.2], [1.0, -0.5]) == pytest.approx(mass)


def test_a_person_who_stands_gives_way_alike_whether_or_not_their_root_was_recorded() -> None:
    assert beside(met(), root=walking()[1]).impact == beside(met()).impact


def test_a_person_who_walks_and_was_nowhere_has_no_closed_form() -> None:
    assert beside(met(), walking()[0]).impact is None


@pytest.mark.parametrize(
    "changes",
    [
        {"kind": "rigid"},
        {"other": "wall::link"},
        {"other": "panda::nothing"},
        {"link": "nothing"},
        {"begin_point": None},
        {"begin_normal": None},
        {"begin_speed": None},
        {"begin_speed": 0.0},
        {"begin_speed": -0.1},
        {"begin": 9.0},
    ],
    ids=str,
)
def test_there_is_no_closed_form_of_what_is_not_known(changes: dict[str, Any]) -> None:
    assert beside(met(**changes)).impact is None


def test_there_is_no_closed_form_without_a_record_of_arm_and_person_at_the_time() -> None:
    late = log(0.5)
    assert beside(met(), robot=late).impact is None
    assert beside(met(), time=np.empty(0), position=np.zeros((0, len(BODY.joints)))).impact is None
    times = np.array([0.0, 0.5])
    assert beside(met(), time=times, position=np.zeros((2, len(BODY.joints)))).impact is None


def test_two_bodies_that_are_both_fixed_there_have_no_closed_form() -> None:
    assert beside(met(other="panda::base")).impact is None


def test_what_damps_the_surfaces_has_no_closed_form_and_a_spring_of_the_robot_is_in_series() -> None:
    def with_surface(surface: dict[str, Any]) -> dict[str, Any]:
        plant = RUN["parameters"]["robot"]["plant"] | {"surfaces": [{"link": "panda::*", **surface}]}
        return RUN | {"parameters": {"robot": {"plant": plant}}}

    assert beside(met(), with_surface({"contact": "penalty", "stiffness": 1e4, "damping": 5.0})).impact is None
    alike = with_surface({"contact": "penalty"})
    alike["parameters"]["robot"]["plant"]["contact_stiffness"] = 1e4
    assert beside(met(), alike).impact == beside(met(), with_surface({"contact": "penalty", "stiffness": 1e4})).impact
    form = beside(met(), with_surface({"contact": "penalty", "stiffness": 1e4})).impact
    assert form is not None and form.stiffness == pytest.approx(1.0 / (1.0 / 1e4 + 1.0 / PELVIS))


def test_a_surface_of_the_world_file_counts_like_one_of_the_plants_parameters(tmp_path: Path) -> None:
    def with_plant(changes: dict[str, Any]) -> dict[str, Any]:
        return RUN | {"parameters": {"robot": {"plant": RUN["parameters"]["robot"]["plant"] | changes}}}

    surfaces = {"surfaces": [{"link": "panda::*", "contact": "penalty", "stiffness": 1e4}]}
    world = tmp_path / "world.yaml"
    world.write_text(yaml.safe_dump(surfaces))
    form = beside(met(), with_plant({"world": str(world)})).impact
    assert form == beside(met(), with_plant(surfaces)).impact and form != beside(met()).impact


def test_a_press_is_balanced_by_the_part_of_the_command_along_the_normal() -> None:
    press = beside(met(3.0, 301)).clamping
    assert press is not None and len(press.time) == 150
    assert (press.time[0], press.time[-1]) == (BEGIN, BEGIN + 3.0) and np.diff(press.time).max() < 0.031
    np.testing.assert_allclose(press.balanced, 0.6 * (30.0 + 2.0 * press.time) - 0.8 * 10.0)
    assert set(press.force) == {40.0}


@pytest.mark.parametrize(
    ("duration", "count", "lasts"), [(0.5, 51, True), (0.49, 51, False), (3.0, 30, True), (3.0, 29, False)]
)
def test_a_contact_of_half_a_second_is_a_press_if_it_has_ten_messages_a_second(
    duration: float, count: int, lasts: bool
) -> None:
    assert (beside(met(duration, count)).clamping is not None) == lasts


def test_what_is_not_commanded_by_torque_or_does_not_carry_itself_has_no_press() -> None:
    by_position = log(interfaces=("position",) * 3)
    mixed = log(by_effort=np.zeros((600, 3), np.bool_))
    bare = RUN | {"definition": RUN["definition"] | {"robot": {"hw": "hric_control/RobotHW"}}}
    assert [beside(met(1.0, 101), robot=one).clamping for one in (by_position, mixed)] == [None, None]
    unknown = RUN | {"definition": {"human": {"parts": "upper_body"}}}
    assert [beside(met(1.0, 101), run).clamping for run in (bare, unknown)] == [None, None]
    assert beside(met(1.0, 101), robot=log(by_effort=np.ones((600, 3), np.bool_))).clamping is not None


@pytest.mark.parametrize(("last", "end"), [(6.0, 3.0), (2.5, 2.5)])
def test_a_press_is_judged_two_seconds_after_the_touch_or_at_its_end_by_the_tenth_before(
    last: float, end: float
) -> None:
    time = np.arange(100, round(100 * last) + 1) / 100.0
    at, force, balanced = Clamping(time, time**2, 3.0 * time).level()
    before = end - 0.01 * np.arange(10)
    assert (at, force, balanced) == (end, pytest.approx((before**2).mean()), pytest.approx(3.0 * before.mean()))


def test_the_measured_peak_is_the_first_and_a_later_one_does_not_count() -> None:
    time = np.array([0.0, 0.02, 0.04, 0.5])
    reached = np.array([0.0, 60.0, 80.0, 300.0])
    series = replace(met(0.5, 4).series, time=BEGIN + time, force=reached, reached=reached)
    form = ClosedFormImpact(0.5, 8.0, 8.0, math.pi**2 * 4.0 / 0.03**2)  # lasts for 0.03 s
    assert form.duration == pytest.approx(0.03)
    contact = met(0.5, 4, peak=300.0, series=series)
    assert ExpectedContact(contact, form, None).peak == 80.0
    assert ExpectedContact(replace(contact, series=replace(series, time=BEGIN + 0.01 * time)), form, None).peak == 300.0
    assert ExpectedContact(contact, None, None).peak is None


def test_a_contact_that_ended_before_its_form_and_states_no_peak_is_not_compared() -> None:
    assert (
        ExpectedContact(met(1e-3, peak=None), ClosedFormImpact(0.5, 8.0, 8.0, 16e3), None).values()["transient"] is None
    )


def test_a_foot_has_no_spring() -> None:
    whole = describe(HumanSettings.of({"parts": "whole_body"}, "human").person)
    run = RUN | {"definition": RUN["definition"] | {"human": {"parts": "whole_body"}}}
    q = np.zeros((300, len(whole.joints)))
    found = beside(met(link="r_ankle", regions=()), run, joints=tuple(whole.joints), position=q)
    assert found.impact is None


def test_the_first_message_is_as_late_as_the_half_sine_needs_for_its_force() -> None:
    form = ClosedFormImpact(0.5, 8.0, 8.0, 16e3)
    later = form.duration / 6.0  # half of the peak
    series = replace(met(0.01, 2).series, force=np.array([0.5 * form.peak, form.peak]))
    assert ExpectedContact(met(series=series), form, None).late() == pytest.approx(later)
    above = replace(series, force=np.array([2.0 * form.peak, form.peak]))
    assert ExpectedContact(met(series=above), form, None).late() == pytest.approx(0.5 * form.duration)
    nothing = replace(series, force=np.empty(0))
    assert ExpectedContact(met(series=nothing), form, None).late() == ExpectedContact(met(), None, None).late() == 0.0


def test_the_values_of_a_contact_are_what_was_recorded_and_what_was_expected() -> None:
    form = ClosedFormImpact(0.5, 8.0, 8.0, 16e3)
    time = np.arange(0.0, 3.0, 0.05)
    values = ExpectedContact(met(force=50.0), form, Clamping(time, 30.0 + 0.0 * time, 20.0 + 0.0 * time)).values()
    assert (values["link"], values["speed"], "series" in values) == ("waist", 0.5, False)
    peak = 0.5 * math.sqrt(4.0 * 16e3)
    expected = {"speed": 0.5, "robot_mass": 8.0, "human_mass": 8.0, "stiffness": 16e3, "mass": 4.0, "peak": peak}
    expected |= {"duration": math.pi * math.sqrt(4.0 / 16e3), "impulse": 4.0}
    expected |= {"measured_peak": 50.0, "ratio": 50.0 / peak}
    assert values["transient"] == pytest.approx(expected)
    assert values["press"] == pytest.approx({"time": 2.0, "force": 30.0, "balanced": 20.0, "ratio": 1.5})
    assert (
        ExpectedContact(met(), None, None).values()["transient"]
        is ExpectedContact(met(), None, None).values()["press"]
        is None
    )


@pytest.mark.parametrize("changes", [{"description": ""}, {"contact": met(kind="rigid")}, {"joints": ("nobody",)}])
def test_contacts_are_reported_all_the_same_where_nothing_can_be_expected(changes: dict[str, Any]) -> None:
    contacts = [changes.get("contact", met()), met(kind="rigid")]
    human = person(region_contacts=contacts, **{k: v for k, v in changes.items() if k == "joints"})
    found = expected_contacts(RUN, changes.get("description", GANTRY), RunRecord(log()), human)
    assert [(one.contact, one.impact, one.clamping) for one in found] == [(contact, None, None) for contact in contacts]
