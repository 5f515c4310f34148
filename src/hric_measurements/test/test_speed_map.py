"""Speed map: virtual measuring device compared with closed forms, and the command."""

import csv
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from franka_sim.franka_hw_sim import FrankaHWSim
from hric_assessment.contact.limits import Limits
from hric_assessment.findings import DISCLAIMER
from hric_core.command import main
from hric_core.errors import FailureError, HricError
from hric_measurements.speed_map import grid
from hric_measurements.speed_map.blow import ArmBehaviour, Blows
from hric_measurements.speed_map.device import HitBody, MeasuringDevice
from hric_measurements.speed_map.grid import DIRECTIONS, Postures
from hric_measurements.speed_map.measured import MapRequest, limit_speed, measure
from hric_run.definition import experiment
from hric_run.simulation import Simulation

HAND, CHEST = HitBody(0.6, 75e3), HitBody(40.0, 25e3)
POINTS = grid.points((0.35, 0.6, 2), (-0.3, 0.3, 2), (0.3, 0.5, 2))
STEP = 1e-3


@pytest.fixture(scope="module")
def robot() -> Iterator[FrankaHWSim]:
    with Simulation(experiment.load(experiment.NONE, ["simulator:=mujoco"])) as simulation:
        yield simulation.app.hw


# -- the device --------------------------------------------------------------------------------------------------------


def pushed(body: HitBody, mass: float, speed: float, approach: float = 0.0) -> float:
    """Return the peak force when a free mass hits the device, in time steps as in a physics engine."""
    device, x, v = MeasuringDevice(body, mass, STEP, approach), 0.0, speed
    for _ in range(500):
        a = -device.push(x, v) / mass
        x, v = x + STEP * (v + 0.5 * STEP * a), v + STEP * a
        if device.apart:
            return device.peak
    raise AssertionError("they do not part")


@pytest.mark.parametrize("body", [HAND, CHEST])
@pytest.mark.parametrize("mass", [2.0, 8.0])
def test_two_masses_on_its_spring_give_the_closed_form(body: HitBody, mass: float) -> None:
    mu = 1.0 / (1.0 / mass + 1.0 / body.mass)
    assert pushed(body, mass, 0.7) == pytest.approx(0.7 * math.sqrt(mu * body.stiffness), rel=5e-3)


def test_who_of_both_moves_does_not_matter() -> None:
    assert pushed(HAND, 3.0, 0.2, approach=0.8) == pytest.approx(pushed(HAND, 3.0, 1.0), rel=1e-6)


def test_its_damping_is_that_of_an_integrated_oscillator() -> None:
    body, mass, speed = HitBody(0.6, 75e3, 60.0), 4.0, 1.0
    mu = 1.0 / (1.0 / mass + 1.0 / body.mass)

    def motion(_: float, state: np.ndarray) -> list[float]:
        return [state[1], -(body.stiffness * state[0] + body.damping * state[1]) / mu]

    found = solve_ivp(motion, (0.0, 0.02), [0.0, speed], max_step=1e-5, rtol=1e-9)
    force = body.stiffness * found.y[0] + body.damping * found.y[1]
    assert pushed(body, mass, speed) == pytest.approx(force.max(), rel=0.01)


# -- an arm against it -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("body", "bound"), [(HAND, 0.006), (CHEST, 0.02)])
def test_a_passive_arm_meets_it_with_its_reflected_mass(robot: FrankaHWSim, body: HitBody, bound: float) -> None:
    postures, blows, ratios = Postures(robot), Blows(robot, ArmBehaviour.PASSIVE), []
    for q in map(postures.at, POINTS):
        if q is None:
            continue
        for direction in DIRECTIONS.values():
            approach = blows.approach(q, np.array(direction))
            mu = 1.0 / (1.0 / approach.mass + 1.0 / body.mass)
            ratios.append(blows.peak(approach, body, 0.4) / (0.4 * math.sqrt(mu * body.stiffness)))
    assert len(ratios) >= 30
    assert np.abs(np.array(ratios) - 1.0).max() < bound


def test_a_posture_has_the_hand_where_the_point_is_turned_as_at_the_start(robot: FrankaHWSim) -> None:
    from franka_hw_interface.model import FrankaFrame

    start = robot.model.pose(FrankaFrame.END_EFFECTOR, robot.q_start)
    q = Postures(robot).at(np.array([0.5, 0.2, 0.4]))
    assert q is not None
    T = robot.model.pose(FrankaFrame.END_EFFECTOR, q)
    assert T[:3, 3] == pytest.approx([0.5, 0.2, 0.4], abs=1e-5) and T[:3, :3] == pytest.approx(start[:3, :3], abs=1e-4)
    assert Postures(robot).at(np.array([1.2, 0.0, 0.4])) is None


def test_an_arm_that_drives_on_is_permitted_less_than_one_that_does_not(robot: FrankaHWSim) -> None:
    lowest = {}
    for arm in ArmBehaviour:
        request = MapRequest("chest", Limits.named(), 0.0, arm)
        found = dict((tuple(point), cells) for point, cells in measure(robot, request, POINTS[:2]))
        lowest[arm] = [cell.speed / cell.closed_form for cells in found.values() for cell in cells]
    assert np.allclose(lowest[ArmBehaviour.PASSIVE], 1.0, atol=0.02)
    assert max(lowest[ArmBehaviour.DRIVEN]) < min(lowest[ArmBehaviour.PASSIVE])


# -- the search --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("power", [0.5, 1.0, 3.0])
def test_the_search_finds_where_a_rising_force_reaches_the_limit(power: float) -> None:
    found = limit_speed(lambda speed: 200.0 * speed**power, 280.0, guess=0.2)
    assert 200.0 * found**power == pytest.approx(280.0, rel=0.005)


def test_a_force_that_jumps_over_the_limit_has_no_limit_speed() -> None:
    with pytest.raises(FailureError, match="no limit speed found: the peak force is below 280 N"):
        limit_speed(lambda speed: 100.0 if speed < 1.0 else 500.0, 280.0, guess=0.9)


# -- the command -------------------------------------------------------------------------------------------------------


def test_the_command_leaves_a_table_and_a_picture_that_say_what_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--x", "0.4", "0.5", "2", "--y", "0", "0", "1", "--z", "0.3", "0.5", "2", "--arm", "passive"]
    assert main(["speed_map", *words, "-o", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert DISCLAIMER in told and "4 points, 4 of them within reach; 24 directions" in told
    first, *lines = (tmp_path / "speed_map.csv").read_text().splitlines()
    assert DISCLAIMER in first
    rows = list(csv.DictReader(lines))
    assert len(rows) == 24 and {row["direction"] for row in rows} == set(DIRECTIONS)
    for row in rows:
        assert float(row["limit speed [m/s]"]) == pytest.approx(float(row["closed form [m/s]"]), rel=0.01)
    assert DISCLAIMER in (tmp_path / "speed_map.svg").read_text()
    assert (tmp_path / "speed_map.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--region", "face"], "permits no contact with face at any speed"),
        (["--x", "0.7", "0.3", "3"], "--x is 0.7 0.3 3; valid: lowest, highest"),
        (["--x", "2", "2", "1"], "reaches none of the"),
        (["--damping", "-1"], "--damping"),
    ],
)
def test_what_gives_no_map_is_refused(words: list[str], told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["speed_map", *words]) == 2
    assert told in capsys.readouterr().err


def test_a_region_that_the_table_lacks_is_refused() -> None:
    with pytest.raises(HricError):
        MapRequest("foot, toes, ankle", Limits.named(), 0.0, ArmBehaviour.PASSIVE).check()
