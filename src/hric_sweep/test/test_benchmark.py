"""Benchmark: order of controllers, results file, and a short benchmark with a deliberately bad controller."""

import hashlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from in_process import Here

from hric_core.errors import HricError
from hric_sweep import task as runs_of_sweeps
from hric_sweep.benchmark import definition, page, results, scoring, text
from hric_sweep.benchmark.definition import BenchmarkRun
from hric_sweep.execution import execute
from hric_sweep.journal import Journal
from hric_sweep.records import RunResponse, RunTask

BAD = """\
description: as stiff as it goes, without damping and without a profile
changes:
  contact: ["kp:=3000", "kd:=5", "profile:=false"]
"""
PART = (["contact", "shared_workspace"], ["p50"], 1)


@pytest.fixture(scope="module")
def quick(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]]]:
    """Run two collaborations with one body and one seed, reference controllers and a bad one; interrupted once."""
    folder = tmp_path_factory.mktemp("benchmark")
    (folder / "bad.yaml").write_text(BAD)
    whole, content = definition.load()
    benchmark = whole.only(*PART)
    controllers = [
        definition.controller(name, benchmark) for name in (*definition.references(), str(folder / "bad.yaml"))
    ]
    todo = definition.runs(benchmark, content["experiments"], controllers, "code")
    tasks = list(todo.values())
    with Journal(folder) as journal, pytest.raises(KeyboardInterrupt):
        execute(tasks, Here(after=3), journal)
    engine = Here()
    with Journal(folder) as journal:
        responses = execute(tasks, engine, journal)
    assert engine.begun == len(todo) - 3  # what had ended was not run again
    by_run = dict(zip(todo, responses, strict=True))
    found = results.make(benchmark, content, controllers, scoring.cells(benchmark, by_run), "code")
    yield json.loads(json.dumps({**found, "runs": results.run_rows(by_run)})), folder, todo


