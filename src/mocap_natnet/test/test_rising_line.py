"""Map between two clocks with estimates that a busy machine disturbs: past results stay, and it never decreases."""

import itertools

import numpy as np
import pytest
from busy_run import CALM, END, START, BusyDriver, BusyRun

from hric_core.robot_time.clock import NS, RunClock
from hric_core.robot_time.rising_line import BEND, SLOWEST, Line, RisingLine
from mocap_natnet.client.frame_clock import EchoClock, ExposureClock
from mocap_natnet.codec.types import Frame, Suffix

FRAME = 1 / 240
FREQUENCY = 3_312_787
SEEDS = range(8)


@pytest.mark.parametrize("pace", [0.25, 1.0, 3.0])
@pytest.mark.parametrize("seed", SEEDS)
def test_of_a_machine_that_stalls_and_delivers_late_no_time_goes_back(seed: int, pace: float) -> None:
    busy, walls = BusyRun(seed, pace, load=1.0), np.arange(0.5, END - 0.1, FRAME)
    driver = BusyDriver(busy)
    told = np.array([driver.robot_time(wall) for wall in walls], dtype=float)
    known = np.isfinite(told)
    assert known.sum() > 7000 and np.diff(told[known]).min() >= 0.0
    errors = np.abs(told - busy.truth(walls)) / pace
    assert np.median(errors[known]) < 0.1, "in wall time, of which stalls take up to 0.4 s"
    assert errors[walls > CALM + 3.0].max() < 1e-3, "and it is right again when the load is over"


def test_what_was_returned_stays_and_calls_in_any_order_agree() -> None:
    random, clock, busy = np.random.default_rng(3), RunClock(), BusyRun(3, 1.0, load=1.0)
    answers: dict[int, float] = {}
    for delivered, wall, run in busy.pairs[:1500]:
        clock.add(START + round(wall * NS), run, 1.0)
        for at in START + np.rint((delivered - random.exponential(0.05, 5)) * NS).astype(int):
            clock.settle(int(at))
            told = clock.robot_time(int(at))
            assert told is not None and answers.setdefault(int(at), told) == told
    assert (np.diff([answers[at] for at in sorted(answers)]) >= 0.0).all()
    late = [at for at in answers if at > max(answers) - 2 * NS]
    assert [clock.robot_time(at) for at in late] == pytest.approx([answers[at] for at in late], abs=1e-12)


def test_a_pause_in_the_middle_of_late_pairs_does_not_go_back_and_the_run_goes_on_from_there() -> None:
    clock, told = RunClock(), []
    for index in range(300):
        wall = 0.02 * index
        run = min(wall, 2.0) if wall < 4.0 else wall - 2.0
        clock.add(START + round(wall * NS), run, 1.0)
        for ahead in (0.02, 0.05, 0.09, 0.099):  # what is measured until the next pair is heard, 80 ms late
            at = START + round((wall + ahead) * NS)
            clock.settle(at)
            told.append(clock.robot_time(at))
    times = np.sort(np.array(told, dtype=float))
    assert np.all(np.diff(np.maximum.accumulate(np.array(told, dtype=float))) >= 0.0)
    assert times[-1] == pytest.approx(0.02 * 299 - 2.0 + 0.099, abs=1e-3)
    assert clock.robot_time(START + 3 * NS) == pytest.approx(2.0, abs=0.1)


def test_a_bend_ends_where_the_line_is_met_also_without_further_pairs() -> None:
    rising = RisingLine(Line(0, 0.0, 1.0, NS))
    rising.meet(Line(0, -0.05, 1.0, NS), NS)
    assert rising.at(NS) == 1.0 and rising.at(NS + round(0.05 * NS)) == pytest.approx(1.025)
    assert [rising.at(NS + round(t * NS)) for t in (BEND, 1.0, 5.0)] == pytest.approx([0.95 + BEND, 1.95, 5.95])


@pytest.mark.parametrize("behind", [0.2, 0.02, -0.02, -0.5, -20.0])
def test_the_map_and_its_inverse_are_one(behind: float) -> None:
    rising = RisingLine(Line(0, 3.0, 0.7, NS))
    rising.meet(Line(0, 3.0 - behind, 0.7, NS), NS)
    rising.pause(rising.at(3 * NS), 4 * NS)
    xs = np.linspace(0.0, 2.9, 200)
    ys = [rising.at(round(x * NS)) for x in xs]
    assert np.diff(ys).min() >= 0.99 * SLOWEST * 0.7 * (xs[1] - xs[0])
    assert [rising.when(y) / NS for y in ys] == pytest.approx(xs, abs=2e-9 / SLOWEST)
    assert rising.when(1e9) == pytest.approx(3 * NS, abs=1)


@pytest.mark.parametrize("seed", SEEDS)
def test_exposures_in_order_get_times_in_order_whatever_the_echoes_say(seed: int) -> None:
    """Round trips from 50 us to 40 ms, slow ones first; a server clock 100 ppm fast; missing or wrong exposures."""
    random, clock, told, errors = np.random.default_rng(seed), ExposureClock(0.0055), [], []
    clock.restart(FREQUENCY)
    assert clock.echo is not None
    echo_due, received = 0.0, 0.0
    for number, exposed in enumerate(np.arange(0.05, 20.0, FRAME)):
        if exposed >= echo_due:
            echo_due = exposed + 0.1
            add_echo(
                clock.echo,
                float(exposed),
                random.exponential(10e-3 if exposed < 5.0 or random.random() < 0.7 else 25e-6, 2),
            )
        received = max(received, exposed + 0.0055 + float(random.exponential(2e-3)))
        ticks = round((900.0 + exposed * (1 + 1e-4)) * FREQUENCY)
        suffix = Suffix(time_stamp=exposed, mid_exposure=(ticks, 0, 2**62)[int(random.choice(3, p=[0.98, 0.01, 0.01]))])
        time, means = clock.exposed(Frame(number, suffix=suffix), START + round(received * NS))
        assert time <= START + round(received * NS)
        told.append(time)
        errors.append((time - START) / NS - exposed if means == "mid-exposure" and exposed > 8.0 else 0.0)
    assert min(b - a for a, b in itertools.pairwise(told)) > 0
    assert clock.echo.restarts == 0 and max(map(abs, errors)) < 0.5e-3


def add_echo(echo: EchoClock, sent: float, ways: np.ndarray) -> None:
    there, back = ways.tolist()
    ticks = round((900.0 + (sent + there) * (1 + 1e-4)) * FREQUENCY)
    echo.add(START + round(sent * NS), START + round((sent + there + back) * NS), ticks)


def test_time_stamps_alone_get_times_in_order_where_the_shortest_delay_is_found_late() -> None:
    random, clock, told = np.random.default_rng(1), ExposureClock(0.0055), []
    received = 0.0
    for number, exposed in enumerate(np.arange(0.0, 30.0, FRAME)):
        late = 0.1 if exposed < 1.0 else float(random.exponential(2e-3)) if exposed < 5.0 or exposed > 20.0 else 0.03
        received = max(received, exposed + 0.0055 + late)
        told.append(
            clock.exposed(Frame(number, suffix=Suffix(time_stamp=50.0 + exposed)), START + round(received * NS))[0]
        )
    assert np.diff(told).min() > 0
    assert abs(told[-1] / NS - START / NS - 30.0) < 6e-3
