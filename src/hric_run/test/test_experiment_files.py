"""Experiment files and overrides: their content, and the messages for mistakes."""

import json
import math
import os
import shutil
from datetime import date
from pathlib import Path
from textwrap import indent

import jsonschema
import pytest
import yaml

from hric_core.command import main
from hric_core.errors import HricError, ParameterError
from hric_core.urdf import read
from hric_run.definition import experiment, overrides, parameters
from hric_run.definition.experiment import ExperimentError
from hric_run.simulation import Simulation
from hric_sweep import definition as sweep
from hric_sweep.study import definition as study


def load(name: str, *given: str) -> experiment.Experiment:
    return experiment.parse(name, overrides.apply(experiment.read(name), given))


def test_the_experiments_of_the_workspace_are_valid() -> None:
    names = [
        *(
            "co_transport",
            "contact",
            "data_collection",
            "guided_collection",
            "hand_guidance",
            "handover",
            "identify_load",
            "leader_follower",
            "marker_tracking",
            "pd_step",
            "polish",
            "shared_workspace",
        ),
        "thesis_step",
        "try_contact",
        "two_arms",
        "two_arms_contact",
        "ur5e_contact",
        "ur5e_hand_guidance",
        "ur5e_shared_workspace",
        "ur5e_step",
    ]
    assert experiment.names() == names
    for name in ("pd_step", "thesis_step"):
        assert load(name).setpoints[0].positions == pytest.approx(
            [0, -math.pi / 4, 0, -3 * math.pi / 4, 0, math.pi / 2, math.pi / 4], abs=0
        )
    marker = load("marker_tracking")
    assert marker.mocap is not None and marker.mocap.body == "hand" and not marker.setpoints


def test_pd_step_starts_inside_every_range_and_is_led_through_a_trapezoid() -> None:
    pd_step = load("pd_step")
    assert pd_step.robot.q_start is not None and pd_step.robot.q_start[3] == -0.08
    assert pd_step.parameters["joint_pd_controller"]["profile"] == {
        "enabled": True,
        "velocity": 1.0,
        "acceleration": 5.0,
    }
    assert (pd_step.robot.hw, pd_step.duration) == ("franka_sim/FrankaHWSim", 6.0)


def test_shortcuts_reach_the_keys_they_stand_for() -> None:
    model = ["inertials:=thesis", "rotor_inertia:=0", "simulator:=pybullet", "q_start:=[pi, 0]"]
    run = load("thesis_step", "kp:=200", "kd:=[1, 2]", "duration:=1e-1", *model)
    assert run.parameters["joint_pd_controller"]["kp"] == 200
    assert run.parameters["joint_pd_controller"]["kd"] == [1, 2]
    assert run.robot.description["inertials"] == "thesis"
    assert run.robot.plant["rotor_inertia"] == 0
    assert run.duration == 0.1
    assert run.robot.plant_type == "pybullet_ros_control/PyBulletPlant"
    assert run.robot.q_start == (math.pi, 0.0)


def test_realism_reaches_the_robot_with_the_friction_that_acts_and_is_refused_before_anything_runs() -> None:
    made = parameters.robot(load("pd_step", "realism:=measured"), seed=4)
    assert made["realism"] == "measured" and made["plant"]["friction"] == "identified" and made["plant"]["seed"] == 4
    assert parameters.robot(load("pd_step", "realism:={preset: measured, friction: none}"))["plant"] == {"seed": 0}
    assert parameters.robot(load("pd_step", "realism:=measured", "friction:=none"))["plant"]["friction"] == "none"
    for name, given, said in (
        ("pd_step", "dirty", "valid: ideal, measured"),
        ("thesis_step", "measured", "robot.hw franka_sim/FrankaHWSim"),
    ):
        with pytest.raises(HricError, match=said):
            parameters.robot(load(name, f"realism:={given}"))


def test_dotted_paths_reach_any_key_of_the_file() -> None:
    run = load(
        "pd_step",
        "parameters.joint_pd_controller.profile.velocity:=0.5",
        "robot.plant.friction:=identified",
        "setpoints.0.time:=0.5",
    )
    assert run.parameters["joint_pd_controller"]["profile"] == {"enabled": True, "velocity": 0.5, "acceleration": 5.0}
    assert run.robot.plant["friction"] == "identified"
    assert run.setpoints[0].time == 0.5


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("kpp:=1", "did you mean kp"),
        ("speed:=1", "valid: arm_id, damping, duration"),
        ("friction:=dry", "valid: none, coulomb, identified"),
        ("kp=1", "write key:=value"),
        ("duration:=0", "duration is 0; valid: a finite number above 0"),
        ("duration:=soon", "duration is 'soon'; valid: a finite number"),
        ("robot.colour:=red", "'colour' is not one of arm_id"),
        ("parameters.no_controller.kp:=1", "not one of joint_state_controller"),
        ("setpoints.0.positions:=[1, pie]", "multiple of pi"),
        ("setpoints.0.controller:=nobody", "'nobody' is not started; valid: joint_state_controller"),
        ("setpoints.0.time:=7", "not before the end"),
        ("setpoints.0.time:=-1", "time is -1; valid: a finite number of 0 or more"),
        ("metrics.reference:=moon", "no reference 'moon' in metrics; valid: thesis"),
        ("controllers:=[a, a]", "all different"),
        ("kp:={", "is not YAML"),
        ("duration.x:=1", "no override"),
        ("parameters.joint_pd_controller.kp.x:=1", "is a value, not a group"),
    ],
)
def test_a_wrong_override_is_refused_with_what_would_be_right(given: str, told: str) -> None:
    with pytest.raises(ExperimentError, match=told.replace("(", r"\(")):
        load("pd_step", given)


