"""Plugins from packages outside the workspace work: engine, sensor, section, sampler, figures and others."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import known_bags
import pytest
import test_sweep as sweeps
import yaml
from in_process import Here, carried_out

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts/lib"))
from bringup_arguments import check, choices, completed, documented  # noqa: E402

from hric_assessment.ergonomics.scoring import methods  # noqa: E402
from hric_assessment.verdict import assess, opened  # noqa: E402
from hric_assessment.verdict.result import verdict_schema  # noqa: E402
from hric_bags.run_folder import RunFolder  # noqa: E402
from hric_core import plugins  # noqa: E402
from hric_report import drawing  # noqa: E402
from hric_report.html import page, run_data, run_page  # noqa: E402
from hric_report.html import verdict as verdict_page  # noqa: E402
from hric_sweep import definition  # noqa: E402

HRIC = ROOT / "src/hric_core/nodes/hric"
MOST_FILES = 3
"""Maximum number of files of an example plugin."""
PACKAGE = """<package format="3"><name>{name}</name><version>0.7.0</version><description>A toy.</description>
<maintainer email="toy@hric.example">toy</maintainer><license>Apache-2.0</license>
<export><hric_core plugin="${{prefix}}/plugins.xml"/></export></package>
"""
PLUGINS = """<library path="src"><class name="{name}" type="{type}" base_class_type="{base}">
<description>a toy</description></class></library>
"""
ENGINE = """
from mujoco_ros_control.plant import MujocoPlant


class ToyPlant(MujocoPlant):
    '''MuJoCo under another name.'''
"""
SENSOR = '''
"""A gauge that shows the same force all the time."""

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
SECTION = '''
"""A knock on the robot's joint state topic at a time of the run."""

from dataclasses import dataclass

from std_msgs.msg import Float64

from hric_core.parameters import number
from hric_run.definition.sections import ExperimentSection


class Knocker:
    def __init__(self, node, time):
        self._topic, self._time = node.advertise("knock", Float64, queue_size=1), time

    def advance(self, time):
        if self._time is not None and time >= self._time:
            self._topic.publish(Float64(data=time))
            self._time = None


@dataclass(frozen=True)
class KnockSection(ExperimentSection):
    at: float = number(minimum=0.0, unit="s", text="robot time of the knock")

    def headless(self, node, seed):
        return Knocker(node, self.at)
