"""Supervised headless runs: the arm slows, stops and continues; disobeying controllers are stopped; approaches."""

import json
import time

import numpy as np
import pytest

from hric_assessment.contact.limits import PARTED, TRANSIENT_TIME
from hric_control.speed_scale import stopping_time
from hric_core.command import perform
from hric_core.errors import HricError
from hric_core.local.node import LocalNode
from hric_core.parameters import read_yaml
from hric_msgs.msg import SafetyEvent, SafetyState, SpeedScaleState
from hric_run.definition import experiment, parameters
from hric_run.simulation import Simulation
from hric_supervisor.app import HeadlessSupervisor
from hric_supervisor.arm import ArmShape, ArmState
from hric_supervisor.settings import SupervisorSettings
from hric_sweep import definition as sweep
from hric_sweep import task
from hric_sweep.approaches import command
from hric_sweep.approaches.contact_events import LONGEST, run_until_contact_ends
from hric_sweep.approaches.draw import SPEEDS, draw
from hric_sweep.definition import ROW
from hric_sweep.observed import Observed
from hric_sweep.outputs import IMPACT, SUPERVISION
from hric_sweep.records import RunResponse

NAME = "shared_workspace"


def supervised(duration=None, **changes):
    if duration is not None:
        rows = [row for row in experiment.read(NAME)["setpoints"] if row["time"] < duration]
        changes = {"duration": duration, "setpoints": rows, **changes}
    simulation = Simulation(NAME, simulator="mujoco", **changes)
    kept = {"states": [], "events": [], "scales": []}
    for topic, kind, name in (
        ("hric/safety/state", SafetyState, "states"),
        ("hric/safety/events", SafetyEvent, "events"),
        ("hric/safety/speed_scale_state", SpeedScaleState, "scales"),
    ):
        simulation.node.subscribe(topic, kind, kept[name].append)
    return simulation, kept


def speeds(simulation):
    """Return the speed of the arm's fastest point in each cycle [m/s]."""
    log = simulation.signals
    shape = ArmShape(simulation.node.param("robot_description"), log.joint_names)
    return log.time, np.array(
        [
            np.linalg.norm(shape.at(ArmState(t, q, dq)).velocities, axis=2).max()
            for t, q, dq in zip(log.time, log.position, log.velocity, strict=True)
        ]
    )


def test_the_arm_is_slowed_stopped_and_freed_as_the_person_comes_and_goes():
    simulation, kept = supervised(10.5)
    with simulation:
        simulation.run()
    assert [event.kind for event in kept["events"]].count("violation") == 0
    assert {"slowed", "stopped"} <= {event.kind for event in kept["events"]}
    assert {state.state for state in kept["states"]} >= {"slowed", "stopped"}
    assert max(state.scale for state in kept["states"] if state.header.stamp.to_sec() > 9.0) > 0.5
    assert len(kept["states"]) == pytest.approx(1050, abs=2)
    assert simulation.supervisor.latencies and max(simulation.supervisor.latencies) < 0.02


def test_without_it_the_same_run_comes_nearer_than_it_should():
    simulation, kept = supervised(4.5, **{"supervisor.active": False})
    with simulation:
        simulation.run()
    assert any(state.violation for state in kept["states"]) and not kept["scales"]


def test_lost_perception_stops_the_arm_within_the_stop_distance():
    simulation, kept = supervised(
        4.0, **{"human.walk.points": [[0.0, 0.0, 0.0]], "human.position": [4.0, 0.0], "human.control": {}}
    )
    with simulation:
        simulation.run(2.6)
        for registration in simulation.supervisor._persons[0].registrations:
            registration.unregister()
        simulation.run()
    (fault,) = [event for event in kept["events"] if event.kind == "fault"]
    assert "stale" in fault.text
    time, speed = speeds(simulation)
    lost, own = 2.6, SupervisorSettings()
    before = speed[(time > lost - 0.05) & (time <= lost)].max()
    assert before > 0.2  # it was at work
    noticed = own.max_age + 2.0 / own.rate
    stopped = time[np.flatnonzero(speed > 0.01)[-1]]
    assert stopped - lost < noticed + stopping_time(1.0) + own.settling_time
    after = (time > lost) & (time <= stopped)
    # What the terms of the protective distance say of the arm, at the fastest that it was meanwhile.
    fastest = speed[after].max()
    assert speed[after].sum() * 1e-3 < fastest * (noticed + 0.5 * stopping_time(1.0) + own.settling_time)