def test_a_controller_that_a_package_configures_is_started_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(experiment.package_path("hric_controllers") / "templates/my_controller", tmp_path / "my_controller")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{os.environ['ROS_PACKAGE_PATH']}")
    given = "controllers:=[joint_state_controller, my_controller]"
    found = parameters.controllers(experiment.load("none", [given, "arm_id:=left"]))
    assert found["my_controller"]["type"] == "my_controller/JointSpring" and "rate" not in found["my_controller"]
    with pytest.raises(ExperimentError, match=r"'nobody' is not in controllers.yaml nor .*configured: .*my_controller"):
        parameters.controllers(experiment.load("none", [given.replace("my_controller", "nobody")]))


def with_globals(tmp_path: Path, values: dict[str, object]) -> Path:
    raw = yaml.safe_load((experiment.config_path("experiments") / "pd_step.yaml").read_text())
    path = tmp_path / "own.yaml"
    path.write_text(yaml.safe_dump(raw | {"duration": 0.6, "global_parameters": values}))
    return path


def test_a_controller_reads_parameters_outside_its_namespace(tmp_path: Path) -> None:
    path = with_globals(tmp_path, {"/robot_ip": "172.16.0.2", "cell/table/height": 0.8, "cell/table/tilt": 0.1})
    with Simulation(str(path)) as simulation:
        node = simulation.node.child("joint_pd_controller")
        assert node.param("/robot_ip") == "172.16.0.2"
        assert simulation.node.param("cell/table") == {"height": 0.8, "tilt": 0.1}
        assert node.search_param("cell") == {"table": {"height": 0.8, "tilt": 0.1}}


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("joint_pd_controller/kp", "other keys of the experiment already set joint_pd_controller"),
        ("/robot_description", "already set robot_description"),
        ("robot ip", "'robot ip' is no name of a ROS parameter"),
        ("a//b", "'a//b' is no name"),
        ("use_sim_time", "already set use_sim_time"),
    ],
)
def test_a_global_parameter_that_is_none_is_refused(tmp_path: Path, name: str, told: str) -> None:
    with pytest.raises(ExperimentError, match=told):
        experiment.load(str(with_globals(tmp_path, {name: 1})))


@pytest.mark.parametrize("value", [None, 2**31, {"a": {"b": None}}, [1, {2: 3}], date(2026, 1, 1)])
def test_a_value_that_the_parameter_server_cannot_hold_is_refused(tmp_path: Path, value: object) -> None:
    with pytest.raises(ExperimentError, match=r"global_parameters\./a is .*; valid: numbers, integers of 32"):
        experiment.load(str(with_globals(tmp_path, {"/a": value})))


