"""Results file of a benchmark (definition, hashes, scores, ranks), and comparison of two results files."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hric_assessment.findings import DISCLAIMER
from hric_bags import files
from hric_core.errors import HricError
from hric_sweep.benchmark.definition import (
    ERGONOMICS,
    TASK,
    Benchmark,
    BenchmarkController,
    BenchmarkRun,
    Collaboration,
    digest,
    limits_digest,
    plain,
)
from hric_sweep.benchmark.scoring import ROBUSTNESS, RULE, Cells, Ranks, category_ranks, standings
from hric_sweep.records import PlainData, RunResponse

VERSION = 1
NAME = "results.json"
INFINITE = "infinite"
"""Replacement for an infinite value in a results file."""


def make(
    benchmark: Benchmark, content: PlainData, controllers: Sequence[BenchmarkController], cells: Cells, code: str
) -> PlainData:
    """Return the content of a benchmark's results file.

    Args:
        benchmark: part of the benchmark that was run.
        content: plain data from `definition.load`.
        controllers: controllers that were compared.
        cells: results by collaboration and controller, from `scoring.cells`.
        code: version of the code.
    """
    names = [controller.name for controller in controllers]
    ranks = {key: category_ranks(benchmark, cells, names, key) for key in (ERGONOMICS, TASK, ROBUSTNESS)}
    return {
        "version": VERSION,
        "disclaimer": DISCLAIMER,
        "rule": RULE,
        "hashes": {"definition": digest([content, part(benchmark)]), "tables": limits_digest(), "code": code},
        "description": benchmark.description,
        "tolerance": benchmark.tolerance,
        "part": part(benchmark),
        "population": {"name": benchmark.population.name, "source": benchmark.population.source},
        "controllers": {controller.name: _controller(controller) for controller in controllers},
        "standings": [vars(standing) for standing in standings(benchmark, cells, names)],
        "collaborations": {
            name: _collaboration(item, names, cells, ranks) for name, item in benchmark.collaborations.items()
        },
    }


def part(benchmark: Benchmark) -> PlainData:
    """Return the collaborations, bodies and seeds of a benchmark, as plain data."""
    bodies = benchmark.population.bodies
    return plain({"collaborations": list(benchmark.collaborations), "bodies": bodies, "seeds": benchmark.seeds})


def _collaboration(item: Collaboration, names: Sequence[str], cells: Cells, ranks: Mapping[str, Ranks]) -> PlainData:
    about = ("unit", "text", "limit", "better")
    return {
        "scores": {key: {name: getattr(score, name) for name in about} for key, score in item.all.items()},
        "controllers": {
            who: {
                **asdict(cells[item.name, who]),
                "ranks": {category: by_cell[item.name, who] for category, by_cell in ranks.items()},
            }
            for who in names
        },
    }


def _controller(controller: BenchmarkController) -> PlainData:
    changes = plain(controller.changes)
    prediction = None if controller.prediction is None else vars(controller.prediction)
    about = {"description": controller.description, "changes": changes}
    return {**about, "hash": digest(changes), "prediction": prediction}


def predicted(results: PlainData) -> list[tuple[str, int, int]]:
    """Return (controller, predicted rank, actual rank) for each controller with a prediction, ranked among these."""
    controllers = results["controllers"]
    ranks = {item["name"]: item["rank"] for item in results["standings"] if controllers[item["name"]]["prediction"]}
    return [
        (name, controllers[name]["prediction"]["rank"], 1 + sum(other < rank for other in ranks.values()))
        for name, rank in ranks.items()
    ]


def run_rows(responses: Mapping[BenchmarkRun, RunResponse]) -> list[PlainData]:
    """Return one row per run as plain data: controller, collaboration, body, seed, outputs, failure, state hash."""
    about = ("outputs", "failure", "state_sha256")
    return [{**vars(run), **{key: getattr(response, key) for key in about}} for run, response in responses.items()]


def write(folder: Path, results: PlainData) -> None:
    """Write the results file."""
    files.write_json(folder / NAME, finite(results))


def read(path: Path) -> PlainData:
    """Read the results file of a benchmark.

    Raises:
        HricError: the file cannot be read, or is no results file of this version.
    """
    try:
        results = json.loads(path.read_text())
    except OSError as error:
        raise HricError(f"cannot read {path}: {error.strerror}") from error
    except ValueError as error:
        raise HricError(f"{path} is not JSON: {error}") from error
    if not isinstance(results, dict) or results.get("version") != VERSION or "standings" not in results:
        raise HricError(f"{path} is no results file of this version; valid: {NAME} in the folder of a benchmark")
    return dict(_restored(results))


def finite(value: Any) -> Any:
    """Return results with infinite values replaced by INFINITE, as JSON cannot represent them."""
    if isinstance(value, float) and math.isinf(value):
        return INFINITE
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    return [finite(item) for item in value] if isinstance(value, list | tuple) else value


def _restored(value: Any) -> Any:
    """Undo `finite`: return results with INFINITE replaced by infinity."""
    if isinstance(value, dict):
        return {key: _restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_restored(item) for item in value]
    return math.inf if value == INFINITE else value


def compare(ours: PlainData, theirs: PlainData) -> list[str]:
    """Return one line per difference between two results that exceeds the tolerance of the definition.

    Raises:
        HricError: the results have different definitions, tables of limits or controllers.
    """
    for key in ("definition", "tables"):
        if ours["hashes"][key] != theirs["hashes"][key]:
            raise HricError(
                f"the results were made with different {'definitions' if key == 'definition' else 'tables of limits'} "
                f"({ours['hashes'][key][:12]} and {theirs['hashes'][key][:12]}); valid: results made with the same ones"
            )
    names = [name for name in ours["controllers"] if name in theirs["controllers"]]
    if not names:
        raise HricError(f"no controller is in both results; here: {', '.join(ours['controllers'])}")
    for name in names:
        if ours["controllers"][name]["hash"] != theirs["controllers"][name]["hash"]:
            raise HricError(f"controller {name} has different overrides in the two results; valid: the same ones")
    return [line for name in names for line in _differences(name, ours, theirs)]


def _differences(name: str, ours: PlainData, theirs: PlainData) -> list[str]:
    lines = []
    for collaboration, item in ours["collaborations"].items():
        a, b = item["controllers"][name], theirs["collaborations"][collaboration]["controllers"][name]
        lines += [
            f"{name}, {collaboration}: runs {key}: {a[key]} here, {b[key]} there"
            for key in ("above", "unknown", "incomplete")
            if a[key] != b[key]
        ]
        for score, values in a["scores"].items():
            x, y, unit = values["median"], b["scores"][score]["median"], item["scores"][score]["unit"]
            if not _same(x, y, ours["tolerance"]):
                lines.append(f"{name}, {collaboration}, {score}: {_text(x)} here, {_text(y)} there {unit}".rstrip())
    return lines


def _same(a: float | None, b: float | None, tolerance: float) -> bool:
    if a is None or b is None or math.isinf(a) or math.isinf(b):
        return a == b
    return abs(a - b) <= tolerance * max(abs(a), abs(b))


def _text(value: float | None) -> str:
    return "none" if value is None else f"{value:.4g}"
