"""Results file of a benchmark: definition, hashes and results; and the comparison of two such files."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hric_assessment.findings import DISCLAIMER
from hric_core.errors import HricError
from hric_sweep.benchmark.definition import (
    ERGONOMICS,
    TASK,
    Benchmark,
    Collaboration,
    Controller,
    digest,
    limits_digest,
    plain,
)
from hric_sweep.benchmark.running import Run
from hric_sweep.benchmark.scoring import RULE, Cell, category_ranks, spread_ranks, standings

VERSION = 1
NAME = "results.json"
INFINITE = "infinite"
"""Replacement for an infinite value in a results file."""


def make(
    benchmark: Benchmark,
    content: Mapping[str, Any],
    controllers: Sequence[Controller],
    found: Mapping[tuple[str, str], Cell],
    code: str,
) -> dict[str, Any]:
    """Return the content of the results file.

    Args:
        benchmark: part of the benchmark that was run.
        content: plain data from `definition.load`.
        controllers: controllers that were compared.
        found: results from `scoring.cells`.
        code: version of the code.
    """
    names = [one.name for one in controllers]
    by = {category: category_ranks(benchmark, found, names, category) for category in (ERGONOMICS, TASK)}
    spread = spread_ranks(benchmark, found, names)
    return {
        "version": VERSION,
        "disclaimer": DISCLAIMER,
        "rule": RULE,
        "hashes": {"definition": digest([content, part(benchmark)]), "tables": limits_digest(), "code": code},
        "description": benchmark.description,
        "tolerance": benchmark.tolerance,
        "part": part(benchmark),
        "population": {"name": benchmark.population.name, "source": benchmark.population.source},
        "controllers": {one.name: _controller(one) for one in controllers},
        "standings": [vars(one) for one in standings(benchmark, found, names)],
        "collaborations": {
            one.name: _collaboration(one, names, found, {**by, "robustness": spread})
            for one in benchmark.collaborations.values()
        },
    }


def part(benchmark: Benchmark) -> dict[str, Any]:
    """Return the collaborations, bodies and seeds that were run."""
    return plain(
        {
            "collaborations": list(benchmark.collaborations),
            "bodies": benchmark.population.bodies,
            "seeds": benchmark.seeds,
        }
    )


def _collaboration(
    one: Collaboration,
    names: Sequence[str],
    found: Mapping[tuple[str, str], Cell],
    ranks: Mapping[str, Mapping[tuple[str, str], float]],
) -> dict[str, Any]:
    return {
        "scores": {".".join(key): _about(score) for key, score in one.all.items()},
        "controllers": {
            who: {
                **_cell(found[one.name, who]),
                "ranks": {category: own[one.name, who] for category, own in ranks.items()},
            }
            for who in names
        },
    }


def _controller(one: Controller) -> dict[str, Any]:
    about = {"description": one.description, "changes": plain(one.changes)}
    prediction = None if one.prediction is None else vars(one.prediction)
    return {**about, "hash": digest(about["changes"]), "prediction": prediction}


def _about(score: Any) -> dict[str, Any]:
    return {key: getattr(score, key) for key in ("unit", "text", "limit", "better")}


def _cell(one: Cell) -> dict[str, Any]:
    keys = list(one.values)
    return {
        "runs": one.runs,
        "above": one.above,
        "unknown": one.unknown,
        "incomplete": one.incomplete,
        "failures": dict(one.failures),
        "scores": {
            ".".join(key): {
                "median": one.values[key],
                "lowest": one.lowest[key],
                "highest": one.highest[key],
                "by_body": {body: values[key] for body, values in one.by_body.items()},
            }
            for key in keys
        },
    }


def predicted(results: Mapping[str, Any]) -> list[tuple[str, int, int]]:
    """Return (controller, predicted rank, actual rank among these) for controllers with a prediction."""
    order = [one["name"] for one in results["standings"]]
    said = {
        name: one["prediction"]["rank"] for name, one in results["controllers"].items() if one["prediction"] is not None
    }
    own = [name for name in order if name in said]
    ranks = {one["name"]: one["rank"] for one in results["standings"]}
    return [(name, said[name], 1 + sum(ranks[other] < ranks[name] for other in own)) for name in own]


def run_rows(runs: Sequence[Run], responses: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return one row per run, with all its outputs."""
    return [
        {
            **{key: getattr(run, key) for key in ("controller", "collaboration", "body", "seed")},
            **{key: response[key] for key in ("outputs", "failure", "state_sha256")},
        }
        for run, response in zip(runs, responses, strict=True)
    ]


def read(path: Path) -> dict[str, Any]:
    """Read a results file.

    Raises:
        HricError: the file is no results file of this version.
    """
    try:
        found = json.loads(path.read_text())
    except OSError as error:
        raise HricError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise HricError(f"{path} is not JSON: {error}") from error
    if not isinstance(found, dict) or found.get("version") != VERSION or "standings" not in found:
        raise HricError(f"{path} is no results file of this version; valid: {NAME} in the folder of a benchmark")
    return dict(_restored(found))


def finite(value: Any) -> Any:
    """Return results with infinite values replaced, as JSON cannot represent them."""
    if isinstance(value, float) and math.isinf(value):
        return INFINITE
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    return [finite(item) for item in value] if isinstance(value, list | tuple) else value


def _restored(value: Any) -> Any:
    """Return results with the infinite values that `finite` replaced."""
    if isinstance(value, dict):
        return {key: _restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_restored(item) for item in value]
    return math.inf if value == INFINITE else value


def compare(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    """Return the differences between two results that exceed the tolerance of the definition; empty: none.

    Raises:
        HricError: they have different definitions, tables or controllers, so that they cannot be compared.
    """
    for key in ("definition", "tables"):
        if ours["hashes"][key] != theirs["hashes"][key]:
            raise HricError(
                f"the results are of different {'definitions' if key == 'definition' else 'tables of limits'} "
                f"({ours['hashes'][key][:12]} and {theirs['hashes'][key][:12]}); valid: results of the same one"
            )
    names = [name for name in ours["controllers"] if name in theirs["controllers"]]
    if not names:
        raise HricError(f"no controller is in both results; here: {', '.join(ours['controllers'])}")
    for name in names:
        if ours["controllers"][name]["hash"] != theirs["controllers"][name]["hash"]:
            raise HricError(f"controller {name} has other overrides in both results; valid: the same file")
    return [line for name in names for line in _differences(name, ours, theirs)]


def _differences(name: str, ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    found = []
    for where, one in ours["collaborations"].items():
        a, b = one["controllers"][name], theirs["collaborations"][where]["controllers"][name]
        for key in ("above", "unknown", "incomplete"):
            if a[key] != b[key]:
                found.append(f"{name}, {where}: runs {key}: {a[key]} here, {b[key]} there")
        for score, own in a["scores"].items():
            x, y = own["median"], b["scores"][score]["median"]
            if not _same(x, y, ours["tolerance"]):
                unit = one["scores"][score]["unit"]
                found.append(f"{name}, {where}, {score}: {_text(x)} here, {_text(y)} there {unit}".rstrip())
    return found


def _same(a: float | None, b: float | None, tolerance: float) -> bool:
    if a is None or b is None or math.isinf(a) or math.isinf(b):
        return a == b
    return abs(a - b) <= tolerance * max(abs(a), abs(b))


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:.4g}"
