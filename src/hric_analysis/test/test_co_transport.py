"""Metrics of co-transport of a board by a human and a robot, compared with closed forms and runs."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hric_analysis import carrying, human
from hric_analysis.carrying import Transport
from hric_bags.records import human_record
from hric_bags.records.human_record import GripRecord
from hric_core.errors import HricError
from hric_report import headless as runner
from hric_report import human_text
from hric_report.html import run_data
from hric_run.definition import experiment
from hric_run.simulation import Simulation

TIME = np.arange(0.0, 4.0, 0.005)
MASS, G, HALF = 4.0, 9.81, 0.65
BOARD = "package://hric_experiments/worlds/board.yaml"
GRIPS = {
    "robot": {"held": "board::link", "handle": [-HALF, 0, 0]},
    "hand": {"held": "board::link", "handle": [HALF, 0, 0]},
}


def grip(name: str, force: Any, point: Any, closed: tuple[float, float] = (0.0, 9.0)) -> GripRecord:
    """Return a grip with `force` on the board, shape (n, 3) or (3,) [N]; the record has the force on the holder."""
    held = (closed[0] <= TIME) & (closed[1] > TIME)
    rows = np.zeros((len(TIME), 3))
    return GripRecord(name, "board::link", f"{name}::palm", TIME, held, rows - force, rows, rows + point, rows[:, 0])


def carried(forces: Sequence[Any], centre: Any = (0.0, 0.0, 0.5), tilt: float = 0.0) -> Transport:
    """Return the metrics of the board about a centre, from the forces of both holders."""
    half = HALF * np.array([np.cos(tilt), 0.0, np.sin(tilt)])
    ends = [grip(name, force, centre + side * half) for name, force, side in zip(GRIPS, forces, (-1, 1), strict=True)]
    (found,) = carrying.transports(ends, {"grips": GRIPS}, {"world": BOARD})
    return found


@pytest.mark.parametrize(
    ("of_robot", "of_hand", "squeeze"),
    [(5.0, -3.0, 3.0), (2.0, -3.0, 2.0), (-4.0, 6.0, -4.0), (5.0, 3.0, 0.0), (0.0, -3.0, 0.0)],
)
def test_squeeze_is_what_of_both_forces_cancels_along_the_line_between_the_grips(
    of_robot: float, of_hand: float, squeeze: float
) -> None:
    found = carried([(of_robot, 7.0, 11.0), (of_hand, -2.0, 13.0)])
    np.testing.assert_allclose(found.squeeze, squeeze, atol=1e-12)


def test_the_weight_of_a_tilted_board_is_no_squeeze() -> None:
    found = carried([(0.0, 0.0, 0.5 * MASS * G)] * 2, tilt=0.3)
    np.testing.assert_allclose(found.squeeze, 0.0, atol=1e-12)
    np.testing.assert_allclose(found.tilt, 0.3, rtol=1e-12)
    assert found.share is not None
    np.testing.assert_allclose(found.share, 0.5, rtol=1e-12)


def test_the_excess_over_m_a_minus_g_shows_a_force_that_is_wrong_by_a_thousandth_of_the_weight() -> None:
    way = 0.1 * (1.0 - np.cos(2.0 * TIME))
    up = 0.4 * np.cos(2.0 * TIME)
    centre = np.column_stack([np.zeros_like(way), way, 0.5 + 0.5 * way])
    lift = 0.5 * MASS * np.column_stack([np.zeros_like(up), up, 0.5 * up + G])
    right, wrong = carried([lift, lift], centre), carried([lift, lift + np.array([0.0, 0.0, 1e-3 * MASS * G])], centre)
    assert right.excess is not None and wrong.excess is not None
    assert np.nanmax(np.abs(right.excess)) < 1e-4 * MASS * G
    np.testing.assert_allclose(wrong.excess[2:-2, 2], 1e-3 * MASS * G, atol=1e-4 * MASS * G)


def test_stamps_that_wander_by_milliseconds_are_no_acceleration() -> None:
    lift = np.array([0.0, 0.0, 0.5 * MASS * G])
    moving = np.column_stack([0.1 * TIME, 0.0 * TIME, 0.0 * TIME + 0.5])
    late = TIME + 3e-3 * np.sin(20.0 * TIME)
    ends = [
        grip(name, lift, moving + np.array([side * HALF, 0.0, 0.0])) for name, side in zip(GRIPS, (-1, 1), strict=True)
    ]
    (found,) = carrying.transports([replace(end, time=late) for end in ends], {"grips": GRIPS}, {"world": BOARD})
    assert found.excess is not None and np.nanmax(np.abs(found.excess)) < 1e-3 * MASS * G


def test_who_lets_go_while_the_other_holds_has_handed_over_and_not_carried() -> None:
    ends = [grip("robot", 0.0, 0.1, (0.0, 2.0)), grip("hand", 0.0, 0.9, (1.0, 9.0))]
    assert carrying.hands_over(*ends) and carrying.transports(ends, {"grips": GRIPS}, {"world": BOARD}) == []


def test_a_world_that_is_not_there_any_more_leaves_the_squeeze() -> None:
    ends = [grip("robot", (5.0, 0.0, 0.0), 0.1), grip("hand", (-5.0, 0.0, 0.0), (0.9, 0.1, 0.1))]
    (found,) = carrying.transports(ends, {"grips": GRIPS}, {"world": "/nowhere/board.yaml"})
    values = carrying.metrics(found, 0.0, 4.0)
    assert values is not None and values.load_share is None and values.squeeze_max > 4.9
    assert "weight unknown" in human_text._transport(values)


def test_at_rest_each_end_carries_what_the_levers_say(tmp_path: Path) -> None:
    """The distance of the hand from the board's centre is 1.857 times that of the robot."""
    near, far = 0.35, 0.65
    board = {"name": "board", "shape": "box", "size": [0.6, 0.3, 0.02], "mass": MASS}
    board["pose"] = {"xyz": [0.307 + near, 0.0, 0.472]}
    (tmp_path / "board.yaml").write_text(yaml.safe_dump({"objects": [board]}))
    x = 0.307 + near + far
    share = far / (near + far)
    changes = [
        "simulator:=mujoco",
        f"world:={tmp_path / 'board.yaml'}",
        f"robot.load.mass:={share * MASS}",
        f"human.control.parameters.load:={(1.0 - share) * MASS}",
        f"human.position:=[{x + 0.433}, -0.2]",
        f"human.control.parameters.reference.points:=[[0.0, {x}, 0.0, 0.472]]",
        f"human.grips.robot.handle:=[{-near}, 0, 0]",
        f"human.grips.hand.handle:=[{far}, 0, 0]",
        "duration:=4.0",
    ]
    definition = experiment.load("co_transport", changes)
    path = runner.run(definition, changes, root=tmp_path, progress=False, figures=False).folder.bag_path
    record = human_record.read(path, float)
    assert record is not None
    (found,) = human.transports_in(record, {"human": definition.human, "robot": {"plant": definition.robot.plant}})
    assert found.share is not None
    shares = found.share[:, found.time > 3.5].mean(axis=1)
    np.testing.assert_allclose(shares.sum(), 1.0, rtol=1e-6)
    np.testing.assert_allclose(shares, [share, 1.0 - share], rtol=1e-3)  # both hands turn it a little


