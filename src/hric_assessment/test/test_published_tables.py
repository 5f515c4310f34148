"""Every cell of the files in config/tables is the one that was noted from the sources."""

from pathlib import Path

import numpy as np
import published_tables as published
import pytest

from hric_assessment.contact.limits import Limits
from hric_assessment.contact.speed import speed_limit
from hric_assessment.ergonomics import rula
from hric_assessment.tables import (
    FOOT,
    MARKS,
    limit_table,
    niosh_table,
    reba_table,
    rula_table,
)
from hric_core.errors import ParameterError
from hric_human.body.regions import REGION_MODELS

ISO, BGIA = limit_table("iso_ts_15066"), limit_table("bgia2011")
MARK = dict(zip(("C2", "C", "U"), MARKS, strict=False))
BGIA_NAMES = {
    "skull-forehead": ("skull, forehead", None),
    "face": ("face", None),
    "neck side-nape": ("neck", "side, nape"),
    "neck front-larynx": ("neck", "front, larynx"),
    "back-shoulder": ("back, shoulders", None),
    "chest": ("chest", None),
    "abdomen": ("abdomen", None),
    "pelvis": ("pelvis", "pelvis"),
    "buttock": ("pelvis", "buttock"),
    "upper arm-elbow": ("upper arm, elbow", None),
    "lower arm-wrist": ("lower arm, wrist", None),
    "hand-finger": ("hand, fingers", None),
    "thigh-knee": ("thigh, knee", None),
    "lower leg": ("lower leg", None),
    "foot-toe-ankle": (FOOT, None),
}


def test_annex_a_has_its_29_areas_with_pressure_force_and_mark() -> None:
    found = []
    for row in ISO.pressures:
        (force,) = ISO.force_rows(row.region, row.area)
        transient = force.transient_by(ISO.force_factor)
        shown = "none" if transient is None else f"{transient:g}"
        values = (f"{row.quasi_static:g}", f"{force.quasi_static:g}", shown, ISO.mark_of(row))
        found.append((str(row.number), row.region, *values))
    expected = [
        (n, region, p, f, t, MARK[state]) for n, region, _, p, f, t, state in published.cells(published.ANNEX_A)
    ]
    assert found == expected


def test_annex_a_has_its_areas_by_name_and_hand() -> None:
    words = {
        "seventh neck (C7)": "seventh neck vertebra",
        "deltoid": "deltoid muscle",
        "back of hand": "back of the hand",
    }
    for row, (_, _, area, *_) in zip(ISO.pressures, published.cells(published.ANNEX_A), strict=True):
        name, _, side = area.partition(", ")
        hand = {"dominant": "dominant", "non-dominant": "other", "": None}[side]
        assert (row.area, row.hand) == (words.get(name, name), hand)


def test_a_transient_pressure_is_twice_the_other_but_for_skull_and_face() -> None:
    ratios = {row.region: row.transient_by(ISO.pressure_factor) for row in ISO.pressures}
    assert {region for region, transient in ratios.items() if transient is None} == {"skull, forehead", "face"}
    assert all(row.transient_by(2.0) in (None, 2.0 * row.quasi_static) for row in ISO.pressures)


def test_the_table_and_the_body_model_have_the_same_twelve_regions() -> None:
    assert [row.region for row in ISO.forces] == list(REGION_MODELS)
    assert len(REGION_MODELS) == 12


@pytest.mark.parametrize("row", published.cells(published.BODY_MODEL), ids=lambda row: row[0])
def test_the_body_model_gives_the_energy_and_the_speeds_that_follow_from_it(row: list[str]) -> None:
    region, spring, mass, force, energy, *speeds = row
    assert REGION_MODELS[region] == (1e3 * float(spring), float(mass))
    found = speed_limit(Limits(ISO), region, np.array([2.0, 4.0, 6.0, 8.0, 10.0, 15.0]))
    head = found.force_transient is None
    used = found.force_quasi_static if head else found.force_transient
    assert (f"{used:g}", f"{found.energy:.3f}") == (force, energy)
    assert [f"{speed:.2f}" for speed in (found.quasi_static if head else found.transient)] == speeds
    assert np.all(found.transient == 0.0) == head == (region in ("skull, forehead", "face"))


def test_the_older_set_has_its_15_regions() -> None:
    found = {}
    for (region, area), force in zip(BGIA_NAMES.values(), BGIA.forces, strict=True):
        assert (force.region, force.area) == (region, area)
        (pressure,) = BGIA.pressure_rows(region, area)
        found[region, area] = [force.quasi_static, force.transient, pressure.quasi_static, force.stiffness]
        assert pressure.transient_by(BGIA.pressure_factor) == pressure.quasi_static
    assert found == {BGIA_NAMES[name]: values for name, values in published.bgia().items()}


def test_rula_a_has_its_144_cells_in_both_versions() -> None:
    for version in rula.VERSIONS:
        found = {tuple(map(int, key.split(","))): list(row) for key, row in rula.table_a(rula_table(), version).items()}
        assert found == published.rula_a(older=version == "older")
        assert sum(map(len, found.values())) == 144


@pytest.mark.parametrize(
    ("found", "expected", "count"),
    [
        (rula_table().table_b, published.by_row(published.RULA_B), 72),
        (rula_table().table_c, published.by_row(published.RULA_C), 56),
        (reba_table().table_a, published.reba_a(), 60),
        (reba_table().table_b, published.reba_b(), 36),
        (reba_table().table_c, published.by_row(published.REBA_C), 144),
    ],
    ids=["rula b", "rula c", "reba a", "reba b", "reba c"],
)
def test_the_tables_of_scores_have_their_cells(
    found: dict[str, tuple[int, ...]], expected: dict[int, list[int]], count: int
) -> None:
    assert {int(key): list(row) for key, row in found.items()} == expected
    assert sum(map(len, found.values())) == count


