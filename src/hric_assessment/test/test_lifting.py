"""The NIOSH equation: multipliers, printed examples, scope, and public errors."""

import math
from dataclasses import replace

import pytest

from hric_assessment.ergonomics.niosh import Lift, LiftRating, rate
from hric_assessment.findings import NotAssessableError
from hric_core.errors import HricError

POUND_CONSTANT = 51.0
"""Load constant of the manual's examples [lb]."""
BEST = Lift("pick-up", 10.0, 0.25, 0.75, 0.25)
STEP = 1e-3
PICK = Lift("pick-up", 10.0, 0.25, 0.55, 0.925, frequency=3.0, coupling="fair")
"""Example 4 of the manual (p. 46) in cm: its multipliers are those of its inches times 2.5."""
PUT = replace(PICK, phase="put-down", horizontal=0.50, vertical=1.475)


def pounds(rated: LiftRating, rounded: bool) -> float:
    return (rated.rounded_limit if rounded else rated.limit) / 23.0 * POUND_CONSTANT


def test_the_best_lift_has_the_load_constant_as_its_limit() -> None:
    found = rate(BEST)
    assert tuple(found.multipliers) == (1.0,) * 6
    assert (found.limit, found.index) == (23.0, pytest.approx(10.0 / 23.0))


@pytest.mark.parametrize(
    ("field", "values", "multiplier", "expected"),
    [
        ("horizontal", (0.25 - STEP, 0.25, 0.25 + STEP), "horizontal", (1.0, 1.0, 25.0 / 25.1)),
        ("horizontal", (0.63 - STEP, 0.63, 0.63 + STEP), "horizontal", (25.0 / 62.9, 25.0 / 63.0, 0.0)),
        ("vertical", (0.75 - STEP, 0.75, 0.75 + STEP), "vertical", (0.9997, 1.0, 0.9997)),
        ("vertical", (1.75 - STEP, 1.75, 1.75 + STEP), "vertical", (1 - 0.003 * 99.9, 0.7, 0.0)),
        ("distance", (0.25 - STEP, 0.25, 0.25 + STEP), "distance", (1.0, 1.0, 0.82 + 4.5 / 25.1)),
        ("distance", (1.75 - STEP, 1.75, 1.75 + STEP), "distance", (0.82 + 4.5 / 174.9, 0.82 + 4.5 / 175, 0.0)),
        ("asymmetry", tuple(map(math.radians, (134.9, 135.0, 135.1))), "asymmetry", (1 - 0.0032 * 134.9, 0.568, 0.0)),
        ("frequency", (0.1, 0.2, 0.35), "frequency", (1.0, 1.0, 0.985)),
        ("frequency", (14.9, 15.0, 15.1), "frequency", (0.283, 0.28, 0.0)),
        ("duration", (3599.0, 3600.0, 3601.0), "frequency", (1.0, 1.0, 0.95)),
        ("duration", (7199.0, 7200.0, 7201.0), "frequency", (0.95, 0.95, 0.85)),
    ],
)
def test_a_multiplier_one_step_below_on_and_above_a_threshold(
    field: str, values: tuple[float, ...], multiplier: str, expected: tuple[float, ...]
) -> None:
    found = [getattr(rate(replace(BEST, **{field: value})).multipliers, multiplier) for value in values]
    assert found == pytest.approx(list(expected), abs=1e-12)


@pytest.mark.parametrize(("coupling", "low", "high"), [("good", 1.0, 1.0), ("fair", 0.95, 1.0), ("poor", 0.9, 0.9)])
def test_a_coupling_changes_where_the_hands_are_at_75_cm(coupling: str, low: float, high: float) -> None:
    found = [rate(replace(BEST, vertical=v, coupling=coupling)).multipliers.coupling for v in (0.749, 0.75, 0.751)]
    assert found == [low, high, high]


def test_the_frequencies_of_9_lifts_a_minute_and_more_change_at_75_cm_too() -> None:
    long = replace(BEST, frequency=9.0, duration=8 * 3600.0)
    assert [rate(replace(long, vertical=v)).multipliers.frequency for v in (0.7, 0.75)] == [0.0, 0.15]


@pytest.mark.parametrize(("lift", "printed", "full"), [(PICK, 34.9, 34.8), (PUT, 15.2, 15.3)])
def test_rounded_multipliers_give_the_manuals_printed_limit_beside_the_one_at_full_precision(
    lift: Lift, printed: float, full: float
) -> None:
    found = rate(lift)
    assert round(pounds(found, rounded=True), 1) == printed
    assert round(pounds(found, rounded=False), 1) == full


