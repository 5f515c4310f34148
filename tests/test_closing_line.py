"""The closing line of scripts/test counts each test once and agrees with pytest; a file that needs to be alone must say
so."""

import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from textwrap import dedent

import pytest
from closing_line import line, main, read

ROOT = Path(__file__).resolve().parents[1]
BESIDE = """
import pytest

@pytest.mark.parametrize("i", range(5))
def test_passes(i): pass

def test_fails(): assert False

def test_skips(): pytest.skip("no camera")

@pytest.mark.skipif(True, reason="no camera")
def test_skips_too(): pass

@pytest.mark.slow
def test_soaks(): pass

@pytest.fixture
def bad_end():
    yield
    raise RuntimeError

def test_passes_and_ends_badly(bad_end): pass

def test_fails_and_ends_badly(bad_end): assert False

@pytest.fixture
def bad_start(): raise RuntimeError

def test_never_begins(bad_start): pass
"""
ALONE = dedent("""
    import pytest

    pytestmark = [pytest.mark.alone, pytest.mark.filterwarnings("error")]

    def test_measures(figure): figure("cost of a cycle", 3.25, "us")

    @pytest.mark.rostest
    def test_with_a_master(): pass

    @pytest.mark.live
    @pytest.mark.parametrize("i", range(2))
    def test_keeps_the_pace(i): pass

    @pytest.mark.live
    @pytest.mark.slow
    def test_keeps_it_for_long(): pass
""")
"""Text of a test file marked `alone`; indented, since this file would otherwise count as marked itself."""
SELECTION = "not slow and not live"


def project(folder: Path, **files: str) -> Path:
    """Create a workspace with these test files and the pytest configuration of this workspace."""
    for name in ("conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)
    for name, text in files.items():
        (folder / f"test_{name}.py").write_text(text)
    return folder


def run(folder: Path, name: str, marks: str, *words: str) -> Counter[str]:
    """Run pytest, which writes results/NAME.xml, and return the counts that pytest prints."""
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "no:cacheprovider",
        "-m",
        marks,
        f"--junitxml=results/{name}.xml",
        *words,
        ".",
    ]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    summary = done.stdout.strip().splitlines()[-1]
    return Counter(
        {name: int(count) for count, name in re.findall(r"(\d+) (passed|failed|errors?|skipped|deselected)", summary)}
    )


@pytest.mark.parametrize("processes", [(), ("-n", "2")], ids=["one process", "two processes"])
def test_each_test_counts_once_and_the_sum_is_that_of_pytest(tmp_path: Path, processes: tuple[str, ...]) -> None:
    folder = project(tmp_path, beside=BESIDE, alone=ALONE)
    own = run(folder, "beside", f"{SELECTION} and not alone", *processes) + run(
        folder, "alone", f"{SELECTION} and alone"
    )
    results = read(sorted((folder / "results").glob("*.xml")))
    both_ends = 2  # pytest counts two of the tests twice: their result, and the failure of their teardown
    assert (
        results.ran + results.skipped.total()
        == sum(own[name] for name in ("passed", "failed", "skipped", "error", "errors")) - both_ends
    )
    assert results.passed == {"unit": 6, "rostest": 1} and results.skipped == {"no camera": 2}
    assert sorted(name.rpartition("::")[2] for name in results.failed) == [
        "test_fails", "test_fails_and_ends_badly", "test_never_begins", "test_passes_and_ends_badly"
    ]  # fmt: skip
    assert results.not_selected == {"slow": 2, "live": 2}
    assert processes or own["deselected"] == 4  # pytest-xdist does not print deselected tests
    assert results.seconds > 0.0
    assert line(results, 1) == (
        "scripts/test: 7 passed (6 unit, 1 rostest), 4 failed, 2 skipped (2 no camera), 4 not selected (2 "
        f"live, 2 slow); {results.seconds:.0f} s; FAILED (code 1)"
    )


def test_a_run_of_one_kind_loads_no_file_of_the_other(tmp_path: Path) -> None:
    folder = project(tmp_path, beside="raise SystemExit('loaded')", alone=ALONE)
    assert run(folder, "alone", f"{SELECTION} and alone") == {"passed": 2, "deselected": 3}


def test_figures_of_all_tests_stand_in_one_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = project(tmp_path, alone=ALONE, beside="def test_other(figure): figure('rate', 1e3, 'Hz')")
    for name, marks in (("beside", "not alone"), ("alone", "alone")):
        run(folder, name, marks)
    assert main(0, folder / "results") == 0
    table = (folder / "results/figures.txt").read_text()
    assert table == "cost of a cycle       3.25 us\nrate                  1000 Hz\n"
    assert table in capsys.readouterr().out


COUNTED = """
import pytest
@pytest.mark.parametrize("backend", ["fr3", "panda"])
def test_moves(backend): assert backend == "fr3"
@pytest.mark.parametrize("plant_type", ["mujoco_ros_control/MujocoPlant"])
@pytest.mark.parametrize("i", [1, 2])
def test_falls(plant_type, i): pass
"""


def test_what_passed_on_each_back_end_and_engine_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = project(tmp_path, beside=COUNTED)
    run(folder, "beside", "not alone")
    main(0, folder / "results")
    assert "contract and plants: 3 passed (2 mujoco, 1 fr3)\n" in capsys.readouterr().out


def test_a_run_of_nothing_is_no_success(tmp_path: Path) -> None:
    assert main(0, tmp_path) == 5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def test_it(roscore): pass", "fixture roscore"),
        ("import pytest\n@pytest.mark.live\ndef test_it(): pass", "marked live"),
        ("import pytest\n@pytest.mark.alone\ndef test_it(): pass", "marked alone"),
    ],
)
def test_a_file_that_needs_to_be_alone_and_does_not_say_so_is_refused(tmp_path: Path, text: str, reason: str) -> None:
    fixture = "import pytest\n@pytest.fixture\ndef roscore(): pass\n"
    folder = project(tmp_path, beside=fixture + text)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "."], cwd=folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode != 0
    assert reason in done.stderr and "pytestmark = pytest.mark.alone" in done.stderr


@pytest.mark.parametrize("words", [("--live",), ("--live", "-sx")])
def test_a_file_behind_an_option_without_value_is_all_that_is_run(tmp_path: Path, words: tuple[str, ...]) -> None:
    file = tmp_path / "test_here.py"
    file.write_text("import pytest\n\n\n@pytest.mark.live\ndef test_it():\n    pass\n")
    environment = os.environ | {"HRIC_TEST_RESULTS": str(tmp_path)}
    command = [str(ROOT / "scripts" / "test"), *words, str(file), "-p", "no:cacheprovider"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert "collected 1 item\n" in done.stdout and "scripts/test: 1 passed" in done.stdout, done.stdout + done.stderr
