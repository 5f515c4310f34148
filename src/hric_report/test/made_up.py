"""Metrics of a run in which only the values under test are set; all others are 0, empty or null."""

from typing import Any

from hric_analysis.values import RunMetrics
from hric_core.json_values import from_json, schema

PLAIN = {"integer": 0, "number": 0.0, "string": "", "boolean": False}


def completed(shape: dict[str, Any], value: Any) -> Any:
    """Return JSON values that fit a schema."""
    if "anyOf" in shape:
        return None if value is None else completed(shape["anyOf"][0], value)
    if "properties" in shape:
        return {name: completed(part, (value or {}).get(name)) for name, part in shape["properties"].items()}
    if shape["type"] == "object":
        return {name: completed(shape["additionalProperties"], part) for name, part in (value or {}).items()}
    if shape["type"] == "array":
        return [completed(shape["items"], part) for part in value or ()]
    return PLAIN[shape["type"]] if value is None else value


def run_metrics(**values: Any) -> RunMetrics:
    """Return metrics of a stable run."""
    return from_json(RunMetrics, completed(schema(RunMetrics), {"stability": {"verdict": "stable"}, **values}))
