"""scripts/bringup refuses a misspelt name and a wrong value before anything starts, with what would be valid."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import ArgumentError, Choices, check, split  # noqa: E402
from bringup_master import MasterError, call, choose, free_port  # noqa: E402

NAMES = (
    "env", "robot_ip", "robot", "simulator", "controller", "experiment", "rviz", "gui", "ns", "xyz", "kp", "q_start", "real_time_factor", "world",
    "arm_id", "rotor_inertia", "load_gripper",
)  # fmt: skip
CHOICES = Choices(("joint_state_controller", "joint_pd_controller", "effort_joint_trajectory_controller"), ("pd_step", "thesis_step"))


def checked(*arguments: str) -> dict[str, str]:
    return check(split(arguments), NAMES, CHOICES)


@pytest.mark.parametrize(
    ("argument", "texts"),
    [
        ("envv:=real", ("envv", "did you mean env", "simulator")),
        ("env:=gazebo", ("gazebo", "sim, real")),
        ("env=sim", ("name:=value", "env:=sim")),
        ("--rviz", ("--rviz", "name:=value")),
        ("controller:=pd", ("pd", "joint_pd_controller", "none")),
        ("controller:=joint_state_controller", ("effort_joint_trajectory_controller",)),
        ("experiment:=step", ("pd_step, thesis_step", ".yaml")),
        ("experiment:=/nowhere/x.yaml", ("/nowhere/x.yaml", "no such file")),
        ("rviz:=yes", ("true, false, auto",)),
        ("load_gripper:=yes", ("true, false, auto",)),
        ("ns:=a-b", ("namespace",)),
        ("arm_id:=2nd", ("letters",)),
        ("xyz:=1,2", ("three numbers",)),
        ("xyz:='0 0 nan'", ("three numbers",)),
        ("kp:=-1", ("0 or more",)),
        ("kp:=[1,2]", ("7 of them",)),
        ("kp:=.nan", ("not a number",)),
        ("kp:=stiff", ("not a number",)),
        ("q_start:=[0,0]", ("7 angles",)),
        ("real_time_factor:=-1", ("as fast as possible",)),
        ("real_time_factor:=true", ("not a number",)),
        ("world:=nowhere.yaml", ("no such file",)),
        ("env:=real", ("robot_ip", "172.16.0.2")),
        ("robot_ip:=127.0.0.2", ("env:=real",)),
    ],
)
def test_a_mistake_is_answered_with_what_is_valid(argument: str, texts: tuple[str, ...]) -> None:
    with pytest.raises(ArgumentError) as error:
        checked(argument)
    for text in texts:
        assert text in str(error.value)


def test_an_argument_given_twice_is_refused() -> None:
    with pytest.raises(ArgumentError, match="twice"):
        checked("env:=sim", "env:=real")


def test_good_values_pass_and_are_brought_into_one_form(tmp_path: Path) -> None:
    world = tmp_path / "w.yaml"
    world.write_text("{}")
    assert checked("rviz:=False", "ns:=left", "xyz:=0, 0, 1", "experiment:=pd_step", f"world:={world}") == {
        "rviz": "false",
        "ns": "/left",
        "xyz": "0 0 1",
        "experiment": "pd_step",
        "world": str(world),
    }
    angles = "[0, -pi/4, 0, -3*pi/4, 0, pi/2, pi/4]"
    assert checked(f"q_start:={angles}", "kp:=[1,2,3,4,5,6,7]") == {"q_start": angles.replace(" ", ""), "kp": "[1,2,3,4,5,6,7]"}


def bringup(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(ROOT / "scripts/bringup"), *arguments], env={**os.environ, **environment}, capture_output=True, text=True, timeout=60)


def test_the_arm_itself_is_asked_for_by_address_and_kind() -> None:
    given = ("env:=real", "robot_ip:=172.16.0.2", "robot:=fr3", "kp:=50")
    assert checked(*given) == {"env": "real", "robot_ip": "172.16.0.2", "robot": "fr3", "kp": "50"}
    for wrong, texts in (("robot:=panda2", "panda, fr3"), ("gui:=true", "env:=sim only"), ("real_time_factor:=0", "env:=sim only")):
        with pytest.raises(ArgumentError, match=texts):
            checked("env:=real", "robot_ip:=panda.lab", wrong)
    for address in ("none", "172.16.0.2 ", "a b", "-x", "$(reboot)"):
        with pytest.raises(ArgumentError, match="not an address"):
            check({"env": "real", "robot_ip": address}, NAMES, CHOICES)


def test_an_address_where_no_arm_is_is_told_before_anything_starts() -> None:
    port = free_port()
    # Nobody listens there; on loopback that is told at once.
    result = bringup("env:=real", "robot_ip:=127.0.9.9", ROS_MASTER_URI=f"http://localhost:{port}")
    assert result.returncode == 1
    assert "no Franka arm at 127.0.9.9" in result.stderr and "FCI" in result.stderr
    assert "Traceback" not in result.stderr and result.stderr.count("\n") == 1
    assert call(f"http://localhost:{port}", "getPid") is None


def test_help_explains_every_argument_with_its_default() -> None:
    result = bringup("--help")
    assert result.returncode == 0
    for text in ("env:=sim", "real_time_factor:=1.0", "[N m/rad]", "rotor inertia", "experiment:=none"):
        assert text in result.stdout


def test_a_remote_master_that_does_not_answer_is_an_error() -> None:
    with pytest.raises(MasterError, match="no ROS master answers at"):
        choose("http://no-such-host.invalid:11311", "/robot")


def test_a_port_taken_by_something_else_is_avoided() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = f"http://localhost:{other.getsockname()[1]}"
        uri, running = choose(taken, "/robot")
    assert uri != taken and not running


def test_a_free_port_is_taken_as_asked() -> None:
    uri = f"http://localhost:{free_port()}"
    assert choose(uri, "/robot") == (uri, False)
