"""An engine is a package that exports a plant: every command finds it by its name, and no list names it."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import check, choices, completed, documented  # noqa: E402

from hric_core import plugins  # noqa: E402
from hric_report import headless  # noqa: E402
from hric_run import provenance  # noqa: E402
from hric_run.definition import experiment  # noqa: E402

PACKAGE_XML = """<package format="3"><name>toy_ros_control</name><version>0.7.0</version>
<export><hric_control plugin="${prefix}/plugins.xml"/></export></package>"""
PLUGINS_XML = """<library path="."><class name="toy_ros_control/ToyPlant" type="toy_plant:ToyPlant"
base_class_type="hric_control::Plant"><description>A toy.</description></class></library>"""
PLANT = """from mujoco_ros_control.plant import MujocoPlant


class ToyPlant(MujocoPlant):
    steps = 0

    def step(self):
        ToyPlant.steps += 1
        super().step()
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package with an engine, outside the tree."""
    package = tmp_path / "elsewhere" / "toy_ros_control"
    package.mkdir(parents=True)
    for name, text in {"package.xml": PACKAGE_XML, "plugins.xml": PLUGINS_XML, "toy_plant.py": PLANT}.items():
        (package / name).write_text(text)
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([os.environ["ROS_PACKAGE_PATH"], str(package.parent)]))
    monkeypatch.syspath_prepend(str(package))
    caches = plugins.clear_cache, provenance._code.cache_clear
    for clear in caches:
        clear()
    yield
    for clear in caches:
        clear()


@pytest.mark.usefixtures("toy")
def test_the_bring_up_knows_an_engine_from_outside_the_tree() -> None:
    assert completed("simulator:=t") == ["simulator:=toy"]
    given = {"env": "sim", "simulator": "toy"}
    assert check(given, documented(), choices()) == given


@pytest.mark.usefixtures("toy")
def test_a_run_is_on_an_engine_from_outside_the_tree_and_says_so(tmp_path: Path) -> None:
    words = ("simulator:=toy", "duration:=0.2")
    folder = headless.run(
        experiment.load("pd_step", words), words, root=tmp_path / "runs", progress=False, figures=False
    ).folder
    assert sys.modules["toy_plant"].ToyPlant.steps > 0
    run = yaml.safe_load((folder.path / "run.yaml").read_text())
    assert run["definition"]["robot"]["plant_type"] == "toy_ros_control/ToyPlant"
    assert run["versions"]["toy_ros_control"] == "0.7.0"