def test_niosh_has_its_frequency_multipliers() -> None:
    assert {row[0]: list(row[1:]) for row in niosh_table().frequencies} == published.niosh_frequency()


def test_niosh_has_its_constants_with_their_marks() -> None:
    table = niosh_table()
    assert {name: value.value for name, value in table.values.items()} == {
        "load_constant": 23,
        "horizontal": 25,
        "horizontal_limit": 63,
        "vertical": 75,
        "vertical_slope": 0.003,
        "vertical_limit": 175,
        "distance_offset": 0.82,
        "distance_slope": 4.5,
        "distance": 25,
        "distance_limit": 175,
        "asymmetry_slope": 0.0032,
        "asymmetry_limit": 135,
        "speed_limit": 0.76,
        "design_goal": 1,
        "high": 3,
    }
    assert table.couplings == {"good": (1.0, 1.0), "fair": (0.95, 1.0), "poor": (0.9, 0.9)}
    unconfirmed = [name for name, value in table.values.items() if table.mark_of(value) == "unconfirmed"]
    assert unconfirmed == ["horizontal_limit", "vertical_limit", "distance_limit"]


def test_both_versions_of_rula_a_differ_in_30_cells_the_current_one_by_up_to_2_higher() -> None:
    current, older = (np.array(list(rula.table_a(rula_table(), version).values())) for version in rula.VERSIONS)
    difference = current - older
    assert np.count_nonzero(difference) == 30
    assert (difference.min(), difference.max()) == (0, 2)


def test_both_versions_of_rula_a_change_92_of_1008_grand_scores() -> None:
    c = np.array(list(rula_table().table_c.values()))
    current, older = (np.array(list(rula.table_a(rula_table(), version).values())) for version in rula.VERSIONS)
    grand = [c[np.minimum(a.ravel(), 8) - 1] for a in (current, older)]
    assert grand[0].size == 1008
    assert np.count_nonzero(grand[0] != grand[1]) == 92


@pytest.mark.parametrize("table", [rula_table(), reba_table()], ids=["rula", "reba"])
def test_no_score_falls_where_a_part_scores_more_so_that_the_least_of_each_part_gives_the_least_score(table) -> None:
    a, b, c = ((6, 3, 4, 2), (6, 6, 2), (8, 7)) if table.title == "RULA" else ((3, 5, 4), (6, 2, 3), (12, 12))
    for rows, sizes in ((table.table_a, a), (table.table_b, b), (table.table_c, c)):
        cells = np.array(list(rows.values())).reshape(sizes)
        assert all(np.diff(cells, axis=axis).min() >= 0 for axis in range(cells.ndim))


OWN = """
title: measured on our line
edition: 2026
sources: {us: our own measurement}
source: us
force_factor: 2
pressure_factor: 2
forces:
  - {region: "hand, fingers", quasi_static: 90}
pressures:
  - {region: "hand, fingers", area: palm, quasi_static: 150}
"""


def test_a_users_file_takes_the_place_of_a_table_and_is_named(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(OWN)
    table = limit_table(path)
    assert table.name == "measured on our line (2026)"
    limit = Limits(table).at(("hand, fingers",))
    assert limit is not None and limit.pressure is not None
    assert (limit.force.transient, limit.pressure.quasi_static, limit.force.mark) == (180.0, 1.5e6, "unconfirmed (us)")
    assert Limits(table).at(("chest",)) is None


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            '{region: "hand, fingers", quasi',
            "{region: hand, quasi",
            r"forces\[0\]\.region is 'hand'; valid: 'skull, fore",
        ),
        ("quasi_static: 90", "quasi_static: -90", r"forces\[0\]\.quasi_static is -90; valid: a finite number above 0"),
        ("area: palm", "aera: palm", r"no parameter 'aera' in own.yaml: pressures\[0\].*\(did you mean area\?\)"),
        ("source: us", "source: them", r"no source 'them' in own.yaml; valid: us"),
        ("force_factor: 2\n", "", r"forces\[0\]\.transient is None; valid: a number, none, or a force_factor"),
        (
            '- {region: "hand, fingers", area',
            "- {region: chest, area",
            r"pressures\[0\]\.region is 'chest'; valid: a reg",
        ),
        (
            "pressures:",
            '  - {region: "hand, fingers", quasi_static: 80}\npressures:',
            r"valid: each region, area and hand",
        ),
        ("title: measured on our line\n", "", r"title is not set"),
        (
            '{region: "hand, fingers", quasi',
            '{region: "foot, toes, ankle", quasi',
            r"forces\[0\]\.stiffness is None; valid",
        ),
        (
            '{region: "hand, fingers", quasi',
            "{quasi",
            r"forces\[0\]\.region is not set; valid: 'skull, forehead', 'face'",
        ),
    ],
)
def test_a_mistake_in_a_users_file_is_one_error_with_what_is_valid(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    assert before in OWN
    path = tmp_path / "own.yaml"
    path.write_text(OWN.replace(before, after))
    with pytest.raises(ParameterError, match=message):
        limit_table(path)


def test_all_mistakes_of_a_users_file_come_at_once(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(OWN.replace("quasi_static: 90", "quasi_static: x").replace("edition: 2026", "edition: []"))
    with pytest.raises(ParameterError) as caught:
        limit_table(path)
    assert len(str(caught.value).splitlines()) == 2


def test_an_unknown_set_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(ParameterError, match=r"no limits 'bgia'.* valid: a YAML file, bgia2011, iso_ts_15066"):
        limit_table("bgia")
