"""Another robot than the Panda: its description is the same wherever the command is called, its units are its own."""

from pathlib import Path

import pytest

from hric_core.urdf import read
from hric_report import headless
from hric_run.definition import experiment
from hric_run.definition.robot_description import description

ROBOT = """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="a"><collision><geometry>
<mesh filename="meshes/a.obj"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize("name", ["r.urdf", "r.urdf.xacro"])
def test_its_meshes_lie_beside_its_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / name).write_text(ROBOT)
    monkeypatch.chdir(tmp_path)
    spec = experiment.load("pd_step", [f"robot.urdf:={tmp_path / 'robot' / name}"]).robot
    (shape,) = read(description(spec)).links["a"].collisions
    assert shape.address == str(tmp_path / "robot/meshes/a.obj")


LINK = """<link name="{}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="2" effort="100"/></joint>
<transmission name="of_{0}"><type>transmission_interface/SimpleTransmission</type><actuator name="motor_{0}"/>
<joint name="{0}"><hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface></joint>
</transmission>"""
SCARA = "".join(
    [
        '<robot name="scara">',
        *map(LINK.format, ("base", "arm", "quill")),
        JOINT.format("turn", "revolute", "base", "arm"),
        JOINT.format("lift", "prismatic", "arm", "quill"),
        "</robot>",
    ]
)


def test_a_report_names_the_joints_whose_values_are_in_metres(tmp_path: Path) -> None:
    (tmp_path / "scara.urdf").write_text(SCARA)
    overrides = [
        *("robot.hw:=hric_control/RobotHWSim", f"robot.urdf:={tmp_path / 'scara.urdf'}", "robot.q_start:=[0, 0]"),
        *("setpoints.0.positions:=[0.1, 0.1]", "controllers:=[joint_state_controller, joint_pd_controller]"),
        *("gravity:=true", "duration:=1.0"),
    ]
    definition = experiment.load("pd_step", overrides)
    metrics = headless.run(definition, overrides, root=tmp_path, progress=False, figures=False).metrics
    assert metrics["prismatic"] == ["lift"]
    assert "lift: prismatic; units are m, m/s, N and N/s instead of rad" in metrics["report"]