def test_the_references_rank_as_their_design_says_and_a_bad_controller_comes_last(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    found = quick[0]
    assert [one["name"] for one in found["standings"]] == ["supervised", "compliant", "stiff", "bad"]
    assert all(said == rank for _, said, rank in results.predicted(found)) and len(results.predicted(found)) == 3
    out = {one["name"]: one["out_of_limits"] for one in found["standings"]}
    assert out == {"supervised": 0, "compliant": 1, "stiff": 1, "bad": 2}
    assert found["collaborations"]["contact"]["controllers"]["bad"]["scores"]["findings.contact share"]["median"] > 1.0


def test_a_run_has_the_same_numbers_and_bits_for_the_same_seed(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    found, _, todo = quick
    again = runs_of_sweeps.run(next(iter(todo.values())))
    before = found["runs"][0]
    assert again.failure == "" and again.outputs == before["outputs"]
    assert again.state_sha256 == before["state_sha256"]


def test_table_and_page_show_every_controller_collaboration_and_score(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    found = quick[0]
    table, shown = text.render(found), page.build(found)
    for word in (*found["controllers"], found["disclaimer"], "too near", "strength share", "motions"):
        assert word in table and word in shown
    assert "<script" not in shown and "http" not in shown.replace("http-equiv", "")


def test_page_answers_before_its_first_table(quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]]) -> None:
    found = quick[0]
    first = [standing["name"] for standing in found["standings"] if standing["rank"] == 1]
    head = page.build(found).partition("<table>")[0]
    assert f"First of {len(found['standings'])} controllers: {' and '.join(first)}" in head
    assert "@media (prefers-color-scheme: dark)" in head


def test_an_infinite_share_is_drawn_at_the_far_end_of_its_chart(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    found = json.loads(json.dumps(quick[0]))
    key, controllers = "findings.contact share", found["collaborations"]["contact"]["controllers"]
    score = controllers["bad"]["scores"][key]
    score.update(highest=math.inf, median=math.inf, by_body={"p50": math.inf})
    chart = page.build(found).split(f"<h3>{key.replace('.', ': ', 1)}")[1].partition("</svg>")[0]
    assert 'cx="770.0"' in chart and "<title>bad, p50: infinite</title>" in chart and "nan" not in chart


def test_results_are_compared_by_the_tolerance_of_their_definition(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    ours = quick[0]
    assert results.compare(ours, ours) == []
    theirs = json.loads(json.dumps(ours))
    score = theirs["collaborations"]["contact"]["controllers"]["stiff"]["scores"]["task.error"]
    score["median"] *= 1.0 + 0.9 * ours["tolerance"]
    assert results.compare(ours, theirs) == []
    score["median"] *= 2.0
    theirs["collaborations"]["contact"]["controllers"]["bad"]["above"] = 0
    differences = results.compare(ours, theirs)
    assert len(differences) == 2
    assert any("stiff, contact, task.error" in one for one in differences)
    assert any("bad, contact: runs above: 1 here, 0 there" in one for one in differences)


def test_an_infinite_share_is_the_same_as_another_one_alone(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    ours, theirs = (json.loads(json.dumps(quick[0])) for _ in range(2))
    for one in (ours, theirs):
        one["collaborations"]["contact"]["controllers"]["stiff"]["scores"]["findings.contact share"]["median"] = (
            math.inf
        )
    assert results.compare(ours, theirs) == []
    assert len(results.compare(ours, quick[0])) == 1


@pytest.mark.parametrize("key", ["definition", "tables"])
def test_results_of_other_definitions_or_tables_are_not_compared(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]], key: str
) -> None:
    theirs = json.loads(json.dumps(quick[0]))
    theirs["hashes"][key] = "0" * 64
    with pytest.raises(HricError, match="valid: results made with the same"):
        results.compare(quick[0], theirs)


def test_a_controller_of_other_overrides_is_not_compared(
    quick: tuple[dict[str, Any], Path, dict[BenchmarkRun, RunTask]],
) -> None:
    theirs = json.loads(json.dumps(quick[0]))
    theirs["controllers"]["stiff"]["hash"] = "0" * 64
    with pytest.raises(HricError, match="controller stiff has different overrides"):
        results.compare(quick[0], theirs)


def test_a_file_that_is_no_result_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("[]")
    with pytest.raises(HricError, match="no results file of this version"):
        results.read(tmp_path / "a.json")


# -- the order ---------------------------------------------------------------------------------------------------------


def test_values_within_the_tolerance_share_a_place_and_who_has_none_comes_last() -> None:
    values = {"a": 1.0, "b": 1.01, "c": 2.0, "d": None}
    assert scoring.ranks(values, 1.0, 0.02) == {"a": 1, "b": 1, "c": 3, "d": 4}
    assert scoring.ranks(values, -1.0, 0.02) == {"a": 2, "b": 2, "c": 1, "d": 4}


def ordered(**responses: tuple[float | None, float, float | None]) -> list[scoring.Standing]:
    """Return the controllers in order; each has ratio to the limit, effort and error of its run, or None: it failed."""
    score = {"path": "human.strength_share_max"}
    content = {
        "population": {"name": "one", "bodies": {"p50": "P50_male"}},
        "seeds": [0],
        "collaborations": {
            "contact": {
                "extends": "contact",
                "findings": {"share": {**score, "limit": 1.0}},
                "ergonomics": {"effort": score},
                "task": {"error": score},
            }
        },
    }
    benchmark = definition.Benchmark.of(content, "")
    keys = ("findings.share", "ergonomics.effort", "task.error")
    given = {
        BenchmarkRun(name, "contact", "p50", 0): RunResponse(
            name, 0, dict(zip(keys, values, strict=True)), "" if values[0] is not None else "it diverged"
        )
        for name, values in responses.items()
    }
    return scoring.standings(benchmark, scoring.cells(benchmark, given), list(responses))


def test_findings_come_before_ergonomics_and_ergonomics_before_the_task() -> None:
    found = ordered(above=(1.2, 0.1, 0.1), heavy=(0.5, 0.9, 0.1), slow=(0.9, 0.2, 0.9), best=(0.9, 0.2, 0.1))
    assert [(one.name, one.rank) for one in found] == [("best", 1), ("slow", 2), ("heavy", 3), ("above", 4)]


def test_a_run_that_failed_counts_as_one_out_of_limits_and_not_completed() -> None:
    found = ordered(failed=(None, 0.1, None), fine=(0.5, 0.9, 0.9))
    assert [one.name for one in found] == ["fine", "failed"]
    assert (found[1].out_of_limits, found[1].incomplete) == (1, 1)


@pytest.mark.parametrize(("better", "beyond"), [("smaller", [False, False, True]), ("larger", [True, False, False])])
def test_a_limit_is_the_largest_value_or_where_larger_is_better_the_smallest(better: str, beyond: list[bool]) -> None:
    score = definition.Score.of({"path": "setpoints.*.time", "limit": 2.0, "better": better}, "motions")
    assert [score.beyond(value) for value in (1.0, 2.0, 3.0)] == beyond


def test_controllers_that_nothing_tells_apart_share_a_rank() -> None:
    assert [one.rank for one in ordered(a=(0.5, 0.2, 0.1), b=(0.5, 0.2, 0.1), c=(0.5, 0.3, 0.1))] == [1, 1, 3]


# -- files -------------------------------------------------------------------------------------------------------------


def test_the_definition_has_five_collaborations_three_bodies_and_five_seeds() -> None:
    benchmark, _ = definition.load()
    assert list(benchmark.collaborations) == [
        "hand_guidance",
        "co_transport",
        "handover",
        "contact",
        "shared_workspace",
    ]
    assert list(benchmark.population.bodies) == ["p05", "p50", "p95"] and len(benchmark.seeds) == 5
    assert definition.references() == ["compliant", "stiff", "supervised"]


def test_all_mistakes_of_a_controllers_file_are_one_error(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text('changes: {hand_guidanc: ["kp:=1"], contact: ["kq:=1"], handover: ["duration:=-1"]}')
    with pytest.raises(HricError) as caught:
        definition.controller(str(path), definition.load()[0])
    message = str(caught.value)
    assert "3 mistakes" in message and "hand_guidance" in message and "no override 'kq'" in message
    assert "example of a controller's file" in message


def test_a_controller_that_there_is_not_is_named_with_those_that_are() -> None:
    with pytest.raises(HricError, match="compliant, stiff, supervised"):
        definition.controller("brave", definition.load()[0])


def test_a_part_that_there_is_not_is_refused() -> None:
    with pytest.raises(HricError, match="no collaboration 'dance'"):
        definition.load()[0].only(["dance"], [], None)


def test_the_hash_of_the_tables_is_of_files_that_are_there() -> None:
    assert definition.limits_digest() != hashlib.sha256().hexdigest()
