"""The xacro command in a sourced shell, as users and launch files call it."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
ROBOT = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:arg name="size" default="1"/>
  <xacro:include filename="$(find {package})/urdf/part.xacro"/><xacro:part size="$(arg size)"/></robot>"""
PART = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="part" params="size"><link name="part_${2*size}"/></xacro:macro></robot>"""


def shell(words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command in a shell that sourced scripts/env, with the folder's packages beside the workspace's."""
    lines = f'. "{ROOT}/scripts/env" && export ROS_PACKAGE_PATH="{folder}:$ROS_PACKAGE_PATH" && {words}'
    # Nothing of the shell that runs the tests, which has sourced it already.
    environment = {name: os.environ[name] for name in ("HOME", "LANG", "TERM") if name in os.environ} | {
        "PATH": "/usr/bin:/bin"
    }
    return subprocess.run(
        ["bash", "-c", lines], cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False
    )


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """A description with a part in a ROS 1 package of its own."""
    package = tmp_path / "some_robot"
    (package / "urdf").mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>some_robot</name></package>")
    (package / "urdf/part.xacro").write_text(PART)
    (tmp_path / "r.urdf.xacro").write_text(ROBOT.format(package="some_robot"))
    return tmp_path


@pytest.mark.parametrize("command", ["xacro", "rosrun xacro xacro", '"$(rospack find xacro)/nodes/xacro"'])
def test_find_finds_the_packages_of_ros_1(command: str, robot: Path) -> None:
    done = shell(f"{command} r.urdf.xacro size:=3", robot)
    assert done.returncode == 0, done.stderr
    assert '<link name="part_6"/>' in done.stdout


def test_a_launch_file_that_uses_xacro_gets_it(robot: Path) -> None:
    (robot / "a.launch").write_text(
        '<launch><param name="robot_description" command="$(find xacro)/xacro r.urdf.xacro size:=4"/></launch>'
    )
    done = shell("roslaunch --dump-params a.launch", robot)
    assert done.returncode == 0, done.stderr
    assert "part_8" in done.stdout


def test_the_panda_of_this_workspace_is_expanded(tmp_path: Path) -> None:
    done = shell('xacro "$(rospack find panda_description)/urdf/panda.urdf.xacro"', tmp_path)
    assert done.returncode == 0, done.stderr
    assert '<link name="panda_link7">' in done.stdout


def test_a_package_that_does_not_exist_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "r.urdf.xacro").write_text(ROBOT.format(package="no_such_robot"))
    done = shell("xacro r.urdf.xacro", tmp_path)
    assert done.returncode == 2
    assert "no_such_robot" in done.stderr and "Traceback" not in done.stderr
