"""Load metrics of the human in a run: records with known results, and a run."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import opensim
import pytest
from rosbags.highlevel import AnyReader

from hric_analysis import human, human_difference, human_values, muscle_metrics, stability
from hric_analysis.human import SimulatedPerson
from hric_bags.export import exporting, recording
from hric_bags.records import RecordedHumanEvent
from hric_bags.records.human_record import GripRecord, HumanRecord
from hric_bags.records.muscle_record import MuscleMessages
from hric_core.trial.opensim_text import read_storage
from hric_report import headless as runner
from hric_report import human_text
from hric_run.definition import experiment
from hric_run.definition.experiment import ExperimentError
from hric_sweep.study import definition as study
from hric_sweep.study import tables

JOINTS = (
    "right_sh_flex",
    "right_sh_abd",
    "right_sh_rot",
    "right_el_flex",
    "right_pro_sup",
    "right_wr_flex",
    "right_wr_dev",
)
TIME = np.arange(0.0, 8.0, 0.005)
STARTED, ENDED = (
    RecordedHumanEvent(0.5, "started", "human", 0.0, ""),
    RecordedHumanEvent(2.5, "ended", "human", 0.0, ""),
)


def grip(name: str = "guide", closed: tuple[float, float] = (0.0, 9.0), **changes: Any) -> GripRecord:
    """Return a grip at rest without force."""
    zeros, held = np.zeros((len(TIME), 3)), (closed[0] <= TIME) & (closed[1] > TIME)
    made = GripRecord(name, "baton::link", f"{name}::palm", TIME, held, zeros, zeros, zeros, np.zeros(len(TIME)))
    return replace(made, **changes)


def record(
    grips: Sequence[GripRecord] = (), position: Any = None, events: Sequence[RecordedHumanEvent] = (STARTED, ENDED)
) -> HumanRecord:
    zeros = np.zeros((len(TIME), 7))
    q = zeros if position is None else position
    clipped, by_name = dict.fromkeys(JOINTS, 0), {one.name: one for one in grips}
    return HumanRecord(JOINTS, TIME, q, TIME, zeros, zeros, clipped, by_name, events=list(events))


def pulse(height: float, begin: float, end: float) -> Any:
    """Return a pulse along x, shape (n, 3)."""
    values = np.zeros((len(TIME), 3))
    values[(begin <= TIME) & (end >= TIME), 0] = height
    return values


def metrics(made: HumanRecord) -> Any:
    return human.metrics(SimulatedPerson(made), {})


def test_work_on_what_is_held_is_force_times_way_with_the_sign_of_the_hand() -> None:
    away = np.zeros((len(TIME), 3))
    away[:, 0] = np.clip(0.1 * (TIME - 1.0), 0.0, 0.2)
    found = metrics(record([grip(force=pulse(-5.0, 0.0, 9.0), point=away)])).grips["guide"]
    assert found.work == pytest.approx(5.0 * 0.2, rel=1e-6)
    assert found.force_max == found.force_mean == pytest.approx(5.0)


def test_a_grip_that_never_closes_has_no_force_and_the_report_says_why() -> None:
    found = metrics(record([grip(closed=(9.0, 9.0))]))
    assert found.grips["guide"].force_max is None
    assert "grip guide never closed" in human_text.render(found)


@pytest.mark.parametrize(
    ("until", "verdict", "after"),
    [(3.5, human_values.SETTLES, 1.0), (6.0, human_values.UNSTABLE, 3.5), (9.0, human_values.UNSTABLE, None)],
)
def test_a_grip_that_pulls_longer_than_three_seconds_after_the_motion_is_unstable(
    until: float, verdict: str, after: float | None
) -> None:
    found = metrics(record([grip(force=pulse(5.0, 1.0, until))])).settling
    assert found.verdict == verdict
    assert found.after["guide"] == (None if after is None else pytest.approx(after, abs=0.011))


def test_a_run_whose_human_does_not_come_to_rest_is_unstable_and_says_why() -> None:
    def settling(until: float) -> Any:
        return metrics(record([grip(force=pulse(5.0, 1.0, until))])).settling

    judged = stability.Stability(stability.STABLE, stability.STABLE, (), {}, stability.Thresholds())
    assert judged.also(human_values.instability_reasons(settling(3.5))) == judged
    assert judged.also(human_values.instability_reasons(None)) == judged
    found = judged.also(human_values.instability_reasons(settling(9.0)))
    assert (found.verdict, found.loop) == (stability.UNSTABLE, stability.STABLE)
    (reason,) = found.reasons
    assert "do not come to rest within 3 s after the motion" in reason and "guide never" in reason


def test_two_humans_are_as_far_apart_as_their_joints_and_grip_forces_since_each_began() -> None:
    late = [replace(event, time=event.time + 0.25) for event in (STARTED, ENDED)]
    way = np.sin(np.outer(TIME, np.arange(1.0, 8.0)))
    shifted = np.sin(np.outer(TIME - 0.25, np.arange(1.0, 8.0)))
    shifted[TIME > 4.0, 3] += 2e-3
    a = record([grip(force=pulse(5.0, 1.0, 3.0))], way)
    b = record([grip(force=pulse(5.5, 1.25, 3.25)), grip("other")], shifted, late)
    found = human_difference.difference(a, b)
    assert found.joint_difference_max == pytest.approx(2e-3, rel=1e-6)
    assert found.joints["right_el_flex"].peak_difference == found.joint_difference_max
    assert found.joints["right_el_flex"].peak_time > 4.0 - 0.75
    assert found.joints["right_sh_flex"].peak_difference < 1e-9
    assert list(found.grips) == ["guide"] and found.force_difference_max == pytest.approx(0.5, abs=1e-9)
    said = human_text.difference_line(found)
    assert "joints within 2.0e-03 rad (right_el_flex" in said and "grips within 5.0e-01 N (guide" in said
    assert human_difference.difference(a, a).joint_difference_max == 0.0


def test_humans_without_a_common_joint_or_time_have_no_difference() -> None:
    a = record()
    other = replace(a, joints=tuple(f"left{name.removeprefix('right')}" for name in JOINTS))
    found = human_difference.difference(a, other)
    assert found.joint_difference_max is None and "no joint and no grip in both runs" in human_text.difference_line(
        found
    )


def test_a_force_below_a_twentieth_of_the_peak_has_faded() -> None:
    force = pulse(5.0, 1.0, 2.0) + pulse(0.24, 2.1, 9.0)
    assert metrics(record([grip(force=force)])).settling.verdict == human_values.SETTLES


def test_a_run_that_ends_too_early_is_not_judged() -> None:
    late = RecordedHumanEvent(6.0, "ended", "human", 0.0, "")
    assert metrics(record([grip()], events=[STARTED, late])).settling is None


def test_a_run_of_one_cycle_has_no_motion_of_a_person(tmp_path: Path) -> None:
    definition = experiment.load("hand_guidance", ["duration:=0.001"])
    assert runner.run(definition, root=tmp_path, progress=False, figures=False).metrics.get("human") is None


def test_a_handover_is_from_who_closed_first_and_lasts_while_both_hold() -> None:
    giver, taker = (
        grip("robot", (0.0, 4.0)),
        grip("hand", (2.5, 9.0), force=pulse(6.0, 3.0, 3.5) + pulse(9.0, 5.0, 6.0)),
    )
    (found,) = metrics(record([taker, giver])).handovers
    assert (found.giver, found.taker, found.dropped) == ("robot", "hand", False)
    assert found.overlap == pytest.approx(1.5, abs=0.006)
    assert found.force_max == pytest.approx(6.0)


def test_what_nobody_holds_in_between_has_fallen() -> None:
    (found,) = metrics(record([grip("robot", (0.0, 2.0)), grip("hand", (3.0, 9.0))])).handovers
    assert found.dropped and found.overlap == 0.0


@pytest.fixture(scope="module")
def guided(tmp_path_factory: pytest.TempPathFactory) -> runner.HeadlessResult:
    overrides = ["simulator:=mujoco", "duration:=1.5"]
    definition = experiment.load("hand_guidance", overrides)
    return runner.run(definition, overrides, root=tmp_path_factory.mktemp("runs"), progress=False)


def test_a_run_with_a_human_says_what_it_required_of_them(guided: runner.HeadlessResult) -> None:
    found = json.loads((guided.folder.path / "metrics.json").read_text())["human"]
    assert found["subject"] == "P50M"
    assert 0.5 < found["grips"]["guide"]["force_max"] < 10.0
    assert 0.0 < found["strength_share_max"] < 0.5
    assert "(model estimate)" in (guided.folder.path / "summary.txt").read_text()
    assert {"grip.svg", "strength.svg", "human_joints.svg"} <= {
        p.name for p in (guided.folder.path / "figures").iterdir()
    }


@pytest.fixture(scope="module")
def by_muscles(tmp_path_factory: pytest.TempPathFactory) -> runner.HeadlessResult:
    overrides = ["simulator:=mujoco", "duration:=1.5", "human.drive:=muscle"]
    definition = experiment.load("hand_guidance", overrides)
    return runner.run(definition, overrides, root=tmp_path_factory.mktemp("runs"), progress=False)


def test_a_run_with_muscles_says_what_it_cost_them(by_muscles: runner.HeadlessResult) -> None:
    folder = by_muscles.folder.path
    found = json.loads((folder / "metrics.json").read_text())["human"]["muscles"]
    with AnyReader([next(folder.glob("*.bag"))]) as bag:
        (connection,) = [c for c in bag.connections if c.topic == "/hric/human/activation"]
        rows = [bag.deserialize(raw, connection.msgtype) for _, _, raw in bag.messages(connections=[connection])]
    names, values = list(rows[0].name), np.array([row.activation for row in rows])
    biceps = values[:, names.index("right_bic_b")]
    assert len(found["muscles"]) == 34 and "right_wr_flex+" not in found["muscles"]
    assert found["muscles"]["right_bic_b"]["activation_max"] == pytest.approx(biceps.max())
    assert found["muscles"]["right_bic_b"]["activation_mean"] == pytest.approx(biceps.mean())
    assert 0.01 < found["activation_mean"] < found["activation_max"] < 0.5
    assert 100.0 < found["contact"]["right_shoulder"]["force_max"] < 2000.0
    summary = (folder / "summary.txt").read_text()
    assert "- muscles: highest activations" in summary and "- contact force between bones" in summary
    assert {"activation.svg", "joint_contact.svg"} <= {path.name for path in (folder / "figures").iterdir()}
    assert tables.values(by_muscles.metrics, "human", tables.HUMAN_COLUMNS)["activation_max"] == found["activation_max"]


def test_a_run_whose_joints_are_driven_says_nothing_of_muscles(guided: runner.HeadlessResult) -> None:
    assert guided.metrics["human"]["muscles"] is None
    assert "muscles" not in (guided.folder.path / "summary.txt").read_text()


def test_shares_of_time_count_muscles_above_a_threshold_and_not_actuators() -> None:
    names, own = ("right_a", "right_b", "right_wr_flex+"), ("right_a", "right_b")
    rows = [(0.1, 0.2, 0.9), (0.4, 0.2, 0.9), (0.6, 0.35, 0.9), (0.2, 0.1, 0.9)]
    messages = MuscleMessages(["/human"])
    for k, row in enumerate(rows):
        head = SimpleNamespace(stamp=SimpleNamespace(sec=k, nanosec=0))
        activation = SimpleNamespace(header=head, name=names, activation=row, limited=(0, k, 0))
        force = SimpleNamespace(header=head, name=own, force=(100.0 * k, 50.0), outside=k == 3)
        messages.add("/human/activation", activation)
        messages.add("/human/muscle_force", force)
    made = messages.record(float)
    assert made is not None
    found = muscle_metrics.metrics(made)
    assert found.above == {"0.3": 0.5, "0.5": 0.25} and found.muscles["right_b"].above["0.3"] == 0.25
    assert (found.activation_max, found.activation_max_muscle) == (0.6, "right_a")
    assert found.activation_mean == pytest.approx(np.mean([row[:2] for row in rows]))
    assert found.muscles["right_a"].force_max == 300.0 and found.outside == 0.25
    text = "\n".join(human_text.muscle_lines(found))
    assert "right_a 0.60, right_b 0.35" in text and "right_b (3 times)" in text and "25 % of the time the" in text


@pytest.mark.parametrize(("reflex", "delay", "verdict"), [("0.25", "0.15", "stable"), ("1", "0.15", "unstable")])
def test_a_run_is_called_unstable_where_all_of_their_impedance_is_late(
    reflex: str, delay: str, verdict: str, tmp_path: Path
) -> None:
    overrides = [
        "simulator:=mujoco",
        "duration:=4.3",
        "human.control.parameters.reference.points:=[[0.1,0.42,0,0.55],[0.6,0.42,0.1,0.55],[1.1,0.42,0,0.55]]",
        f"human.control.parameters.reflex:={reflex}",
        f"human.control.senses.joint_delay:={delay}",
    ]
    result = runner.run(
        experiment.load("hand_guidance", overrides), overrides, root=tmp_path, progress=False, figures=False
    )
    assert result.metrics["stability"]["verdict"] == verdict
    assert result.metrics["human"]["settling"]["verdict"] == (
        human_values.SETTLES if verdict == "stable" else human_values.UNSTABLE
    )
    assert ("stability: UNSTABLE" in result.metrics["report"]) is (verdict == "unstable")


def test_runs_called_by_numbers_are_drawn_over_them(guided: runner.HeadlessResult) -> None:
    values = {"human": tables.values(guided.metrics, "human", tables.HUMAN_COLUMNS)}
    figure = tables.human_figure({"100": values, "50": values, "9": values}, "stiffness [N/m]")
    assert figure is not None and figure.abscissa == "stiffness [N/m]"
    assert all(panel.curves[0].time.tolist() == [9.0, 50.0, 100.0] for panel in figure.panels)


def test_a_study_with_an_abscissa_refuses_runs_without_a_number() -> None:
    raw = {
        "description": "x",
        "forms": {
            "a": {
                "experiment": "pd_step",
                "abscissa": "gain",
                "runs": {"1": [], "soft": []},
                "compared": [{"runs": ["1", "soft"]}],
            }
        },
    }
    with pytest.raises(
        ExperimentError, match=r"forms.a.runs is '1, soft'; valid: names that are numbers, values of gain"
    ):
        study.parse("mine", raw)


def test_all_mistakes_of_a_human_are_one_error_before_anything_runs() -> None:
    changes = ["human.parts:=tail", "human.control:={type: hric_human/None}", "human.grips:={guide: {}}"]
    with pytest.raises(ExperimentError) as error:
        experiment.load("hand_guidance", changes)
    assert "human.parts is 'tail'" in str(error.value) and "grips.guide.held is not set" in str(error.value)


def test_opensims_inverse_dynamics_of_the_files_of_a_run_is_the_torque_of_their_joints(tmp_path: Path) -> None:
    overrides = ["simulator:=opensim", "duration:=1.8", "human.rate:=1000"]
    folder = runner.run(
        experiment.load("hand_guidance", overrides), overrides, root=tmp_path, progress=False, figures=False
    ).folder.path
    tool = opensim.InverseDynamicsTool()
    tool.setModelFileName(str(folder / "human.osim"))
    tool.setCoordinatesFileName(str(folder / "human.mot"))
    tool.setExternalLoadsFileName(str(folder / "human_external_loads.xml"))
    tool.setLowpassCutoffFrequency(-1.0)
    tool.setStartTime(0.8)
    tool.setEndTime(1.7)
    tool.setResultsDir(str(tmp_path))
    tool.setOutputGenForceFileName("torques.sto")
    assert tool.run()
    solved = read_storage(tmp_path / "torques.sto")
    time, columns = solved.time, solved.columns
    with AnyReader([next(folder.glob("*.bag"))]) as bag:
        (connection,) = [c for c in bag.connections if c.topic == "/hric/human/joint_torque"]
        messages = [bag.deserialize(raw, connection.msgtype) for _, _, raw in bag.messages(connections=[connection])]
    at = np.array([m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in messages])
    for j, joint in enumerate(messages[0].name):
        own = np.interp(time, at, [m.torque[j] for m in messages])
        assert np.ptp(own) > 0.01
        assert np.abs(columns[f"{joint}_moment"] - own).max() < 0.02, joint
    exported = exporting.export(
        recording.find(str(folder)), exporting.ExportRequest(("external_loads",)), tmp_path / "out"
    )
    assert not exported.failures, exported.failures
    theirs = read_storage(tmp_path / "out" / "external_loads" / "external_loads.mot").columns
    written = read_storage(folder / "human_external_loads.mot").columns
    assert list(theirs) == list(written) and np.abs(written["guide_force_vy"]).max() > 0.5
    for name, values in written.items():
        np.testing.assert_allclose(theirs[name], values, atol=1e-9, err_msg=name)
    setup = opensim.ExternalLoads(str(tmp_path / "out" / "external_loads" / "external_loads.xml"), True)
    assert [setup.get(k).get_applied_to_body() for k in range(setup.getSize())] == ["r_wrist"]
