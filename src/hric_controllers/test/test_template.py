import os
import re
import shutil
from pathlib import Path

import pytest
import rospkg
import yaml
from controllers_rig import Lab

from hric_core import plugins

PACKAGE = Path(__file__).parents[1]
TEMPLATE = PACKAGE / "templates" / "my_controller"
ARM = [f"panda_joint{i}" for i in range(1, 8)]


@pytest.fixture
def copied(tmp_path, monkeypatch):
    shutil.copytree(TEMPLATE, tmp_path / "src" / "my_controller")
    monkeypatch.setenv(
        "ROS_PACKAGE_PATH", os.pathsep.join([str(tmp_path / "src"), os.environ.get("ROS_PACKAGE_PATH", "")])
    )
    plugins.clear_cache()
    yield tmp_path / "src" / "my_controller"
    plugins.clear_cache()


def test_a_copy_of_the_template_loads_and_runs_without_a_build(copied):
    bench = Lab(yaml.safe_load((copied / "config" / "my_controller.yaml").read_text()), ARM)
    bench.load("my_controller")
    bench.run(0.1)
    bench.hw.states.position[0] = 0.1
    bench.run(5.0)
    assert bench.hw.states.position == pytest.approx([0.0] * 7, abs=1e-3)
    assert bench.state("my_controller") == "running"


def test_the_template_inside_this_package_is_not_found_as_a_package():
    assert "my_controller/JointSpring" not in plugins.names(plugins.CONTROLLER)
    assert "my_controller" not in rospkg.RosPack([str(PACKAGE.parent)]).list()


def test_the_templates_controller_has_about_20_lines():
    text = (TEMPLATE / "src" / "my_controller" / "joint_spring.py").read_text()
    code = [line for line in re.sub(r'""".*?"""', "", text, flags=re.S).splitlines() if line.strip()]
    assert len(code) <= 20


def test_the_launch_file_of_the_template_names_what_exists():
    text = (TEMPLATE / "launch" / "my_controller.launch").read_text()
    assert "config/my_controller.yaml" in text
    assert (PACKAGE.parent / "controller_manager").is_dir()
