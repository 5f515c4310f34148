"""Schema of metrics.json and its dataclasses."""

import json
from dataclasses import dataclass
from pathlib import Path

import jsonschema
import pytest
from synthetic import write_run

from hric_analysis.values import RunMetrics
from hric_core.json_values import JsonValueError, from_json, schema, to_json
from hric_report.run import analyse

SCHEMA = Path(__file__).parents[1] / "config" / "metrics.schema.json"


def test_the_committed_schema_is_that_of_the_dataclasses() -> None:
    made = json.dumps(schema(RunMetrics), indent=2) + "\n"
    assert SCHEMA.read_text() == made, "old; write json.dumps(schema(RunMetrics), indent=2) to it"


def test_the_metrics_of_a_run_fit_the_schema_and_come_back_equal(tmp_path: Path) -> None:
    folder = write_run(tmp_path)
    analyse(folder, figures=False)
    content = json.loads(folder.metrics_path.read_text())
    jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text())).validate(content)
    assert to_json(from_json(RunMetrics, content)) == content


@dataclass(frozen=True)
class Inner:
    values: tuple[float, ...]


@dataclass(frozen=True)
class Outer:
    parts: dict[str, Inner]
    known: int | None
    extra: str | None = None


def test_null_is_written_only_for_a_field_without_a_default() -> None:
    assert to_json(Outer({"a": Inner((1.0,))}, None)) == {"parts": {"a": {"values": [1.0]}}, "known": None}


def test_a_value_of_another_type_is_refused_by_its_place() -> None:
    with pytest.raises(JsonValueError, match=r'metrics.json.parts.a.values\[1\] is "2"; valid: float'):
        from_json(Outer, {"parts": {"a": {"values": [1.0, "2"]}}}, "metrics.json")