def test_editors_have_the_schemas_and_accept_what_is_valid(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, kind, example in (
        ([], "experiment", experiment.EXAMPLE),
        (["--study"], "study", study.EXAMPLE),
        (["--sweep"], "sweep", sweep.EXAMPLE),
    ):
        assert main(["schema", *arguments]) == 0
        printed = capsys.readouterr().out
        kept = experiment.package_path() / "config" / f"{kind}.schema.json"
        assert kept.read_text() == printed, "hric schema prints what this file has to hold"
        folder = experiment.config_path({"experiment": "experiments", "study": "studies", "sweep": "sweeps"}[kind])
        check = jsonschema.Draft202012Validator(json.loads(printed))
        check.validate(yaml.safe_load(example))
        for path in folder.glob("*.yaml"):
            check.validate(yaml.safe_load(path.read_text()))
            (first, *_) = path.read_text().splitlines()
            assert (path.parent / first.rpartition("$schema=")[2]).resolve() == kept
        assert main(["schema", *arguments, "--example"]) == 0
        assert capsys.readouterr().out == example
    experiment.parse("example", yaml.safe_load(experiment.EXAMPLE))
    study.parse("example", yaml.safe_load(study.EXAMPLE))
    sweep.plan("example", yaml.safe_load(sweep.EXAMPLE))


def test_the_motion_capture_of_an_experiment_can_be_changed_key_by_key() -> None:
    run = load("marker_tracking", "noise:=0", "mocap.stream.latency:=0.01", "mocap.human.cycles:=1", "mode:=thesis")
    assert run.mocap is not None
    assert run.mocap.stream | {"noise": 0, "latency": 0.01} == run.mocap.stream and run.mocap.human["cycles"] == 1
    assert run.parameters["cartesian_pose_controller"]["mode"] == "thesis"
    described = parameters.mocap(run, seed=3)
    there = {"base_from_mocap": run.mocap.base_from_mocap, "base_frame": "panda_link0"}
    assert described["natnet_client"] == {"body": "hand", "up_axis": "y"} | there
    assert (described["emulated_human"]["seed"], described["emulated_human"]["base_frame"]) == (3, "panda_link0")
    assert parameters.mocap(load("pd_step")) == {}


def test_the_description_of_who_is_beside_the_robot_is_that_of_their_section() -> None:
    described = read(parameters.human_description(load("hand_guidance", "human.parts:=both_arms")))
    assert described.root == "human_base" and {"r_wrist", "l_wrist"} <= set(described.links)
    with pytest.raises(ExperimentError, match="pd_step: there is no human; valid: a section 'human'"):
        parameters.human_description(load("pd_step"))


def test_a_known_place_of_the_cameras_reaches_both_nodes() -> None:
    base = {"xyz": [1.0, 0.0, 0.0], "xyzw": [0.0, 0.0, 0.0, 1.0]}
    described = parameters.mocap(load("marker_tracking", f"mocap.base_from_mocap:={base}", "arm_id:=left"))
    assert all(
        values["base_from_mocap"] == base and values["base_frame"] == "left_link0" for values in described.values()
    )


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("noise:=-1", "mocap.stream.noise is -1; valid: a finite number from 0 to 1"),
        ("mocap.stream.fps:=1", "no parameter 'fps' in mocap.stream; valid: bitstream, command_port"),
        (
            "mocap.human.program:=walk",
            "no program 'walk' in mocap.human; valid: body, c3d, minimum_jerk, reactive, sinusoid",
        ),
        ("mocap.human:=3", "mocap.human is 3; valid: a mapping"),
        ("mocap.body:=head", "mocap.body is 'head'; valid: hand"),
        ("mocap.camera:=1", "'camera' is not one of arm, base_from_mocap, body, human, stream"),
        ("mocap.base_from_mocap:={xyzw: [1, 1, 0, 0]}", "a unit quaternion"),
        ("mocap:=none", "no override 'mocap'"),
    ],
)
def test_a_mistake_in_the_motion_capture_is_refused_by_its_full_name(given: str, told: str) -> None:
    with pytest.raises(ExperimentError, match=told):
        load("marker_tracking", given)


def test_an_experiment_without_motion_capture_says_so() -> None:
    with pytest.raises(ExperimentError, match="no override 'noise': this experiment has no motion capture"):
        load("pd_step", "noise:=0")


def test_an_unknown_experiment_lists_those_that_exist() -> None:
    with pytest.raises(
        HricError,
        match=r"no experiment 'pdstep'.*valid: co_transport, .*marker_tracking, pd_step, polish, shared_workspace",
    ):
        experiment.read("pdstep")
    with pytest.raises(HricError, match=r"no experiment file nowhere\.yaml"):
        experiment.read("nowhere.yaml")


def test_unknown_and_missing_keys_of_a_file_are_named(tmp_path: Path) -> None:
    path = tmp_path / "own.yaml"
    path.write_text("robot: {hw: a/B}\ncontrollers: [c]\nduration: 1\ncolour: red\n")
    with pytest.raises(ExperimentError, match="experiment own: no parameter 'colour'; valid: arms, controllers"):
        experiment.parse("own", experiment.read(str(path)))
    path.write_text("robot: {}\ncontrollers: [c]\nduration: 1\n")
    with pytest.raises(ExperimentError, match=r"robot\.hw is not set"):
        experiment.parse("own", experiment.read(str(path)))
    path.write_text("robot: {}\ncontrolers: [c]\nsetpoints: [{time: -1}]\nmocap: {stream: {rate: 0}}\n")
    with pytest.raises(ExperimentError) as caught:
        experiment.load(str(path))
    told = str(caught.value)
    assert told.startswith("experiment own: 8 mistakes\n  no parameter 'controlers'; valid: ")
    missing = [f"{key} is not set" for key in ("robot.hw", "setpoints[0].positions", "duration")]
    assert all(part in told for part in ("(did you mean controllers?)", *missing))
    assert told.endswith("for example:\n" + indent(experiment.EXAMPLE.rstrip(), "  "))
    path.write_text("- 1\n")
    with pytest.raises(ExperimentError, match="must be a mapping"):
        experiment.read(str(path))
    path.write_text("a: [\n")
    with pytest.raises(ParameterError, match="is not YAML"):
        experiment.read(str(path))
