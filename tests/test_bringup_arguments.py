"""scripts/bringup refuses misspelt names and invalid values before anything starts, and names the valid ones."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import (  # noqa: E402
    ArgumentError,
    Choices,
    check,
    choices,
    completed,
    device,
    has_section,
    instances,
    split,
)
from bringup_end import LONGER, _name  # noqa: E402
from bringup_master import MasterError, call, choose, free_port  # noqa: E402
from bringup_ready import arm, engine  # noqa: E402

NAMES = (
    "env",
    "robot_ip",
    "arms",
    "robot",
    "simulator",
    "controller",
    "experiment",
    "rviz",
    "gui",
    "ns",
    "xyz",
    "kp",
    "q_start",
    "real_time_factor",
    "world",
    "arm_id",
    "rotor_inertia",
    "realism",
    "load_gripper",
    "record",
    "subject",
    "notes",
    "split_size",
    "split_duration",
    "mocap",
    "mocap_server",
    "mocap_calibration",
    "emg",
    "force_plate",
    "view",
    "control",
)
CONTROLLERS = ("joint_state_controller", "joint_pd_controller", "effort_joint_trajectory_controller")
CHOICES = Choices(
    CONTROLLERS,
    ("marker_tracking", "pd_step", "thesis_step"),
    {"mocap": ("marker_tracking",), "emg": ("data_collection",), "human": ("thesis_step",)},
    ("mujoco", "pybullet"),
)


def checked(*arguments: str) -> dict[str, str]:
    return check(split(arguments), NAMES, CHOICES)


@pytest.mark.parametrize(
    ("argument", "texts"),
    [
        ("control:=yes", ("control", "true", "false")),
        ("envv:=real", ("envv", "did you mean env", "simulator")),
        ("env:=gazebo", ("gazebo", "sim, real")),
        ("env=sim", ("name:=value", "env:=sim")),
        ("--rviz", ("--rviz", "name:=value")),
        ("controller:=pd", ("pd", "joint_pd_controller", "none")),
        ("controller:=joint_state_controller", ("effort_joint_trajectory_controller",)),
        ("experiment:=step", ("marker_tracking, pd_step, thesis_step", ".yaml")),
        ("experiment:=/nowhere/x.yaml", ("/nowhere/x.yaml", "no such file")),
        ("rviz:=yes", ("true, false, auto",)),
        ("view:=curves", ("true, false, auto, plot",)),
        ("load_gripper:=yes", ("true, false, auto",)),
        ("record:=later", ("true, false, auto, on_trigger",)),
        ("subject:=Jane Doe", ("for example subject:=P07", "names of people")),
        ("notes:=a:=b", ("cannot contain",)),
        ("split_size:=-1", ("0 means never",)),
        ("split_duration:=long", ("not a number",)),
        ("ns:=a-b", ("namespace",)),
        ("arm_id:=2nd", ("letters",)),
        ("xyz:=1,2", ("three numbers",)),
        ("xyz:='0 0 nan'", ("three numbers",)),
        ("kp:=-1", ("0 or more",)),
        ("kp:=[1,2]", ("7 of them",)),
        ("kp:=.nan", ("not a number",)),
        ("kp:=stiff", ("not a number",)),
        ("q_start:=[0,0]", ("7 angles",)),
        ("realism:=clean", ("auto, ideal, measured", "for example {preset: measured, dq_noise: 0}")),
        ("realism:={preset", ("auto, ideal, measured",)),
        ("real_time_factor:=-1", ("as fast as possible",)),
        ("real_time_factor:=true", ("not a number",)),
        ("world:=nowhere.yaml", ("no such file",)),
        ("env:=real", ("robot_ip", "172.16.0.2")),
        ("robot_ip:=127.0.0.2", ("env:=real",)),
        ("mocap:=optitrack", ("auto, none, emulated, motive",)),
        ("emg:=true", ("auto, none, emulated, real",)),
        ("force_plate:=kistler", ("auto, none, emulated, real",)),
        ("mocap_server:=motive.lab", ("IPv4", "192.168.1.10")),
        ("mocap_server:=192.168.1.10", ("motion capture", "mocap:=motive")),
        ("mocap_calibration:=/nowhere/base.yaml", ("/nowhere/base.yaml", "no such file")),
    ],
)
def test_a_mistake_is_answered_with_what_is_valid(argument: str, texts: tuple[str, ...]) -> None:
    with pytest.raises(ArgumentError) as error:
        checked(argument)
    for text in texts:
        assert text in str(error.value)


@pytest.mark.parametrize(
    "given", [("experiment:=marker_tracking",), ("mocap:=motive",), ("mocap:=emulated", "experiment:=pd_step")]
)
def test_an_unpaced_run_has_no_motion_capture(given: tuple[str, ...]) -> None:
    with pytest.raises(ArgumentError, match="paced run; valid: a factor above 0, or the headless runner"):
        checked(*given, "real_time_factor:=0")
    checked(*given, "real_time_factor:=0.5")


def test_mocap_is_emulated_unless_requested(
    tmp_path: Path,
) -> None:
    own, other = tmp_path / "own.yaml", tmp_path / "other.yaml"
    own.write_text("mocap: {human: {program: sinusoid}}\n")
    other.write_text("robot: {}\n")
    for given, wanted in (
        ((), "none"),
        (("experiment:=pd_step",), "none"),
        (("experiment:=marker_tracking",), "emulated"),
        ((f"experiment:={own}",), "emulated"),
        ((f"experiment:={other}",), "none"),
        (("experiment:=marker_tracking", "mocap:=none"), "none"),
        (("experiment:=marker_tracking", "mocap:=motive", "mocap_server:=192.168.1.10"), "motive"),
    ):
        assert device("mocap", checked(*given), CHOICES) == wanted
    assert not has_section(tmp_path / "nowhere.yaml", "mocap")


def test_sensors_are_emulated_unless_requested(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("emg: {channels: 4}\nforce_plate: {id: 1}\n")
    for given, wanted in (
        ((), ("none", "none")),
        (("experiment:=data_collection",), ("emulated", "none")),
        ((f"experiment:={own}",), ("emulated", "emulated")),
        ((f"experiment:={own}", "emg:=real", "force_plate:=none"), ("real", "none")),
        (("emg:=emulated",), ("emulated", "none")),
    ):
        arguments = check(
            split(given), NAMES, Choices(CONTROLLERS, ("data_collection",), {"emg": ("data_collection",)})
        )
        assert tuple(device(name, arguments, CHOICES) for name in ("emg", "force_plate")) == wanted
    with pytest.raises(
        ArgumentError, match=r"not possible with sensors \(emg:=emulated\), which are received over the network"
    ):
        checked("emg:=emulated", "real_time_factor:=0")
    checked("emg:=emulated", "real_time_factor:=0.5")


def test_a_calibration_belongs_to_a_real_motive(tmp_path: Path) -> None:
    saved = tmp_path / "base_from_mocap.yaml"
    saved.write_text("{}")
    with pytest.raises(ArgumentError, match="needs mocap:=motive"):
        checked("experiment:=marker_tracking", f"mocap_calibration:={saved}")
    assert checked("mocap:=motive", f"mocap_calibration:={saved}")["mocap_calibration"] == str(saved)


def test_what_says_something_about_a_recording_needs_one() -> None:
    with pytest.raises(
        ArgumentError,
        match=r"subject, split_size can be given with a recording only; valid: record:=true or record:=on_trigger",
    ):
        checked("record:=False", "subject:=P07", "split_size:=100")
    given = ("record:=on_trigger", "subject:=P07", "notes:=left hand, tired", "split_duration:=60")
    assert checked(*given) == {
        "record": "on_trigger",
        "subject": "P07",
        "notes": "left hand, tired",
        "split_duration": "60",
    }


def test_an_argument_given_twice_is_refused() -> None:
    with pytest.raises(ArgumentError, match="twice"):
        checked("env:=sim", "env:=real")


def test_good_values_are_normalised(tmp_path: Path) -> None:
    world = tmp_path / "w.yaml"
    world.write_text("{}")
    assert checked("rviz:=False", "ns:=left", "xyz:=0, 0, 1", "experiment:=pd_step", f"world:={world}") == {
        "rviz": "false",
        "ns": "left",
        "xyz": "0 0 1",
        "experiment": "pd_step",
        "world": str(world),
    }
    angles = "[0, -pi/4, 0, -3*pi/4, 0, pi/2, pi/4]"
    assert checked("realism:={preset: measured, dq_noise: 0}") == {"realism": "{preset: measured, dq_noise: 0}"}
    assert checked(f"q_start:={angles}", "kp:=[1,2,3,4,5,6,7]") == {
        "q_start": angles.replace(" ", ""),
        "kp": "[1,2,3,4,5,6,7]",
    }


def bringup(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(ROOT / "scripts/bringup"), *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_arm_is_probed_by_address() -> None:
    given = ("env:=real", "robot_ip:=172.16.0.2", "robot:=fr3", "kp:=50")
    assert checked(*given) == {"env": "real", "robot_ip": "172.16.0.2", "robot": "fr3", "kp": "50"}
    for wrong, texts in (
        ("robot:=panda2", "panda, fr3"),
        ("gui:=true", "env:=sim only"),
        ("real_time_factor:=0", "env:=sim only"),
    ):
        with pytest.raises(ArgumentError, match=texts):
            checked("env:=real", "robot_ip:=panda.lab", wrong)
    for address in ("none", "172.16.0.2 ", "a b", "-x", "$(reboot)"):
        with pytest.raises(ArgumentError, match="not an address"):
            check({"env": "real", "robot_ip": address}, NAMES, CHOICES)


def test_the_emulated_arm_takes_no_pace() -> None:
    given = ("env:=real", "robot_ip:=emulated", "robot:=fr3", "simulator:=mujoco", "rotor_inertia:=0.2", "gui:=true")
    assert checked(*given)["simulator"] == "mujoco"
    with pytest.raises(ArgumentError, match="real_time_factor can be given with env:=sim only"):
        checked(*given, "real_time_factor:=0.5")
    with pytest.raises(ArgumentError, match="robot_ip can be given with env:=real only"):
        checked("robot_ip:=emulated")


def test_motion_capture_of_several_arms_needs_an_experiment_that_names_one(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"mocap:=emulated with several arms needs an experiment .*: mocap.arm"):
        checked("arms:=left,right", "mocap:=emulated")
    own = tmp_path / "own.yaml"
    own.write_text("mocap: {arm: left}\n")
    checked("arms:=left,right", f"experiment:={own}")


def test_a_simulated_human_needs_no_real_arm(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text("human: {subject: P50_male}\n")
    for experiment in ("thesis_step", str(own)):
        given = ("env:=real", f"experiment:={experiment}")
        with pytest.raises(ArgumentError, match="cannot act on a real arm; valid: robot_ip:=emulated, or env:=sim"):
            checked(*given, "robot_ip:=172.16.0.2")
        checked(*given, "robot_ip:=emulated")
        checked(f"experiment:={experiment}")
    assert {"co_transport", "hand_guidance", "handover"} <= set(choices().having["human"])


def test_what_stands_at_an_address_is_said() -> None:
    shown = {"robot": "fr3", "simulator": "mujoco"}
    assert arm({**shown, "robot_ip": "172.16.0.2"}) == "fr3 at 172.16.0.2"
    assert arm({**shown, "robot_ip": "emulated"}) == "emulated fr3 (mujoco)"


def test_the_engine_is_that_of_the_argument_the_experiment_or_the_default(tmp_path: Path) -> None:
    assert engine({"simulator": "opensim", "experiment": "try_contact"}) == "opensim"
    assert engine({"simulator": "auto", "experiment": "try_contact"}) == "mujoco"
    assert [engine({"simulator": "auto", "experiment": name}) for name in ("none", "pd_step")] == ["pybullet"] * 2
    own = tmp_path / "own.yaml"
    own.write_text("robot:\n  plant_type: toy_ros_control/ToyPlant\n")
    assert engine({"simulator": "auto", "experiment": str(own)}) == "toy"


def test_an_address_without_arm_is_refused() -> None:
    port = free_port()
    # No program listens at this address; on loopback a connection is refused at once.
    result = bringup("env:=real", "robot_ip:=127.0.9.9", ROS_MASTER_URI=f"http://localhost:{port}")
    assert result.returncode == 1
    assert "no Franka arm at 127.0.9.9" in result.stderr and "FCI" in result.stderr
    assert "Traceback" not in result.stderr and result.stderr.count("\n") == 1
    assert call(f"http://localhost:{port}", "getPid") is None


@pytest.mark.parametrize(
    ("script", "texts"),
    [
        ("bringup", ("env:=sim", "real_time_factor:=1.0", "[N m/rad]", "experiment:=none")),
        ("replay", ("--rate R",)),
        ("setup", ("usage: scripts/setup",)),
        ("test", ("scripts/test --live",)),
        ("lint", ("scripts/lint --fix",)),
    ],
)
def test_help_needs_no_set_up(tmp_path: Path, script: str, texts: tuple[str, ...]) -> None:
    """Run in a copy without set-up, by a Python without packages; test_wrong_inputs.py tests invalid arguments."""
    sources = ("src/hric_bags/src", "src/hric_core/src")  # folder in which scripts/replay searches for a run
    for folder in ("scripts", "src/hric_bringup", "src/hric_experiments/config", *sources):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    before = os.times()
    done = subprocess.run(
        [str(tmp_path / "scripts" / script), "--help"],
        env={"PATH": os.defpath},
        capture_output=True,
        text=True,
        timeout=60,
    )
    after = os.times()
    assert done.returncode == 0, done.stderr
    assert all(text in done.stdout for text in texts)
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    assert spent < 0.3
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scripts", "src"]


def test_the_shell_completes_names_and_values() -> None:
    assert completed("real") == ["realism:=", "real_time_factor:="]
    assert completed("controller:") == ["controller:="]
    assert completed("simulator:=") == [f"simulator:={name}" for name in ("mujoco", "opensim", "pybullet", "auto")]
    assert "controller:=effort_joint_trajectory_controller" in completed("controller:=eff")
    assert completed("experiment:=pd") == ["experiment:=pd_step"] and completed("kp:=") == completed("colour:=") == []


def test_controllers_of_other_packages_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "src/hric_controllers/templates/my_controller", tmp_path / "my_controller")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert "my_controller" in choices().controllers
    text = "a:\n  # of mine\n  type: x/Y\n\nb: {kp: 1, type: x/Z}\nc: 3\nd:\n  kp: 1\ne:\n  kp:\n    type: x/Y\n"
    assert instances(text) == ["a", "b", "e"]


def test_a_silent_remote_master_is_an_error() -> None:
    with pytest.raises(MasterError, match="no ROS master responds at"):
        choose("http://no-such-host.invalid:11311", "/robot")


def test_a_port_taken_by_something_else_is_avoided() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = f"http://localhost:{other.getsockname()[1]}"
        uri, running = choose(taken, "/robot")
    assert uri != taken and not running


def test_a_free_port_is_taken_as_requested() -> None:
    uri = f"http://localhost:{free_port()}"
    assert choose(uri, "/robot") == (uri, False)


def test_friction_is_a_name_or_file(tmp_path: Path) -> None:
    file = tmp_path / "friction.yaml"
    file.touch()
    names = ("env", "friction")
    assert check({"friction": str(file)}, names, CHOICES) == {"friction": str(file)}
    assert check({"friction": "identified"}, names, CHOICES) == {"friction": "identified"}
    with pytest.raises(ArgumentError, match=r"friction:=nowhere.yaml: there is no such file"):
        check({"friction": "nowhere.yaml"}, names, CHOICES)
    with pytest.raises(
        ArgumentError,
        match=r"friction:=dry is not possible; valid: none, coulomb, identified, auto, or the path of a .yaml file",
    ):
        check({"friction": "dry"}, names, CHOICES)


@pytest.mark.parametrize("process", ["recorder-7", "cell/recorder-7", "lab/cell-2/recorder-7"])
def test_a_recorder_has_as_long_to_end_in_any_namespace(process: str) -> None:
    assert _name(SimpleNamespace(name=process)) in LONGER
