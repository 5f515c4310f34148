"""Another robot than the Panda: its description is the same wherever the command is called."""

from pathlib import Path

import pytest

from hric_core.urdf import read
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