@pytest.fixture(scope="module")
def led(tmp_path_factory: pytest.TempPathFactory) -> runner.HeadlessResult:
    """Return a run in which the person lifts the board by 3 cm and pushes it 5 cm towards the robot."""
    points = "[[0.5, 1.607, 0.0, 0.472], [1.3, 1.557, 0.05, 0.502]]"
    changes = ["simulator:=mujoco", "duration:=1.6", f"human.control.parameters.reference.points:={points}"]
    definition = experiment.load("co_transport", changes)
    return runner.run(definition, changes, root=tmp_path_factory.mktemp("runs"), progress=False)


def test_a_run_says_how_both_carry_the_board(led: runner.HeadlessResult) -> None:
    found = json.loads((led.folder.path / "metrics.json").read_text())["human"]
    (board,) = found["carried"]
    assert found["handovers"] == []
    assert board["weight"] == pytest.approx(MASS * G)
    assert sum(share["mean"] for share in board["load_share"].values()) == pytest.approx(1.0, abs=0.02)
    assert 1.0 < board["squeeze_max"] < 10.0
    assert 0.01 < board["lift"] < 0.03 and 0.0 < board["tilt_max"] < 0.05
    assert board["excess_max"] < 1e-3 * board["weight"]
    assert "both carry board::link" in (led.folder.path / "summary.txt").read_text()
    assert {"carrying.svg", "carrying_path.svg"} <= {p.name for p in (led.folder.path / "figures").iterdir()}


def test_the_replay_has_the_board_where_both_ends_of_it_are(led: runner.HeadlessResult) -> None:
    data = run_data.load(led.folder, led.metrics)
    (board,) = data.objects
    assert data.person is not None
    (found,) = data.person.transports
    later = board.time > found.time[0]
    for axis in range(3):
        middle = np.interp(board.time[later], found.time, found.centre[:, axis])
        np.testing.assert_allclose(board.pose[later, axis], middle, atol=2e-3)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("human.grips.robot.held:=plank::link", r"no model 'plank' in .*/grips/robot; valid: board"),
        ("human.grips.hand.holder:=claw", r"no link 'claw' in .*/grips/hand; valid: panda_hand"),
        (
            "human.position:=[3.0, -0.2]",
            r"the goal of the hand is 1\.4\d+ m from the right shoulder; valid: up to 0\.6",
        ),
        ("robot.load.mass:=-1", r"robot\.load\.mass is -1; valid: a finite number from 0 to 20 \[kg\]"),
    ],
)
def test_what_cannot_be_carried_is_refused_before_anything_runs(change: str, said: str) -> None:
    with pytest.raises(HricError, match=said):
        Simulation(experiment.load("co_transport", ["simulator:=mujoco", change]))
