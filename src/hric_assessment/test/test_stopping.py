"""Stops by speed and load: never shorter than a row that was measured says, and files of the user's own."""

from pathlib import Path

import numpy as np
import pytest

from hric_assessment.findings import NotAssessableError
from hric_assessment.separation import stopping
from hric_assessment.separation.protective import protective_distance
from hric_assessment.separation.stopping import MEASUREMENT, SIMULATION, StopRow, StopTable
from hric_core.errors import HricError

ROWS = (
    StopRow(0.5, 0.0, 0.10, 0.02),
    StopRow(1.0, 0.0, 0.20, 0.08),
    StopRow(0.5, 3.0, 0.15, 0.03),
    StopRow(1.0, 3.0, 0.30, 0.12),
)


def table(rows: tuple[StopRow, ...] = ROWS, kind: str = MEASUREMENT, reaction_time: float = 0.02) -> StopTable:
    return StopTable(title="our arm", kind=kind, source="a stopwatch", reaction_time=reaction_time, stops=rows)


@pytest.mark.parametrize(
    ("speed", "load", "time", "distance"),
    [
        (0.5, 0.0, 0.10, 0.02),
        (0.501, 0.0, 0.20, 0.08),
        (0.1, 0.0, 0.10, 0.02),
        (0.5, 0.001, 0.15, 0.03),
        (0.75, 1.5, 0.30, 0.12),
    ],
)
def test_a_stop_is_that_of_the_next_row_above_in_speed_and_load(
    speed: float, load: float, time: float, distance: float
) -> None:
    stop = table().stop(speed, load)
    assert (float(stop.time), stop.distance) == (time, pytest.approx(distance))


def test_no_stop_is_shorter_than_one_of_a_slower_or_lighter_arm() -> None:
    """Fewer poses reach a high speed, so that a measured row may be below another that ought to be below it."""
    rows = (StopRow(0.5, 0.0, 0.4, 0.10), StopRow(1.0, 0.0, 0.3, 0.09), StopRow(1.0, 2.0, 0.2, 0.05))
    for speed, load in ((0.5, 0.0), (1.0, 0.0), (1.0, 2.0), (0.2, 1.0)):
        stop = table(rows).stop(speed, load)
        assert (float(stop.time), float(stop.distance)) == (0.4, 0.10)  # type: ignore[arg-type]


def test_any_table_is_monotone_and_above_its_rows() -> None:
    rng = np.random.default_rng(3)
    rows = tuple(
        StopRow(*pair, *rng.uniform(0.1, 1.0, 2)) for pair in {tuple(rng.integers(1, 9, 2) * 0.25) for _ in range(25)}
    )
    made = table(rows)
    for row in rows:
        stop = made.stop(row.speed, row.load)
        assert float(stop.time) >= row.time and float(stop.distance) >= row.distance  # type: ignore[arg-type]
        top = max(other.speed for other in rows if other.load >= row.load)
        times = made.stop(np.linspace(0.01, top, 50), row.load).time
        assert np.all(np.diff(times) >= 0.0)


def test_an_arm_that_stands_has_stopped() -> None:
    stop = table().stop(np.array([0.0, 0.4]), 0.0)
    assert np.asarray(stop.time).tolist() == [0.0, 0.10] and np.asarray(stop.distance).tolist() == [0.0, 0.02]


def test_a_row_without_a_distance_is_taken_as_moving_on_at_its_speed() -> None:
    assert float(table((StopRow(0.5, 0.0, 0.2),)).stop(0.5).distance) == pytest.approx(0.1)  # type: ignore[arg-type]


def test_a_stop_goes_into_the_protective_distance_with_the_time_of_perception() -> None:
    terms = protective_distance(1.0, 1.6, table().stop(1.0, 0.0, perception=0.08), 0.0, 0.0, 0.0)
    assert tuple(map(float, terms)) == pytest.approx((1.6 * (0.1 + 0.2), 1.0 * 0.1, 0.08, 0.0, 0.0, 0.0))