def test_halves_of_a_hundredth_are_rounded_upwards() -> None:
    found = rate(replace(BEST, vertical=1.60, load=1.0))
    assert found.multipliers.vertical == pytest.approx(0.745)
    assert found.rounded_limit == pytest.approx(23.0 * 0.75)


def test_the_manuals_multipliers_are_those_of_its_worksheet() -> None:
    assert [f"{one:.2f}" for one in rate(PICK).multipliers] == ["1.00", "0.94", "0.87", "1.00", "0.88", "0.95"]


@pytest.mark.parametrize(
    ("load", "level"),
    [
        (22.9, "up to the design goal of 1"),
        (23.0, "up to the design goal of 1"),
        (23.1, "above the design goal"),
        (68.9, "above the design goal"),
        (69.0, "above the design goal"),
        (69.1, "high"),
    ],
)
def test_an_index_one_step_below_on_and_above_its_levels(load: float, level: str) -> None:
    assert rate(replace(BEST, load=load)).level == level


def test_a_limit_of_nothing_gives_an_infinite_index() -> None:
    assert rate(replace(BEST, horizontal=0.7)).index == math.inf


def test_a_limit_below_a_kilogram_gives_the_ratio_as_any_other() -> None:
    """The lift that is the hardest of those that may be done: all multipliers at their last row."""
    turned = math.radians(135.0)
    found = rate(
        replace(BEST, load=2.0, horizontal=0.63, vertical=1.75, distance=1.75, asymmetry=turned, frequency=15.0)
    )
    limit = 23.0 * (25.0 / 63.0) * 0.7 * (0.82 + 4.5 / 175.0) * 0.568 * 0.28
    assert (found.limit, found.index) == (pytest.approx(limit), pytest.approx(2.0 / limit)) and limit < 1.0


# Public code has these errors.


def test_hands_further_than_63_cm_away_may_lift_nothing() -> None:
    assert rate(replace(BEST, horizontal=0.64)).limit == 0.0


def test_a_frequency_between_two_rows_lies_between_their_multipliers() -> None:
    assert rate(replace(BEST, frequency=5.5)).multipliers.frequency == pytest.approx(0.775)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"phase": "carrying"}, r"phase is carrying; valid: pick-up, put-down \(carrying, pushing, pulling"),
        ({"hands": 1}, "hands is 1; valid: 2"),
        ({"position": "seated"}, "position is seated; valid: standing"),
        ({"position": "kneeling"}, "position is kneeling; valid: standing"),
        ({"stable": False}, "stable is False; valid: a load that does not shift"),
        ({"duration": 8.1 * 3600}, "duration is 8.1 h; valid: up to 8 h"),
        ({"speed": 0.77}, "speed is 0.77; valid: up to 0.76 m/s"),
    ],
)
def test_what_is_outside_the_scope_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(NotAssessableError, match=f"outside the scope of the NIOSH lifting equation: {message}"):
        rate(replace(BEST, **change))


def test_all_reasons_for_a_refusal_come_at_once() -> None:
    with pytest.raises(NotAssessableError) as caught:
        rate(replace(BEST, phase="pushing", hands=1, speed=2.0))
    assert len(str(caught.value).splitlines()) == 3


@pytest.mark.parametrize("speed", [0.5, 0.76, -0.76])
def test_a_speed_within_the_scope_is_rated_and_an_unknown_one_is_said(speed: float) -> None:
    assert rate(replace(BEST, speed=speed)).assumptions == ()
    assert rate(BEST).assumptions == ("speed is not known: assumed up to 0.76 m/s",)


def test_the_rounded_index_is_the_load_over_the_rounded_limit() -> None:
    found = rate(PICK)
    assert found.rounded_index == pytest.approx(PICK.load / found.rounded_limit)
    assert found.rounded_index != found.index


@pytest.mark.parametrize("value", [-0.1, math.inf, math.nan])
@pytest.mark.parametrize("name", ["load", "horizontal", "vertical", "distance", "asymmetry", "frequency", "duration"])
def test_a_length_or_load_that_no_lift_has_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(HricError, match=f"{name} of a lift is {value}; valid: a finite number of 0 or more"):
        rate(replace(BEST, **{name: value}))


def test_values_that_no_lift_has_are_refused() -> None:
    with pytest.raises(HricError, match="load of a lift is nan"):
        rate(replace(BEST, load=math.nan))
    with pytest.raises(HricError, match="no coupling 'firm'; valid: good, fair, poor"):
        rate(replace(BEST, coupling="firm"))