def test_a_controller_that_does_not_obey_is_stopped_and_named():
    simulation, kept = supervised(1.0, setpoints=[], **{"parameters.joint_pd_controller.profile.enabled": False})
    with simulation:
        simulation.run()
        states = {status.name: status.state for status in simulation.app.manager.list()}
    assert states["joint_pd_controller"] == "stopped" and states["joint_state_controller"] == "running"
    (stopped,) = [event for event in kept["events"] if event.kind == "controller_stopped"]
    assert "joint_pd_controller" in stopped.text


def test_a_supervised_run_is_the_same_each_time_and_one_that_is_watched_only_is_that_without():
    def digest(name=NAME, **changes):
        with Simulation(name, simulator="mujoco", duration=1.5, **changes) as simulation:
            simulation.run()
        return simulation.state_sha256

    first = {"setpoints": experiment.read(NAME)["setpoints"][:1]}
    assert digest(**first) == digest(**first)
    raw = experiment.read(NAME)
    del raw["supervisor"]
    raw["duration"], raw["setpoints"] = 1.5, raw["setpoints"][:1]
    raw["robot"]["plant_type"] = "mujoco_ros_control/MujocoPlant"
    watched = digest(setpoints=raw["setpoints"], **{"supervisor.active": False})
    with Simulation(experiment.parse(NAME, raw)) as simulation:
        simulation.run()
    assert watched == simulation.state_sha256


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"supervisor.mode": "brave"}, "monitored_standstill"),
        ({"supervisor.source": "marker"}, "base_from_mocap"),
        ({"supervisor.source": "person"}, "a section person"),
        ({"supervisor.limits": "nobody"}, "iso_ts_15066"),
        ({"supervisor.speed": 0.0}, "above 0"),
    ],
)
def test_a_mistake_in_the_section_is_one_error_with_what_is_valid(changes, said):
    with pytest.raises(HricError, match=said):
        Simulation(NAME, simulator="mujoco", **changes)


def test_a_supervisor_who_sees_nobody_is_refused():
    raw = experiment.read(NAME)
    del raw["human"]
    with pytest.raises(HricError, match="there is no human in the robot's plant"):
        experiment.parse(NAME, raw)


def test_a_tracked_person_is_of_live_runs_and_their_section_reaches_the_supervisor():
    raw = experiment.read(NAME)
    del raw["human"]
    raw["mocap"] = {"base_from_mocap": {"xyz": [0, 0, 0], "xyzw": [0, 0, 0, 1]}}
    raw["person"], raw["supervisor"]["source"] = {"subject": "P50_female"}, "person"
    definition = experiment.parse(NAME, raw)
    (given,) = parameters.supervisor(definition).values()
    assert given["person"]["subject"] == "P50_female"
    with pytest.raises(HricError, match="scripts/bringup"):
        Simulation(definition)


def test_a_real_arm_is_refused_without_the_acknowledgement():
    node = LocalNode({"robot": {"robot_ip": "172.16.0.2"}}, "/hric/safety/supervisor")
    with pytest.raises(HricError, match="acknowledge_no_safety_function"):
        HeadlessSupervisor(node, lambda *_: None)


def test_what_is_drawn_is_the_seeds_and_within_what_is_said():
    assert draw(3) == draw(3) != draw(4)
    drawn = [draw(seed) for seed in range(300)]
    assert all(SPEEDS[0] <= one.speed <= SPEEDS[1] for one in drawn)
    assert min(one.speed for one in drawn) < 0.6 and max(one.speed for one in drawn) > 1.9