def test_no_instants_have_no_stops() -> None:
    stop = table().stop(np.array([]))
    assert np.shape(stop.time) == np.shape(stop.distance) == (0,)


def test_without_perception_the_reaction_is_the_arm_s_own() -> None:
    assert table(reaction_time=0.02).stop(0.5).reaction_time == pytest.approx(0.02)


@pytest.mark.parametrize(("speed", "load", "said"), [(3.0, 0.0, "up to 2 m/s with 0 kg"), (0.1, 3.1, "up to 3 kg")])
def test_nothing_is_extrapolated(speed: float, load: float, said: str) -> None:
    with pytest.raises(NotAssessableError, match=said):
        table((*ROWS, StopRow(2.0, 0.0, 0.5))).stop(np.array([0.0, speed]), load)


@pytest.mark.parametrize("given", [{"speed": -0.1}, {"speed": np.nan}, {"speed": 0.1, "load": -1.0}])
def test_a_speed_or_load_that_cannot_be_is_refused(given: dict[str, float]) -> None:
    with pytest.raises(HricError, match="valid: finite numbers of 0 or more"):
        table().stop(**given)


def test_a_table_comes_back_from_its_file(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    for kind in (MEASUREMENT, SIMULATION):
        text = stopping.as_yaml(table((*ROWS, StopRow(2.0, 1.0, 0.5)), kind))
        path.write_text(text)
        assert stopping.load(path) == table((*ROWS, StopRow(2.0, 1.0, 0.5)), kind)
        assert (stopping.NOT_A_BRAKE in path.read_text()) == (kind == SIMULATION)


def test_a_file_has_its_keys_in_the_order_of_the_manual_and_each_text_on_a_line_as_it_is() -> None:
    made = StopTable(
        title="größter Arm",
        kind=MEASUREMENT,
        source="a word " * 30,
        reaction_time=0.02,
        stops=(StopRow(0.5, 0.0, 0.1),),
    )
    lines = stopping.as_yaml(made).splitlines()
    assert [line.partition(":")[0] for line in lines[1:-1]] == ["title", "kind", "source", "reaction_time", "stops"]
    assert lines[1] == "title: größter Arm" and lines[3].count("a word") == 30


def test_a_table_of_a_simulation_says_so_wherever_it_is_named() -> None:
    assert "not of a real arm's brake" in stopping.load().name
    assert table().name == "our arm"


def test_a_wrong_file_gets_one_error_with_all_its_mistakes(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(
        "title: ours\nkind: guess\nsource: us\nreaction_time: -1\nstops: [{speed: 0, time: 0.1}, {speed: 1, tiem: 1}]\n"
    )
    with pytest.raises(HricError) as raised:
        stopping.load(path)
    for said in ("kind", "simulation, measurement", "reaction_time", "stops[0].speed", "tiem"):
        assert said in str(raised.value)


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("[]", r"own.yaml: stops is \[\]; valid: one row or more"),
        (
            "[{speed: 1, load: 2, time: 1}, {speed: 1, load: 2, time: 2}]",
            r"own.yaml: stops\[1\] is '1 m/s with 2 kg'; valid: each pair once",
        ),
    ],
)
def test_rows_that_are_missing_or_twice_are_refused(rows: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(f"title: ours\nkind: measurement\nsource: us\nreaction_time: 0.1\nstops: {rows}\n")
    with pytest.raises(HricError, match=said):
        stopping.load(path)


def test_the_table_that_ships_says_how_it_was_made_and_is_plausible() -> None:
    """No stop covers more than moving on at its speed would."""
    shipped = stopping.load()
    assert shipped.kind == SIMULATION and shipped.command and shipped.command.startswith("hric measure_stops")
    assert shipped.max_load >= 3.0 and max(row.speed for row in shipped.stops) >= 1.5
    for row in shipped.stops:
        assert row.distance is not None and 0.0 < row.distance <= row.speed * row.time
