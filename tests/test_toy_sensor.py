"""A sensor of a package outside the workspace: its section is known by its plugin alone."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

NODES = Path(__file__).parents[1] / "src" / "hric_experiments" / "nodes"
PACKAGE = """<package format="3"><name>toy_sensor</name><version>0.0.0</version><description>A gauge.</description>
<maintainer email="toy@hric.example">toy</maintainer><license>Apache-2.0</license>
<export><hric_control plugin="${prefix}/plugins.xml"/></export></package>
"""
PLUGINS = """<library path="src">
<class name="gauge" type="toy_gauge:GaugeSection" base_class_type="hric_perception::Sensor">
<description>gauge</description></class></library>
"""
MODULE = '''"""A gauge that shows the same force all the time."""

from dataclasses import dataclass

import numpy as np

from hric_core.parameters import number
from hric_msgs.msg import SampleChunk
from hric_perception.chunk import chunk_message
from hric_perception.emulation import faults_of
from hric_perception.sampled import Device, DeviceSettings, DriverSettings
from hric_perception.section import SensorSection
from hric_perception.simulated import always


class GaugePublisher:
    def __init__(self, node):
        self._chunks = node.advertise(node.beside("hric/perception/gauge"), SampleChunk, queue_size=100)

    def choose(self, layout):
        return layout

    def publish(self, chunk):
        self._chunks.publish(chunk_message(chunk))


@dataclass(frozen=True)
class GaugeDriver(DriverSettings):
    kind = "Gauge"

    def publisher(self, node, on_trouble):
        return GaugePublisher(node)


@dataclass(frozen=True)
class Gauge(DeviceSettings):
    kind = "Gauge"
    force: float = number(1.0, minimum=0.0, unit="N")

    def device(self, node):
        def signal(first, times):
            return np.full((len(times), 1), self.force)

        faults = faults_of(self.faults, node.resolve("faults"), self.seed)
        return Device(self, ("grip",), ("N",), signal, faults, always, None)


@dataclass(frozen=True)
class GaugeSection(SensorSection):
    name, emulated_name = "gauge", "emulated_gauge"
    channels: tuple[str, ...] = ("grip",)

    @classmethod
    def parts(cls):
        return GaugeDriver, Gauge

    @property
    def source(self):
        return self._source("hric/perception/gauge", {"N": self.channels})
'''
EXPERIMENT = {
    "robot": {"hw": "franka_sim/FrankaHWSim"},
    "controllers": ["joint_state_controller", "joint_pd_controller"],
    "duration": 0.5,
    "gauge": {"rate": 200, "emulated": {"force": 4.5}},
}


class Lab:
    """Commands in an environment that has the package."""

    def __init__(self, folder: Path) -> None:
        package, self.folder = folder / "toy_sensor", folder
        (package / "src").mkdir(parents=True)
        for name, text in (("package.xml", PACKAGE), ("plugins.xml", PLUGINS), ("src/toy_gauge.py", MODULE)):
            (package / name).write_text(text)
        (folder / "toy.yaml").write_text(yaml.safe_dump(EXPERIMENT))
        self._environment = {**os.environ, "ROS_PACKAGE_PATH": f"{folder}:{os.environ['ROS_PACKAGE_PATH']}"}

    def __call__(self, command: str, *words: str) -> tuple[int, str]:
        """Exit code and what was printed."""
        done = subprocess.run(
            [sys.executable, str(NODES / command), *words],
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=120,
        )
        return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("toy"))


def test_its_samples_are_in_the_bag_of_a_headless_run_and_in_an_export(lab: Lab) -> None:
    code, said = lab(
        "run", "toy.yaml", "gauge.rate:=400", "--runs", str(lab.folder / "runs"), "--quiet", "--no-figures"
    )
    assert code == 0, said
    run = (lab.folder / "runs" / "latest").resolve()
    recorded: dict[str, Any] = yaml.safe_load((run / "run.yaml").read_text())
    assert recorded["definition"]["gauge"]["rate"] == 400.0
    code, said = lab("export", str(run), "--format", "csv")
    assert code == 0, said
    (table,) = run.rglob("*gauge*.csv")
    head, *rows = (line for line in table.read_text().splitlines() if not line.startswith("#"))
    column = next(k for k, label in enumerate(head.split(",")) if "grip" in label)
    assert {float(row.split(",")[column]) for row in rows} == {4.5} and 150 < len(rows) <= 201


def test_it_is_described_in_the_schema_and_a_wrong_key_is_refused_with_its_keys(lab: Lab) -> None:
    code, printed = lab("describe", "emulated_gauge", "toy.yaml")
    device = yaml.safe_load(printed)
    assert code == 0 and (device["force"], device["rate"], device["name"]) == (4.5, 200.0, "emulated_gauge")
    code, printed = lab("schema")
    assert code == 0 and "device" in json.loads(printed)["properties"]["gauge"]["anyOf"][0]["properties"]
    code, printed = lab("run", "toy.yaml", "gauge.colour:=red")
    assert code == 2 and "'colour' is not one of chunk, device, emulated, lsl, rate, transport" in printed
