"""Table of the benchmark: significance of changes, and errors of its command line."""

import json
from pathlib import Path

import pytest
import table
from benchmark_command import benchmark


@pytest.mark.parametrize(
    ("change", "error", "told"),
    [
        (1.25, 0.03, "SLOWER"),
        (1.07, 0.0, "equal"),
        (1.25, 0.1, "equal"),
        (0.8, 0.01, "faster"),
        (0.97, 0.01, "equal"),
    ],
)
def test_a_change_counts_when_it_is_large_and_beyond_what_processes_differ_by(
    change: float, error: float, told: str
) -> None:
    assert table.verdict(change, error, 8) == told


def test_a_stored_table_is_compared_by_ratios_and_a_slower_case_has_its_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.json"
    row = {"seconds": 1e-5, "ratio": 2.0, "spread": 0.01, "processes": 5}
    path.write_text(json.dumps({"processor": table.processor(), "cases": {"a": row, "b": row}}))
    now = {"a": table.Row(5e-5, 2.02, 0.01, 5), "b": table.Row(1e-5, 2.5, 0.01, 5), "c": table.Row(1e-5, 1.0, 0.0, 5)}
    assert not table.compare_stored(now, table.stored(path))
    assert [line.split()[-1] for line in capsys.readouterr().out.splitlines()[-3:]] == ["equal", "SLOWER", "new"]


def test_a_table_of_another_processor_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.json"
    path.write_text(json.dumps({"processor": "1 x abacus", "cases": {}}))
    done = benchmark("--compare", str(path))
    assert done.returncode == 2 and "made on 1 x abacus" in done.stderr and "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["cycle/gazebo"], "no case 'cycle/gazebo'; valid: bare/pybullet"),
        (["--compare", "/nowhere"], "/nowhere is no table"),
        (["--processes", "0"], "--processes is 0; valid: 1 or more"),
        (["--save", "/nowhere/table.json"], "there is no folder /nowhere"),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(words: list[str], told: str) -> None:
    done = benchmark(*words)
    assert done.returncode == 2 and told in done.stderr and len(done.stderr.strip().splitlines()) == 1
