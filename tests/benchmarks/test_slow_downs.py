"""Sensitivity of the benchmark: it detects a slow-down, and reports no change for equal code."""

import shutil
from pathlib import Path

import pytest
from benchmark_command import ROOT, benchmark
from turns import measure

pytestmark = [pytest.mark.alone, pytest.mark.slow]
CASE = "cycle/mujoco/generic/semi_implicit"
LOOP = "            going_on = cycle(now, period, reset)\n"


def slower(folder: Path, seconds: float) -> Path:
    """Make a copy of the control framework whose loop waits for this time in each cycle; return it for PYTHONPATH."""
    package = folder / "hric_control"
    shutil.copytree(ROOT / "src" / "hric_control", package, ignore=shutil.ignore_patterns("test", "__pycache__"))
    file = package / "src" / "hric_control" / "sim" / "sim_loop.py"
    text = file.read_text()
    assert text.count(LOOP) == 1
    spin = f"            until = clock() + {seconds!r}\n            while clock() < until:\n                pass\n"
    file.write_text(text.replace(LOOP, LOOP + spin))
    return package / "src"


def test_a_cycle_that_takes_a_quarter_longer_is_called_slower_by_name(tmp_path: Path) -> None:
    times = measure([CASE], rounds=10)[CASE]
    done = benchmark(CASE, "natnet/frame", "--compare", str(ROOT), path=slower(tmp_path, 0.25 * sorted(times)[5]))
    told = dict(zip((CASE, "natnet/frame"), done.stdout.splitlines()[-2:], strict=True))
    assert done.returncode == 1 and "SLOWER" in told[CASE] and "equal" in told["natnet/frame"], (
        done.stdout + done.stderr
    )


def test_ten_comparisons_of_the_same_code_are_equal() -> None:
    found = [benchmark(CASE, "--compare", str(ROOT)) for _ in range(10)]
    assert all(done.returncode == 0 and "equal" in done.stdout for done in found), [done.stdout for done in found]
