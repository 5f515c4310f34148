"""A method that scores postures is one folder outside of the tree; verdict, schema, report and command then have it."""

import os
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import known_bags
import pytest

from hric_assessment.ergonomics.scoring import methods
from hric_assessment.verdict import Verdict, assess, opened
from hric_assessment.verdict.result import verdict_schema
from hric_core import plugins
from hric_report.html import verdict as page

PACKAGE = """<package format="3"><name>neck_score</name>
<export><hric_control plugin="${prefix}/plugins.xml"/></export></package>"""
PLUGINS = """<library path="."><class name="neck_score/NECK" type="neck_score:Neck"
base_class_type="hric_assessment::PostureMethod"><description>Bend of the neck.</description></class></library>"""
MODULE = """
from functools import cache
from pathlib import Path

from hric_assessment.ergonomics.scoring import PostureMethod
from hric_assessment.tables import PostureTable
from hric_core.parameters import read_yaml


@cache
def table():
    return PostureTable.of(read_yaml(Path(__file__).with_name("neck.yaml")), "neck.yaml:")


class Neck(PostureMethod):
    table = staticmethod(table)
    task_fields = ("held",)

    def total(self, scorer, task, version):
        return scorer.part("neck")
"""
TABLE = """
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
"""


@pytest.fixture
def verdict(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Verdict]:
    folder = tmp_path / "outside" / "neck_score"
    folder.mkdir(parents=True)
    files = {"package.xml": PACKAGE, "plugins.xml": PLUGINS, "neck_score.py": MODULE, "neck.yaml": TABLE}
    for name, content in files.items():
        (folder / name).write_text(content)
    path = os.environ.get("ROS_PACKAGE_PATH") or str(Path(__file__).parents[2])
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{path}:{folder.parent}")
    monkeypatch.syspath_prepend(str(folder))
    plugins.clear_cache()
    known_bags.posture(tmp_path)
    yield assess(opened(str(tmp_path / "posture.bag")))
    plugins.clear_cache()


def test_a_method_from_outside_the_tree_is_in_verdict_schema_and_report(verdict: Verdict) -> None:
    assert list(methods()) == ["rula", "reba", "neck"]
    subjects = [item.subject.partition(" of ")[0] for item in verdict.findings if item.group == "posture"]
    assert sorted(set(subjects)) == ["NECK", "REBA", "RULA"]
    content = verdict.to_dict()
    assert [curve["side"] for curve in content["timelines"]["neck"]] == ["right", "left"]
    schema = verdict_schema()
    assert "neck" in schema["properties"]["timelines"]["required"]
    jsonschema.Draft202012Validator(schema).validate(content)
    assert "NECK, by the levels of its score" in page.part(content) and "up to 2" in page.part(content)