@pytest.mark.parametrize(
    ("given", "count", "bound"),
    [
        (["--count", "8"], 8, "31.2"),
        pytest.param(["--quick"], 20, "13.9", marks=pytest.mark.slow),
    ],
)
def test_approaches_meet_no_moving_arm_and_without_the_supervisor_they_do(given, count, bound, tmp_path, capsys):
    file = tmp_path / "approaches.jsonl"
    assert perform(["approaches", *given, "--jobs", "1", "--output", str(file)]) == 0
    printed = capsys.readouterr().out
    assert f"in 0 of {count}, at most {bound} % (one-sided 95 %)" in printed
    assert "no certified safety function" in printed
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    assert [row["index"] for row in rows] == list(range(count))
    assert any(row["outputs"]["standing_above"] for row in rows)  # somebody did come
    begun = time.process_time()
    perform(["approaches", *given, "--jobs", "1", "--output", str(file)])  # nothing is run again
    assert time.process_time() - begun < 0.1 * sum(row["processor"] for row in rows) + 2.0
    assert capsys.readouterr().out == printed and len(file.read_text().splitlines()) == count
    assert perform(["approaches", "--count", "2", "--without", "--jobs", "1"]) == 3
    assert "WITHOUT the supervisor" in capsys.readouterr().out


def approach(seed, simulator="mujoco"):
    """Return the observations of an approach drawn from a seed, and its simulation at the end."""
    changes = {"simulator": simulator, "supervisor.active": True, **draw(seed).changes()}
    with Simulation(NAME, seed=seed, **changes) as simulation:
        observed = Observed(simulation, {IMPACT, SUPERVISION})
        run_until_contact_ends(simulation)
        return observed.values(), simulation.time


def test_a_run_goes_on_until_its_contact_has_parted_or_is_a_clamp():
    values, duration = approach(0)
    first, last = min(one.time for one in values.contacts), max(one.end for one in values.contacts)
    assert duration - first > TRANSIENT_TIME or duration - last > PARTED
    assert duration - first < LONGEST + 0.1


def test_a_run_of_the_sweep_is_the_approach_of_its_seed():
    content = read_yaml(sweep.find("approaches"))
    content["sweep"] |= {"runs": 1, "seed": 3}
    plan = sweep.plan("approaches", content)
    response = task.run(plan.task(0, {ROW: "3"}, "code"))
    values, _ = approach(3)
    assert response.state_sha256 == values.log.state_sha256()
    assert response.outputs["standing_above"] == sum(row["above"] for row in values["impact"]["standing"])
    reported, supervision = values["supervisor"], values["supervision"]
    assert (supervision["stopped"], supervision["slowed"]) == (reported["share_stopped"], reported["share_slowed"])
    assert supervision["separation"] == reported["separation_min"]


def ended(index, failure="", **outputs):
    """Return the response of an approach."""
    names = read_yaml(sweep.find("approaches"))["sweep"]["outputs"]
    return RunResponse("", index, dict.fromkeys(names, None if failure else 0.0) | outputs, failure)


def test_a_run_that_failed_counts_as_above_in_the_bound_and_is_named():
    why = "the simulation diverged at 2.946 s: speed of panda_joint1 is nan rad/s, not finite"
    text = command.report([ended(seed, why if seed == 7 else "") for seed in range(20)], 0, supervised=True)
    assert "in 0 of 20, at most 21.6 % (one-sided 95 %)" in text  # of 1 in 20
    assert "(counted as above limits in the bound): 1\n  seed 7: the simulation diverged at 2.946 s" in text


def test_a_contact_that_is_not_assessable_is_counted_as_such_and_bounded_as_above():
    runs = [ended(seed, not_assessable=float(seed == 3)) for seed in range(20)]
    text = command.report(runs, 0, supervised=True)
    assert "in 0 of 20, at most 21.6 % (one-sided 95 %)" in text  # Clopper-Pearson of 1 in 20
    assert "contacts with a moving arm: in 1 of 20 runs (above limits in 0, not assessable in 1" in text


@pytest.mark.parametrize(("result", "code"), [("above", 3), ("not_assessable", 4), ("warning", 0)])
def test_the_exit_code_is_that_of_the_worst_contact_with_a_moving_arm(result, code):
    assert command.exit_code([ended(0, **{result: 1.0}), ended(1, standing_above=1.0)]) == code


def test_a_file_that_is_none_of_its_own_is_refused(tmp_path):
    file = tmp_path / "x.jsonl"
    file.write_text('{"seed": 1}\n')
    with pytest.raises(HricError, match="line 1"):
        perform(["approaches", "--count", "1", "--jobs", "1", "--output", str(file)])


@pytest.mark.parametrize("engine", ["pybullet", "opensim"])
def test_on_the_other_engines_an_approach_ends_at_a_standing_arm_too(engine):
    values, _ = approach(3, engine)
    assert not values["impact"]["moving"] and values["supervision"]["stopped"] > 0.1
