"""For all tests of the workspace: helpers beside tests can be imported, and the last line says how many of which kind ran."""

from __future__ import annotations

import logging
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).parent
KINDS = ("unit", "integration", "rostest", "benchmark")
REAL_TIME = re.compile(
    "client|cost|launch\\b|live|loop|node|on_the_wire|publish|rate|realtime|record|replay|rostest|run_time|same_motion|services|socket|stream|switching"
    "|test_marker$|third_party|watchdog|who_goes"
)
"""Names of test files that keep real time, or start processes that do: these run alone, all others side by side, also those with an emulated control
box whose clock waits for its client, unless they count what libfranka may leave out on a busy machine."""
LIVE = ("integration", "benchmarks")
"""Folders of tests that do so as well."""
# A helper file beside the tests of a package is imported by its name, which must be unique in the workspace.
sys.path[:0] = [
    str(folder)
    for folder in sorted([*ROOT.glob("src/*/test"), ROOT / "tests" / "integration", ROOT / "tests" / "benchmarks"])
    if str(folder) not in sys.path
]


def alone(path: Path) -> bool:
    """Whether the tests of a file run alone."""
    return path.parent.name in LIVE or (path.parent.name != "plants" and REAL_TIME.search(path.stem) is not None)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """A run of those that run alone, or of the others, loads no file of the other kind: loading all takes longer than most tests."""
    marks = config.option.markexpr.split(" and ")
    unwanted = {True: "not alone", False: "alone"}[alone(collection_path)]
    return (collection_path.name.startswith("test_") and unwanted in marks) or None


def kind(item: pytest.Item) -> str:
    """What a test counts as in the closing line."""
    if item.get_closest_marker("rostest"):
        return "rostest"
    if "benchmarks" in item.path.parts:
        return "benchmark"
    return "integration" if "integration" in item.path.parts else "unit"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        item.user_properties.append(("kind", kind(item)))
        if alone(item.path):
            item.add_marker("alone")


@contextmanager
def _log_as_it_was() -> Iterator[None]:
    """A node in the test's process sends what "hric" logs to rosout, and nowhere else: not for the tests that follow."""
    logger = logging.getLogger("hric")
    kept = logger.propagate, logger.level, logger.handlers[:]
    yield
    logger.propagate, logger.level, logger.handlers[:] = kept


@pytest.fixture(autouse=True)
def _log_as_before_the_test() -> Iterator[None]:
    with _log_as_it_was():
        yield


@pytest.fixture(autouse=True, scope="module")
def _log_as_before_the_file() -> Iterator[None]:
    """A fixture of the whole file may hold a node, too."""
    with _log_as_it_was():
        yield


class Tally:
    """Counts the tests that really ran, by kind."""

    def __init__(self) -> None:
        self.ran: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            self.ran[str(dict(report.user_properties)["kind"])] += 1

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        terminalreporter.write_line(f"ran: {', '.join(f'{self.ran[name]} {name}' for name in KINDS)}")
        if path := os.environ.get("HRIC_TALLY"):
            with Path(path).open("a") as file:
                file.write(" ".join(str(self.ran[name]) for name in KINDS) + "\n")


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Tally(), "hric-tally")