'''
EXPORT = """
from hric_bags.export.table import Export


class Heads(Export):
    def write(self, table, path):
        path.write_text(f"{table.topic} {len(table.time)}\\n")
"""
POSTURE = """
from functools import cache

import yaml

from hric_assessment.ergonomics.scoring import PostureMethod
from hric_assessment.tables import PostureTable

TABLE = '''
title: NECK
edition: "1"
sources: {us: a test}
source: us
chosen: {}
parts: {neck: {bands: [{angle: neck_flexion, bounds: [20], scores: [1, 2]}]}}
static_time: 60
repeats: 4
light: 1
heavy: 2
within: {value: 1}
warning: {value: 2}
levels: {"1": upright, "2": bent}
table_a: {}
table_b: {}
table_c: {}
'''


@cache
def table():
    return PostureTable.of(yaml.safe_load(TABLE), "neck:")


class Neck(PostureMethod):
    table = staticmethod(table)
    task_fields = ("held",)

    def total(self, scorer, task, version):
        return scorer.part("neck")
"""
COMMAND = """
from hric_core.command import Argument, Command


class Sum(Command):
    '''Add numbers.'''

    def arguments(self):
        return [Argument("numbers", nargs="+", type=float)]

    def run(self, given):
        print(sum(given.numbers))
"""
FIGURE = """
from hric_report import sections
from hric_report.figure import Curve, Figure, Panel


def figures(data):
    log = data.record.log
    panel = Panel("", (Curve("sum", "measured", log.time, log.position.sum(axis=1)),))
    return [Figure("toy", "Sum of <all> angles", "angle [rad]", (panel,)).about(sections.OTHER, "A toy.")]
"""
SAMPLER = """
from dataclasses import dataclass

import numpy as np

from hric_core.parameters import Settings, number
from hric_sweep.samplers.designs import Design


@dataclass(frozen=True)
class Middle(Settings):
    share: float = number(0.5, text="percentile of all runs")

    def sampler(self, space, runs, seed):
        return Design(np.full((runs, len(space.names)), self.share), drawn=False)
"""
PACKAGES = {
    "toy_ros_control": ("toy_ros_control/ToyPlant", "toy_plant:ToyPlant", plugins.PLANT, ENGINE),
    "toy_sensor": ("gauge", "toy_gauge:GaugeSection", plugins.SENSOR, SENSOR),
    "toy_section": ("knock", "toy_knock:KnockSection", plugins.SECTION, SECTION),
    "toy_export": ("heads", "toy_heads:Heads", plugins.EXPORT, EXPORT),
    "toy_posture": ("toy_posture/NECK", "toy_neck:Neck", plugins.POSTURE_METHOD, POSTURE),
    "toy_command": ("add", "toy_add:Sum", plugins.COMMAND, COMMAND),
}
"""Plugin name, folder, base class and module of each example plugin, by package."""
MODULES = {"hric_figures_toy": FIGURE, "toy_samplers": SAMPLER}
"""Example extensions that consist of one module in sys.path."""
EXPERIMENT = {
    "robot": {"hw": "franka_sim/FrankaHWSim"},
    "controllers": ["joint_state_controller", "joint_pd_controller"],
    "duration": 0.5,
    "gauge": {"rate": 200, "emulated": {"force": 4.5}},
    "knock": {"at": 0.3},
}


class Lab:
    """Commands in an environment with the example plugins.

    Attributes:
        folder: working directory of the commands.
        run: headless run with the engine, the sensor and the section of the example plugins.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.toys = folder, folder / "elsewhere"
        for package, (name, kind, base, text) in PACKAGES.items():
            (self.toys / package / "src").mkdir(parents=True)
            (self.toys / package / "package.xml").write_text(PACKAGE.format(name=package))
            (self.toys / package / "plugins.xml").write_text(PLUGINS.format(name=name, type=kind, base=base))
            (self.toys / package / "src" / f"{kind.partition(':')[0]}.py").write_text(text)
        for module, text in MODULES.items():
            (self.toys / module).mkdir()
            (self.toys / module / f"{module}.py").write_text(text)
        self.path = f"{os.environ['ROS_PACKAGE_PATH']}:{self.toys}"
        (folder / "toy.yaml").write_text(yaml.safe_dump(EXPERIMENT))
        overrides = ("gauge.rate:=400", "knock.at:=0.2", "simulator:=toy")
        code, printed = self("run", "toy.yaml", *overrides, "--runs", str(folder / "runs"), "--quiet", "--no-figures")
        assert code == 0, printed
        self.run = RunFolder((folder / "runs" / "latest").resolve())

    def __call__(self, *words: str) -> tuple[int, str]:
        """Run `hric WORDS`; return exit code and output."""
        environment = {**os.environ, "ROS_PACKAGE_PATH": self.path}
        command = [sys.executable, str(HRIC), *words]
        done = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True, timeout=120)
        return done.returncode, done.stdout + done.stderr

    @property
    def record(self) -> dict[str, Any]:
        """Return the contents of run.yaml."""
        return dict(yaml.safe_load((self.run.path / "run.yaml").read_text()))

    def exported(self, kind: str) -> list[Path]:
        """Return the files of an export of the run in a format."""
        code, printed = self("export", str(self.run.path), "--format", kind)
        assert code == 0, printed
        return sorted(self.run.path.rglob(f"*.{kind}"))


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Lab:
    return Lab(tmp_path_factory.mktemp("toys"))


@pytest.fixture
def here(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make the example plugins available in this process, too."""
    monkeypatch.setenv("ROS_PACKAGE_PATH", lab.path)
    for name in ("toy_posture/src", *MODULES):
        monkeypatch.syspath_prepend(str(lab.toys / name))
    plugins.clear_cache()
    yield
    plugins.clear_cache()


@pytest.mark.parametrize("name", [*PACKAGES, *MODULES])
def test_a_toy_is_few_files(lab: Lab, name: str) -> None:
    files = [path for path in (lab.toys / name).rglob("*") if path.is_file() and "__pycache__" not in path.parts]
    assert len(files) == (MOST_FILES if name in PACKAGES else 1)


def test_engine(lab: Lab) -> None:
    assert lab.record["definition"]["robot"]["plant_type"] == "toy_ros_control/ToyPlant"
    assert lab.record["versions"]["toy_ros_control"] == "0.7.0"


@pytest.mark.usefixtures("here")
def test_engine_in_the_bring_up() -> None:
    assert completed("simulator:=t") == ["simulator:=toy"]
    given = {"env": "sim", "simulator": "toy"}
    assert check(given, documented(), choices()) == given


def test_sensor(lab: Lab) -> None:
    assert lab.record["definition"]["gauge"]["rate"] == 400.0
    (table,) = (path for path in lab.exported("csv") if "gauge" in path.name)
    head, *rows = (line for line in table.read_text().splitlines() if not line.startswith("#"))
    column = next(k for k, label in enumerate(head.split(",")) if "grip" in label)
    assert {float(row.split(",")[column]) for row in rows} == {4.5} and 150 < len(rows) <= 201


def test_sensor_in_schema_and_parameters(lab: Lab) -> None:
    code, printed = lab("describe", "emulated_gauge", "toy.yaml")
    device = yaml.safe_load(printed)
    assert code == 0 and (device["force"], device["rate"], device["name"]) == (4.5, 200.0, "emulated_gauge")
    code, printed = lab("schema")
    properties = json.loads(printed)["properties"]
    assert code == 0 and "device" in properties["gauge"]["anyOf"][0]["properties"]
    assert "at" in properties["knock"]["anyOf"][0]["properties"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("gauge.colour:=red", "'colour' is not one of chunk, device, emulated, lsl, rate, transport"),
        ("knock.hard:=1", "'hard' is not one of at"),
    ],
)
def test_a_wrong_key_is_refused_with_the_keys(lab: Lab, override: str, message: str) -> None:
    code, printed = lab("run", "toy.yaml", override)
    assert code == 2 and message in printed


def test_experiment_section(lab: Lab) -> None:
    assert lab.record["definition"]["knock"] == {"at": 0.2}
    (table,) = (path for path in lab.exported("csv") if "knock" in path.name)
    *_, row = table.read_text().splitlines()
    assert float(row.split(",")[-1]) == pytest.approx(0.2, abs=0.002)


def test_export(lab: Lab) -> None:
    heads = {path.stem: path.read_text().split() for path in lab.exported("heads")}
    assert heads["knock"] == ["/knock", "1"] and len(heads) > 2


def test_command(lab: Lab) -> None:
    assert lab("add", "1", "2.5") == (0, "3.5\n")
    assert re.search(r"^  add\s+a toy$", lab("--help")[1], re.MULTILINE)


@pytest.mark.usefixtures("here")
def test_ergonomic_method(tmp_path: Path) -> None:
    known_bags.posture(tmp_path)
    verdict = assess(opened(str(tmp_path / "posture.bag")))
    assert list(methods()) == ["rula", "reba", "neck"]
    subjects = [item.subject.partition(" of ")[0] for item in verdict.findings if item.group == "posture"]
    assert sorted(set(subjects)) == ["NECK", "REBA", "RULA"]
    content, schema = verdict.to_dict(), verdict_schema()
    assert "neck" in schema["properties"]["timelines"]["required"]
    jsonschema.Draft202012Validator(schema).validate(content)
    text = verdict_page.part(content)
    assert "NECK: level of the score over time" in text and "up to 2" in text


@pytest.mark.usefixtures("here")
def test_sampler(tmp_path: Path) -> None:
    sampler = {"kind": "toy_samplers:Middle", "share": 0.25}
    plan = definition.load(str(sweeps.written(tmp_path, sampler=sampler, runs=2, keep={"worst": 0})))
    assert [row.values["kp"] for row in carried_out(tmp_path, plan, Here())] == [50.0, 50.0]


@pytest.mark.usefixtures("here")
def test_figure(lab: Lab, tmp_path: Path) -> None:
    built = run_page.build(run_data.load(lab.run, json.loads(lab.run.metrics_path.read_text())))
    text = page.render_page(replace(built, robots=[], figures=built.figures[-1:]))
    assert 'id="plot-toy"><h3>Sum of &lt;all&gt; angles</h3>' in text and "A toy." in text
    assert [file.name for file in drawing.draw(tmp_path, built.figures[-1:], "a run")] == ["toy.png"]
